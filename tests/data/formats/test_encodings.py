"""Copies of text files in UTF-16 and UTF-32, as spreadsheets and shells write them, say the same as those in UTF-8."""

from collections.abc import Callable
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pandas as pd
import pytest

from benchmarks import sensor_layouts
from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.readers import reader_of
from rearl_jax.data.recordings import iterate_recordings
from tests.data.formats import ngsim_files, openacc_files, sumo_files, vissim_files
from tests.refusal import refused


def german_vissim(folder: Path) -> Path:
    text = vissim_files.german_record_of(vissim_files.rows(3, 60), comma=True)
    return vissim_files.write(folder, text) / "run_001.fzp"


def old_vissim(folder: Path) -> Path:
    return vissim_files.write(folder, vissim_files.old_record_of(vissim_files.rows(3, 60))) / "run_001.fzp"


def openacc(folder: Path) -> Path:
    return written(folder / "part1.csv", openacc_files.run_of(openacc_files.columns()))


def sumo_xml(folder: Path) -> Path:
    return written(folder / "fcd.xml", sumo_files.xml_of(sumo_files.rows(4, 30)))


def sumo_csv(folder: Path) -> Path:
    return written(folder / "fcd.csv", sumo_files.csv_of(sumo_files.rows(4, 30)))


def pneuma(folder: Path) -> Path:
    lines = map(sensor_layouts.pneuma_line, islice(sensor_layouts.traffic(10.0, directions=(2,)), 3))
    return written(folder / "a.csv", "\n".join([sensor_layouts.PNEUMA_HEADER, *lines]) + "\n")


def i24(folder: Path) -> Path:
    sensor_layouts.write_i24(folder / "day.json", 1)
    return folder / "day.json"


def ngsim(folder: Path) -> Path:
    return written(folder / "a.csv", ngsim_files.published().to_csv(index=False))


def ngsim_text(folder: Path) -> Path:
    return written(folder / "us-101.txt", ngsim_files.text_of(ngsim_files.published()))


def written(path: Path, text: str) -> Path:
    """The path, after the text has been written to it."""
    path.write_text(text, encoding="utf-8")
    return path


WRITERS: list[tuple[str, Callable[[Path], Path]]] = [
    ("vissim", german_vissim),
    ("vissim", old_vissim),
    ("openacc", openacc),
    ("sumo", sumo_xml),
    ("sumo", sumo_csv),
    ("pneuma", pneuma),
    ("i24", i24),
    ("ngsim", ngsim),
    ("ngsim", ngsim_text),
]


def _config(name: str, folder: Path, on_bad: BadRows = BadRows.stop) -> DataConfig:
    config = DataConfig(DataFormat[name], str(folder), on_bad=on_bad)
    if name == "pneuma":
        return replace(config, stretch=sensor_layouts.pneuma_stretch())
    return replace(config, window=None, section=None) if name == "i24" else config


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32"])
@pytest.mark.parametrize(("name", "write"), WRITERS, ids=[write.__name__ for _, write in WRITERS])
def test_a_copy_in_another_encoding_is_recognised_and_says_the_same(name, write, encoding, tmp_path):
    file = write(tmp_path)
    (expected,) = iterate_recordings(_config(name, tmp_path))
    with file.open(newline="", encoding="utf-8") as content:
        file.write_bytes(content.read().encode(encoding))
    recognises = reader_of(DataFormat[name]).recognises
    assert recognises is not None
    assert recognises(file) == file
    (found,) = iterate_recordings(_config(name, tmp_path))
    pd.testing.assert_frame_equal(found.table, expected.table)


def test_a_copy_that_is_cut_off_within_a_character_has_a_broken_line(tmp_path):
    file = german_vissim(tmp_path)
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
