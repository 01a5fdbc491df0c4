"""Files in a folder of recordings: hidden, packed, nested and foreign ones, and copies of the same recording."""

import bz2
import gzip
import lzma
import os
import shutil
import zipfile
from pathlib import Path

import pandas as pd
import pytest

from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.files.folder import file_name_of, is_visible, only_parquet
from rearl_jax.data.formats.highd import find_recordings
from rearl_jax.data.recordings import count_recordings, iterate_recordings
from rearl_jax.data.tables.canonical import TableFile, find_tables
from rearl_jax.problems import MissingInputError
from tests.data.table_files import read_table, write_table
from tests.refusal import refused


@pytest.fixture
def table(timed_rows, tmp_path):
    return write_table(timed_rows, tmp_path / "a.csv")


def _names(folder):
    return [recording.info.id for recording in iterate_recordings(DataConfig(DataFormat.table, str(folder)))]


@pytest.mark.parametrize("hidden", [".~lock.a.csv", "._a.csv", "~$a.csv", ".a.csv"])
def test_hidden_files_are_left_out(table, hidden):
    shutil.copy(table, table.with_name(hidden))
    (table.parent / "b.csv").mkdir()
    assert _names(table.parent) == ["a"]
    assert find_tables(table.with_name(hidden)) == [table.with_name(hidden)]  # named, it is meant


def test_hidden_companions_of_highd_and_of_parquet_are_left_out(highd_files, tmp_path):
    tracks = highd_files(tmp_path)
    (tmp_path / "._01_tracks.csv").write_bytes(b"\0\5\26\7")
    assert find_recordings(tmp_path) == [tracks]
    (tmp_path / "a.parquet").touch()
    (tmp_path / "._a.parquet").touch()
    assert only_parquet(tmp_path, "one") == tmp_path / "a.parquet"


def test_archives_are_closed(table, monkeypatch):
    archives = []

    class Kept(zipfile.ZipFile):
        def __init__(self, *args, **keys) -> None:
            super().__init__(*args, **keys)
            archives.append(self)

    path = table.with_name("b.csv.zip")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("b.csv", table.read_text())
    monkeypatch.setattr(zipfile, "ZipFile", Kept)
    read_table(path)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("c.csv", "")
    with refused("not-a-table", file=str(path)):
        read_table(path)
    assert len(archives) > 2
    assert all(archive.fp is None for archive in archives)


@pytest.mark.parametrize("ending", [".gz", ".bz2", ".xz", ".zip"])
def test_compressed_tables_are_read(table, ending):
    expected = TableFile(table, DataConfig()).read("a").table
    content, packed = table.read_bytes(), table.with_name(f"a.csv{ending}")
    if ending == ".zip":
        with zipfile.ZipFile(packed, "w") as archive:
            archive.writestr("a.csv", content)
    else:
        packed.write_bytes({".gz": gzip, ".bz2": bz2, ".xz": lzma}[ending].compress(content))
    table.unlink()
    (recording,) = iterate_recordings(DataConfig(DataFormat.table, str(packed.parent)))
    assert recording.info.id == "a"
    pd.testing.assert_frame_equal(recording.table, expected)
    packed.write_bytes(packed.read_bytes()[: packed.stat().st_size // 2])
    with refused("not-text", file=str(packed)):
        TableFile(packed, DataConfig()).read("a")


@pytest.mark.parametrize("ending", [".gz", ".bz2", ".xz", ".zip"])
def test_a_plain_table_with_the_ending_of_a_packed_one_is_read(table, ending):
    expected = TableFile(table, DataConfig()).read("a").table
    (recording,) = iterate_recordings(DataConfig(DataFormat.table, str(table.rename(f"{table}{ending}"))))
    pd.testing.assert_frame_equal(recording.table, expected)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n", "Git LFS"),
        ("<!DOCTYPE html>\n<html><head><title>Sign in</title></head></html>\n", "web page"),
        ('<?xml version="1.0"?>\n<net/>\n', "XML"),
    ],
)
def test_what_is_downloaded_instead_of_a_table_is_named(table, text, what):
    table.write_text(text)
    with refused("not-a-table", file=str(table)) as caught:
        _names(table.parent)
    assert what in caught.value.problem.fault


def test_files_that_are_left_out_below_the_folder_are_told_of(table, caplog):
    deep = table.parent / "tuesday"
    deep.mkdir()
    shutil.copy(table, deep / "b.csv")
    assert _names(table.parent) == ["a"]
    told = [record.getMessage() for record in caplog.records if str(deep) in record.getMessage()]
    assert len(told) == 1


def test_tables_of_a_task_that_did_not_finish_are_told_of(table, caplog):
    tables = table.parent / "study" / "tables"
    tables.mkdir(parents=True)
    shutil.copy(table, tables / "b.csv")
    (tables.parent / "config.json").write_text("{}")
    assert _names(tables) == ["b"]
    assert [str(tables) in record.getMessage() for record in caplog.records] == [True]


def test_a_name_that_is_not_text_is_to_be_changed(table):
    strange = Path(os.fsdecode(bytes(table.parent) + b"/stra\xdfe.csv"))
    try:
        table.rename(strange)
    except OSError:
        pytest.skip("the file system takes text names only")
    for path in (strange, table.parent):
        with refused("name-not-text", file=f"{table.parent}/stra\\xdfe.csv"):
            find_tables(path)


def test_the_folder_of_a_study_is_no_folder_of_tables(table, tmp_path):
    study = tmp_path / "results" / "s"
    (study / "tables").mkdir(parents=True)
    (study / "config.json").write_text("{}")
    pd.DataFrame({"recording": ["a"], "rows": [1]}).to_parquet(study / "recordings.parquet")
    pd.read_csv(table).to_parquet(study / "tables" / "a.parquet")
    for root in (study, tmp_path / "results"):
        with refused("recordings-missing", MissingInputError, file=str(root)) as caught:
            find_tables(root)
        assert f"{study / 'tables'}" in caught.value.problem.fault
    assert find_tables(study / "tables") == [study / "tables" / "a.parquet"]


def test_archives_and_folders_below_are_pointed_out(table, tmp_path):
    deep = tmp_path / "one" / "two"
    deep.mkdir(parents=True)
    shutil.move(table, deep / "a.csv")
    with refused("recordings-missing", MissingInputError) as caught:
        find_tables(tmp_path)
    assert str(deep) in caught.value.problem.fault
    (tmp_path / "all.zip").touch()
    for find in (find_tables, find_recordings):
        with refused("recordings-missing", MissingInputError) as caught:
            find(tmp_path)
        assert "unpack all.zip" in caught.value.problem.fault


@pytest.mark.parametrize("text", ["hour,rain\n1,0\n", "track_id,length,vehicle_class\n1,4.2,car\n"])
def test_a_foreign_table_is_named_as_such(table, text):
    other = table.with_name("weather.csv")
    other.write_text(text)
    with refused("not-a-table", file=str(other)):
        _names(table.parent)


def test_the_same_rows_under_another_name_stop(table):
    copy = table.with_name("b.parquet")
    pd.read_csv(table).to_parquet(copy)
    with refused("rows-twice", file=str(copy)) as caught:
        _names(table.parent)
    assert str(table) in caught.value.problem.fault
    pd.read_csv(table).assign(time=lambda rows: rows["time"] + 3600.0).to_parquet(copy)
    assert _names(table.parent) == ["a", "b"]
    rows = pd.read_csv(table)
    rows[rows["track_id"] >= rows["track_id"].median()].to_parquet(copy)
    with refused("rows-twice", file=str(copy)) as caught:
        _names(table.parent)
    assert "are also in a" in caught.value.problem.fault


def test_one_name_in_two_files_names_both(table):
    pd.read_csv(table).to_parquet(table.with_suffix(".parquet"))
    with refused("recording-twice") as caught:
        count_recordings(DataConfig(DataFormat.table, str(table.parent)))
    for path in (table, table.with_suffix(".parquet")):
        assert str(path) in caught.value.problem.fault


@pytest.mark.parametrize("name", "..\\cam 1|a/b|/|..|.hidden|~$a|con|NUL.1|a:b|ä?|a.".split("|") + ["x" * 300])
def test_every_name_of_a_recording_makes_a_file_name(name, tmp_path):
    file = file_name_of(name)
    assert (tmp_path / f"{file}.parquet").parent == tmp_path
    assert is_visible(tmp_path / f"{file}.parquet")
    assert len(file) < 200
    assert not set('/\\:*?"<>|') & set(file)
    assert file_name_of(f"{name}x") != file
    assert file_name_of("highd_01-a.b") == "highd_01-a.b"
    twin = file_name_of(name.swapcase())
    assert twin == file or file_name_of(name, {twin}).lower() != twin.lower()
    assert file_name_of(name, {file}) == file


@pytest.mark.parametrize(("delimiter", "decimal"), [(";", "."), (";", ","), ("\t", "."), ("\t", ","), ("|", ".")])
def test_other_delimiters_and_decimal_commas_are_read(table, delimiter, decimal):
    expected = TableFile(table, DataConfig()).read("a").table
    pd.read_csv(table).to_csv(table, sep=delimiter, decimal=decimal, index=False)
    assert "," in table.read_text() or decimal == "."
    pd.testing.assert_frame_equal(TableFile(table, DataConfig()).read("a").table, expected)
    lines = table.read_text().splitlines()
    table.write_text("\n".join([*lines[:9], delimiter.join(lines[9].split(delimiter)[:-2]), *lines[10:]]))
    with refused("line-broken", row=9):
        TableFile(table, DataConfig()).read("a")
