"""Data sets as streams of recordings: lazy, selectable, identified."""

import dataclasses
from importlib import import_module

import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.readers import reader_of
from rearl_jax.data.recordings import (
    count_recordings,
    data_id,
    file_stamps,
    has_one_clock,
    is_generated,
    iterate_recordings,
)
from rearl_jax.data.schema import COLUMNS, Recording, RecordingInfo, validate
from rearl_jax.data.tables.canonical import write_recording
from rearl_jax.problems import MissingInputError
from tests.refusal import refused


@pytest.fixture
def highd(highd_files, tmp_path) -> DataConfig:
    for number in ("01", "02", "10"):
        highd_files(tmp_path, number, seed=int(number))
    return DataConfig(DataFormat.highd, str(tmp_path))


def test_recordings_come_in_order_and_can_be_selected(highd):
    assert count_recordings(highd) == 3
    assert [r.info.id for r in iterate_recordings(highd)] == ["highd_01", "highd_02", "highd_10"]
    some = dataclasses.replace(highd, recordings="highd_0?")
    assert count_recordings(some) == 2
    assert [r.info.id for r in iterate_recordings(some)] == ["highd_01", "highd_02"]
    with refused("selects-none", key="data.recordings"):
        count_recordings(dataclasses.replace(highd, recordings="us101_*"))


def test_the_name_of_a_recording_selects_it_even_with_brackets(timed_rows, tmp_path):
    for name in ("run[1]", "run2"):
        timed_rows.to_csv(tmp_path / f"{name}.csv", index=False)
    data = DataConfig(DataFormat.table, str(tmp_path), recordings="run[1]")
    assert [r.info.id for r in iterate_recordings(data)] == ["run[1]"]
    assert [r.info.id for r in iterate_recordings(dataclasses.replace(data, recordings="run[2]"))] == ["run2"]


def test_nothing_is_read_before_it_is_asked_for(highd, tmp_path):
    (tmp_path / "02_tracks.csv").write_text("damaged")
    stream = iterate_recordings(highd)
    assert count_recordings(highd) == 3
    assert next(stream).info.id == "highd_01"
    with refused("column-missing", column="frame"):
        next(stream)


def test_every_kind_has_a_reader_and_names_what_it_wants(tmp_path):
    for kind in DataFormat:
        if kind.shipped:
            continue
        with refused("root-unset", MissingInputError, key="data.root"):
            count_recordings(DataConfig(kind))
        with refused("root-missing", MissingInputError, key="data.root"):
            count_recordings(DataConfig(kind, str(tmp_path / "nowhere")))
        with refused("recordings-missing", MissingInputError):
            count_recordings(DataConfig(kind, str(tmp_path)))


def test_the_identity_follows_the_rows_and_the_policy(highd, tmp_path):
    before = data_id(highd)
    assert before.startswith("highd-")
    assert data_id(highd) == before
    others = {
        data_id(dataclasses.replace(highd, **change))
        for change in ({"recordings": "highd_01"}, {"on_bad": BadRows.drop_row}, {"max_jump": 3.0})
    }
    path = tmp_path / "10_tracks.csv"
    path.write_text(path.read_text().replace("Truck", "Car").replace("0.1", "0.2"))
    others.add(data_id(highd))
    assert before not in others
    assert len(others) == 4


def test_what_is_stated_beside_a_table_is_part_of_its_identity(vehicle_rows, tmp_path):
    info = RecordingInfo("made", 10.0, {1: 2}, 300.0, "hand", "CC0", "nobody")
    path = write_recording(Recording(info, validate(vehicle_rows, info, DataConfig())[0]), tmp_path / "made.csv")
    data = DataConfig(DataFormat.table, str(path))
    before, stamps = data_id(data), file_stamps(data)
    assert [name for name, _, _ in stamps] == ["made.csv", "made.csv.info.json"]
    beside = path.with_name("made.csv.info.json")
    text = beside.read_text()
    beside.write_text(text.replace('"speed_limit": null', '"speed_limit": 33.3'))
    assert beside.read_text() != text
    assert next(iterate_recordings(data)).info.speed_limit == 33.3
    assert data_id(data) != before
    assert file_stamps(data) != stamps


def test_generated_recordings_stay_generated_when_read_as_highd(highd, tmp_path):
    assert not is_generated(highd)
    (tmp_path / "generator.json").write_text("{}")
    assert is_generated(highd)
    first = next(iterate_recordings(highd))
    assert (first.info.id, first.info.generated) == ("generated_01", True)
    assert not is_generated(DataConfig())


def test_all_readers_deliver_the_same_schema(highd):
    expected = {c.name: c.dtype for c in COLUMNS}
    for data in (highd, DataConfig(recordings="us101_0820")):
        table = next(iterate_recordings(data)).table
        assert {name: str(dtype) for name, dtype in table.dtypes.items()} == expected
        assert isinstance(table.index, pd.RangeIndex)


@pytest.mark.parametrize(
    ("change", "code", "key"),
    [
        ({"format": DataFormat.highd}, "root-missing", "root"),
        ({"recordings": ""}, "out-of-range", "recordings"),
        ({"max_jump": 0.0}, "out-of-range", "max_jump"),
        ({"max_jump": float("nan")}, "out-of-range", "max_jump"),
        ({"default_length": 0.5}, "out-of-range", "default_length"),
    ],
)
def test_values_out_of_range_are_refused(change, code, key):
    DataConfig().check()
    with refused(code, key=key):
        DataConfig(**change).check()


@pytest.mark.parametrize(
    "key",
    [
        {"columns": {"x": "y"}},
        {"ring": 230.0},
        {"stretch": (37.9, 23.7, 37.9, 23.8, 9.0, 3.0)},
        {"window": 60.0},
        {"section": None},
    ],
)
def test_keys_of_other_formats_are_refused(key):
    with refused("key-without-effect", key=f"data.{next(iter(key))}"):
        next(iterate_recordings(DataConfig(**key)))


def test_a_format_is_a_module_that_holds_a_reader(monkeypatch):
    for kind in DataFormat:
        module = import_module(f"rearl_jax.data.readers.{kind.name}")
        assert reader_of(kind) is module.READER
        assert module.__doc__
    assert DataFormat.us101.shipped
    assert not DataFormat.highd.shipped
    monkeypatch.delattr(import_module("rearl_jax.data.readers.table"), "READER")
    with pytest.raises(TypeError, match=r"table\.py must hold a Reader called READER"):
        reader_of(DataFormat.table)


def test_cameras_and_simulations_have_one_clock_and_loggers_may_not():
    clocks = {kind: has_one_clock(DataConfig(format=kind)) for kind in DataFormat}
    assert clocks[DataFormat.i80]
    assert clocks[DataFormat.sumo]
    assert not clocks[DataFormat.openacc]
    assert not clocks[DataFormat.table]
