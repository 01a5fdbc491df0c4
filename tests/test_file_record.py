"""A study that begins anew in a folder removes the files of another one, and nothing else."""

from pathlib import Path

import pandas as pd
import pytest

from rearl_jax.results import Study
from tests.refusal import refused

FRAME = pd.DataFrame({"a": [1]})


def begun(root, config, task="a task", name="study", **options) -> Study:
    study = Study(root, name, config, task)
    study.write_config(**options)
    return study


def names(study: Study) -> list[str]:
    return sorted(path.relative_to(study.path).as_posix() for path in study.path.rglob("*"))


@pytest.mark.parametrize("changes", [{"config": {"key": 2}}, {"task": "another"}])
def test_files_of_another_study_are_removed(tmp_path, changes):
    first = begun(tmp_path, {"key": 1})
    first.write_table("tables/one", FRAME)
    first.write_table("rows", FRAME)
    first.write_bytes("rows.png", b"png")
    first.recorded_path("model.yaml").write_text("model")
    (first.path / "notes.txt").write_text("mine")
    del first
    second = begun(tmp_path, **({"config": {"key": 1}} | changes))
    assert names(second) == ["config.json", "notes.txt"]


def test_the_same_study_keeps_its_files(tmp_path):
    begun(tmp_path, {"key": 1}).write_table("rows", FRAME)
    again = begun(tmp_path, {"key": 1})
    assert names(again) == ["config.json", "rows.parquet"]
    again.write_table("more", FRAME)
    del again
    assert names(begun(tmp_path, {"key": 2})) == ["config.json"]


def test_files_that_a_task_checks_by_itself_stay_and_remain_known(tmp_path):
    first = begun(tmp_path, {"key": 1})
    first.write_bytes("reference/a.npz", b"a")
    first.write_bytes("rows.png", b"png")
    del first
    second = begun(tmp_path, {"key": 2}, reusable=("reference/",))
    assert names(second) == ["config.json", "reference", "reference/a.npz"]
    del second
    assert names(begun(tmp_path, {"key": 3})) == ["config.json"]


def test_studies_inside_go_with_the_one_that_made_them(tmp_path):
    first = begun(tmp_path, {"key": 1})
    first.recorded_path("groups/truck/")
    begun(first.path / "groups", {"key": 1}, name="truck").write_table("null", FRAME)
    del first
    # The lock stays: another process may be waiting for it.
    assert names(begun(tmp_path, {"key": 2})) == ["config.json", "groups", "groups/.truck.lock"]


def test_files_that_are_to_be_read_are_not_removed(tmp_path):
    first = begun(tmp_path, {"key": 1})
    first.write_table("tables/one", FRAME)
    del first
    root = str(tmp_path / "study" / "tables")
    with refused("input-in-study", key="data.root"):
        begun(tmp_path, {"data": {"root": root}})
    assert (tmp_path / "study" / "tables" / "one.parquet").exists()
    begun(tmp_path, {"data": {"root": root}}, name="other")


def test_a_damaged_record_removes_nothing(tmp_path):
    begun(tmp_path, {"key": 1}).write_table("rows", FRAME)
    (tmp_path / ".study.files").write_bytes(b"\xff\xfe")
    assert "rows.parquet" in names(begun(tmp_path, {"key": 2}))


@pytest.mark.parametrize("inside", ["../outside", "a/../../outside", "{root}/outside"])
def test_a_changed_record_leads_to_no_file_elsewhere(tmp_path, inside):
    (tmp_path / "outside").write_text("mine")
    begun(tmp_path, {"key": 1}).write_table("rows", FRAME)
    with (tmp_path / ".study.files").open("a") as record:
        record.write(inside.format(root=tmp_path) + "\n")
    assert names(begun(tmp_path, {"key": 2})) == ["config.json"]
    assert (tmp_path / "outside").exists()


def test_the_summary_is_the_first_file_that_is_removed(tmp_path, monkeypatch):
    first = begun(tmp_path, {"key": 1})
    first.write_table("rows", FRAME)
    first.write_summary({"figure": 1})
    del first
    unlink = Path.unlink

    def fail_at_rows(path, missing_ok=False):
        if path.name == "rows.parquet":
            raise KeyboardInterrupt
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", fail_at_rows)
    with pytest.raises(KeyboardInterrupt):
        begun(tmp_path, {"key": 2})
    monkeypatch.undo()
    assert Study(tmp_path, "study", {"key": 1}, "a task").finished_summary() is None
    assert names(begun(tmp_path, {"key": 2})) == ["config.json"]


def test_a_record_whose_last_line_was_cut_is_continued_in_whole_lines(tmp_path):
    begun(tmp_path, {"key": 1}).write_table("rows", FRAME)
    record = tmp_path / ".study.files"
    record.write_text(record.read_text().rstrip("\n") + "\nmor")
    begun(tmp_path, {"key": 1}).write_table("more", FRAME)
    assert names(begun(tmp_path, {"key": 2})) == ["config.json"]


def test_the_record_is_replaced_as_a_whole(tmp_path, monkeypatch):
    begun(tmp_path, {"key": 1}).write_table("rows", FRAME)
    before = (tmp_path / ".study.files").read_text()

    def stop(old, new):
        raise KeyboardInterrupt

    monkeypatch.setattr("rearl_jax.whole_files.os.replace", stop)
    with pytest.raises(KeyboardInterrupt):
        begun(tmp_path, {"key": 2})
    assert (tmp_path / ".study.files").read_text() == before


def test_a_text_too_long_for_a_path_names_no_file(tmp_path):
    begun(tmp_path, {"key": 1}).write_table("rows", FRAME)
    assert names(begun(tmp_path, {"key": "x" * 300})) == ["config.json"]
