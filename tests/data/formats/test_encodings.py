"""Copies of text files in UTF-16 and UTF-32, as spreadsheets and shells write them, say the same as those in UTF-8."""

from collections.abc import Callable
from itertools import islice
from pathlib import Path

import pandas as pd
import pytest

from benchmarks import sensor_layouts
from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.readers import reader_of
from rearl_jax.data.recordings import iterate_recordings
from tests.data.formats import openacc_files, sumo_files, vissim_files
from tests.refusal import refused


def _vissim(folder: Path) -> Path:
    return vissim_files.write(folder, vissim_files.german_record_of(vissim_files.rows(3, 60), comma=True))


def _old_vissim(folder: Path) -> Path:
    return vissim_files.write(folder, vissim_files.old_record_of(vissim_files.rows(3, 60)))


def _openacc(folder: Path) -> Path:
    path = folder / "part1.csv"
    path.write_text(openacc_files.run_of(openacc_files.columns()))
    return folder


def _sumo_xml(folder: Path) -> Path:
    return sumo_files.write(folder, sumo_files.xml_of(sumo_files.rows(4, 30)), beside=False)


def _sumo_csv(folder: Path) -> Path:
    return sumo_files.write(folder, sumo_files.csv_of(sumo_files.rows(4, 30)), "fcd.csv", beside=False)


def _pneuma(folder: Path) -> Path:
    lines = map(sensor_layouts.pneuma_line, islice(sensor_layouts.traffic(10.0, directions=(2,)), 3))
    (folder / "a.csv").write_text("\n".join([sensor_layouts.PNEUMA_HEADER, *lines]) + "\n")
    return folder


def _i24(folder: Path) -> Path:
    sensor_layouts.write_i24(folder / "day.json", 1)
    return folder


def _ngsim(folder: Path) -> Path:
    ngsim_rows().to_csv(folder / "a.csv", index=False)
    return folder


def _ngsim_text(folder: Path) -> Path:
    rows = ngsim_rows()
    for at, name in ((6, "Global_X"), (7, "Global_Y"), (14, "Preceding"), (15, "Following"), (16, "Space"), (17, "T")):
        rows.insert(at, name, 0.0)
    (folder / "us-101.txt").write_text(rows.to_string(header=False, index=False))
    return folder


def ngsim_rows() -> pd.DataFrame:
    """A car on US-101 in feet, for 6 s from 7:50."""
    frames = pd.RangeIndex(100, 160).to_numpy()
    columns = {
        "Vehicle_ID": 1,
        "Frame_ID": frames,
        "Total_Frames": 60,
        "Global_Time": 1118846979700 + 100 * frames,
        "Local_X": 17.0,
        "Local_Y": 200.0 + 4.0 * (frames - 100),
        "v_Length": 15.0,
        "v_Width": 6.0,
        "v_Class": 2,
        "v_Vel": 40.0,
        "v_Acc": 0.0,
        "Lane_ID": 2,
    }
    return pd.DataFrame(columns)


WRITERS: list[tuple[str, Callable[[Path], Path]]] = [
    ("vissim", _vissim),
    ("vissim", _old_vissim),
    ("openacc", _openacc),
    ("sumo", _sumo_xml),
    ("sumo", _sumo_csv),
    ("pneuma", _pneuma),
    ("i24", _i24),
    ("ngsim", _ngsim),
    ("ngsim", _ngsim_text),
]


def _config(name: str, folder: Path, on_bad: BadRows = BadRows.stop) -> DataConfig:
    stretch = sensor_layouts.pneuma_stretch() if name == "pneuma" else None
    return DataConfig(DataFormat[name], str(folder), on_bad=on_bad, stretch=stretch, window=None, section=None)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32"])
@pytest.mark.parametrize(("name", "write"), WRITERS, ids=[write.__name__.lstrip("_") for _, write in WRITERS])
def test_a_copy_in_another_encoding_is_recognised_and_says_the_same(name, write, encoding, tmp_path):
    folder = write(tmp_path)
    (file,) = folder.glob("*")
    (expected,) = iterate_recordings(_config(name, folder))
    with file.open(newline="", encoding="utf-8") as content:
        file.write_bytes(content.read().encode(encoding))
    recognises = reader_of(DataFormat[name]).recognises
    assert recognises is not None
    assert recognises(file) == file
    (found,) = iterate_recordings(_config(name, folder))
    pd.testing.assert_frame_equal(found.table, expected.table)


def test_a_copy_that_is_cut_off_within_a_character_has_a_broken_line(tmp_path):
    (file,) = _vissim(tmp_path).glob("*")
    file.write_bytes(file.read_text(encoding="utf-8").encode("utf-16")[:-31])
    with refused("line-broken", file=str(file)):
        list(iterate_recordings(_config("vissim", tmp_path)))
    (found,) = iterate_recordings(_config("vissim", tmp_path, BadRows.drop_row))
    assert found.dropped["broken_line"] == 1


def test_documents_behind_other_letters_are_found_in_every_window(tmp_path):
    file = tmp_path / "day.json"
    sensor_layouts.write_i24(file, 300_000)
    text = file.read_text(encoding="utf-8").replace('"_id"', '"place": "Nashville \U0001f697 \u00e9", "_id"')
    config = DataConfig(DataFormat.i24, str(file), window=10.0, section=300.0)
    file.write_text(text, encoding="utf-8")
    expected = {recording.info.id: recording.table for recording in iterate_recordings(config)}
    assert len(expected) > 1
    for encoding in ("utf-16", "utf-16-be", "utf-32"):
        file.write_bytes(text.encode(encoding))
        found = {recording.info.id: recording.table for recording in iterate_recordings(config)}
        assert found.keys() == expected.keys()
        for name, table in found.items():
            pd.testing.assert_frame_equal(table, expected[name])
