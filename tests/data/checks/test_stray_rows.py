"""Rows of one recording under two names: by a slip, or in two spellings; real recordings in one table stay apart."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.data.tables.in_memory import in_memory
from tests.data.made_rows import with_values
from tests.data.table_files import write_table
from tests.refusal import refused


@pytest.fixture
def rows(timed_rows) -> pd.DataFrame:
    """Three vehicles of the recording cam1."""
    return timed_rows.assign(recording="cam1")


def _read(rows: pd.DataFrame, path: Path | None) -> dict[str, int]:
    """Number of rows by recording, from a file or, without a path, from memory."""
    if path is None:
        data = in_memory(rows, DataConfig())
    else:
        data = DataConfig(DataFormat.table, str(write_table(rows, path)))
    return {recording.info.id: len(recording.table) for recording in iterate_recordings(data)}


@pytest.fixture(params=["a.csv", "a.parquet", None])
def path(request, tmp_path):
    return request.param and tmp_path / request.param


@pytest.mark.parametrize(("name", "first"), [("Cam1", 7), ("Cam1", 60), ("cam2", 100), ("cam2", 60)])
@pytest.mark.parametrize("clock", ["frame", "time"])
def test_rows_of_one_recording_under_two_names_stop(rows, path, name, first, clock):
    stray = (rows["track_id"] == 3) & (rows["frame"] >= first)
    rows = rows.assign(recording=rows["recording"].mask(stray, name))
    rows = rows if clock == "frame" else rows.drop(columns="frame")
    with refused("recording-contradicts", column="recording", row=int(np.argmax(stray)) + 1):
        _read(rows, path)


@pytest.mark.parametrize("name", [None, "", "  "])
def test_a_row_without_a_name_is_named(rows, path, name):
    with refused("recording-unnamed", column="recording", row=41):
        _read(with_values(rows, 40, recording=name), path)


def test_a_number_as_a_name_is_spelt_without_a_fraction(rows, tmp_path):
    for path in (tmp_path / "a.parquet", None):
        assert _read(rows.assign(recording=7.0), path) == {"7": 300}


@pytest.mark.parametrize("name", ["cam1 ", " cam1", "cam1\t"])
def test_blanks_around_a_name_do_not_count(rows, path, name):
    assert _read(rows.assign(recording=rows["recording"].mask(rows["track_id"] == 3, name)), path) == {"cam1": 300}
    other = rows.assign(recording=name, track_id=rows["track_id"] + 10, leader_id=np.nan)
    assert _read(other, path) == {"cam1": 300}


def test_recordings_stay_apart_whose_names_differ_by_case_only(rows, path):
    both = pd.concat([rows, rows.assign(recording="Cam1", position=rows["position"] + 5.0, x=rows["x"] + 5.0)])
    assert _read(both.reset_index(drop=True), path) == {"cam1": 300, "Cam1": 300}


def test_a_recording_that_was_cut_in_two_and_one_of_a_single_vehicle_are_read(rows, path):
    halves = rows.assign(recording=np.where(rows["frame"] < 60, "cam1", "cam2"))
    assert _read(halves, path) == {"cam1": 159, "cam2": 141}
    single = rows.assign(recording=np.where(rows["track_id"] == 3, "drive", "cam1"), leader_id=np.nan)
    assert _read(single, path) == {"cam1": 200, "drive": 100}


def test_scattered_rows_of_many_vehicles_under_another_name_stop(rows, tmp_path):
    strange = np.zeros(len(rows), dtype=bool)
    strange[[20, 50, 130, 160, 240]] = True
    changed = rows.assign(recording=rows["recording"].mask(strange, "cam2"))
    for path in (None, tmp_path / "a.csv"):
        with refused("recording-contradicts", column="recording", row=21):
            _read(changed, path)
