"""A study's folder: what is written, with which provenance, and that nothing is ever half there."""

import json
import os
import platform
import subprocess
import sys
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest
from pyarrow import parquet

from rearl_jax import __version__
from rearl_jax.code_version import code_hash
from rearl_jax.results import Study, config_hash, part_name, read_metadata
from tests.refusal import refused


@dataclass
class Inner:
    width: float = 2.0


@dataclass
class Config:
    study: str = "s"
    results: str = "r"
    seed: int = 3
    inner: Inner = None  # type: ignore[assignment]


@pytest.fixture
def study(tmp_path):
    return Study(tmp_path, "mine", Config(inner=Inner()), "evaluate", "us101-0123", generated=False)


@pytest.fixture
def frame():
    return pd.DataFrame({"scene": [1, 2], "h": [0.25, 0.5], "method": pd.Categorical(["base", "base"])})


def test_table_comes_back_with_its_provenance(study, frame):
    path = study.write_table("rows", frame, seeds="0,1", mape_definition="A")
    assert path == study.path / "rows.parquet"
    pd.testing.assert_frame_equal(pd.read_parquet(path), frame)
    stored = read_metadata(path)
    assert stored.pop("git_sha", "0" * 40)[:40].isalnum()
    config = json.loads(stored.pop("config"))
    assert config == {"study": "s", "results": "r", "seed": 3, "inner": {"width": 2.0}}
    assert stored == {
        "task": "evaluate",
        "study": "mine",
        "config_hash": config_hash(Config(inner=Inner())),
        "code_version": __version__,
        "code_hash": code_hash(),
        "data_id": "us101-0123",
        "generated": "false",
        "seeds": "0,1",
        "mape_definition": "A",
    }


def test_the_same_table_is_the_same_file(study, frame):
    first = study.write_table("rows", frame).read_bytes()
    assert study.write_table("rows", frame).read_bytes() == first
    assert parquet.read_table(study.path / "rows.parquet").num_rows == 2


def test_config_hash_depends_on_values_and_not_on_the_folder():
    config = Config(inner=Inner())
    # Recorded with Python 3.11; a change makes every stored study look like another configuration.
    assert config_hash(config) == config_hash(Config(inner=Inner())) == "8d6f4282548889ec"
    assert config_hash(replace(config, study="t", results="elsewhere")) == config_hash(config)
    assert config_hash(replace(config, seed=4)) != config_hash(config)
    assert config_hash(replace(config, inner=Inner(width=3.0))) != config_hash(config)


def test_no_secret_of_the_environment_is_written(study, frame, monkeypatch):
    monkeypatch.setenv("LLM_API_KEY", "very-secret-value")
    study.write_config()
    study.write_table("rows", frame)
    study.write_summary({"h": 0.5})
    files = list(study.path.iterdir())
    assert len(files) == 3
    assert all(b"very-secret-value" not in file.read_bytes() for file in files)


def test_summary_holds_provenance_and_plain_numbers(study):
    path = study.write_summary(
        {
            "h": np.float64(0.5),
            "n_scenes": np.int64(50),
            "lcr": None,
            "rows": [{"method": "base", "h": np.float32(0.25)}],
            "base": {"h": 0.5},
        }
    )
    stored = json.loads(path.read_text())
    assert path.name == "summary.json"
    assert stored["task"] == "evaluate"
    assert stored["generated"] is False
    assert stored["data_id"] == "us101-0123"
    assert (stored["h"], stored["n_scenes"], stored["lcr"]) == (0.5, 50, None)
    assert stored["rows"] == [{"method": "base", "h": 0.25}]
    assert stored["base"] == {"h": 0.5}


def test_summary_of_several_rows_is_a_list_with_the_provenance_in_each(study):
    stored = json.loads(study.write_summary([{"method": "base", "h": 0.5}, {"method": "real", "h": None}]).read_text())
    assert [(row["method"], row["h"], row["task"]) for row in stored] == [
        ("base", 0.5, "evaluate"),
        ("real", None, "evaluate"),
    ]


@pytest.mark.parametrize(
    ("summary", "code", "key"),
    [
        ({"h": float("nan")}, "not-finite", "h"),
        ({"h": np.float32("inf")}, "not-finite", "h"),
        ({"rows": [{"h": float("nan")}]}, "not-finite", "rows[0].h"),
        ({"base": {"deep": {"h": 1.0}}}, "wrong-type", "base.deep"),
        ({"rows": [1.0]}, "wrong-type", "rows[0]"),
        ({"h": np.ones(2)}, "wrong-type", "h"),
        ({"task": "x"}, "provenance-repeated", "task"),
        ([{"method": "base", "h": float("inf")}], "not-finite", "[0].h"),
        ([{"h": 1.0}, {"task": "x"}], "provenance-repeated", "task"),
    ],
)
def test_summary_refuses(study, summary, code, key):
    with refused(code, key=key):
        study.write_summary(summary)
    assert not list(study.path.iterdir())


def test_table_refuses_an_index_and_repeated_provenance(study, frame):
    with refused("table-with-index"):
        study.write_table("rows", frame.set_index("scene"))
    with refused("provenance-repeated", key="config_hash"):
        study.write_table("rows", frame, config_hash="0")


def test_a_failed_write_leaves_the_old_file_and_nothing_else(study, frame, monkeypatch):
    path = study.write_table("rows", frame)
    before = path.read_bytes()

    def fail(table, where):
        where.write_bytes(b"half a table")
        raise OSError("disk full")

    monkeypatch.setattr(parquet, "write_table", fail)
    with pytest.raises(OSError, match="disk full"):
        study.write_table("rows", frame)
    assert path.read_bytes() == before
    assert [file.name for file in study.path.iterdir()] == ["rows.parquet"]


def test_text_bytes_and_configuration(study):
    assert study.write_text("page.html", "<p>µ</p>").read_text(encoding="utf-8") == "<p>µ</p>"
    assert study.write_bytes("figures/h.png", b"\x89PNG").read_bytes() == b"\x89PNG"
    assert json.loads(study.write_config().read_text())["inner"] == {"width": 2.0}


@pytest.mark.parametrize("name", ["../out", "/tmp/out", "", "a/../../b", "a\\b"])
def test_names_stay_inside_the_root(tmp_path, study, name):
    with refused("name-unusable", key="study"):
        Study(tmp_path, name, Config(), "evaluate")
    with refused("name-unusable", key="file"):
        study.write_text(name, "")


def test_studies_of_a_multirun_lie_in_folders(tmp_path):
    assert Study(tmp_path, "sweep/seed=1", Config(), "evaluate").path == tmp_path / "sweep" / "seed=1"


def test_what_a_killed_process_left_behind_is_removed(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()  # its number belongs to nobody now
    folder = tmp_path / "study"
    folder.mkdir()
    dead = folder / f".runs.parquet.{platform.node()}.{process.pid}.unfinished"
    alive = folder / f".runs.parquet.{platform.node()}.{os.getpid()}.unfinished"
    elsewhere = folder / f".runs.parquet.another.{process.pid}.unfinished"
    for path in (dead, alive, elsewhere):
        path.touch()
    Study(tmp_path, "study", None, "a task")
    assert [path.exists() for path in (dead, alive, elsewhere)] == [False, True, True]


def test_a_study_knows_what_is_its_own(tmp_path):
    frame = pd.DataFrame({"a": [1, 2]})
    study = Study(tmp_path, "study", {"key": 1}, "a task", "data-1")
    assert not study.owns("rows")
    assert study.finished_summary() is None
    study.write_table("rows", frame)
    study.write_summary({"figure": 3})
    assert study.owns("rows")
    assert study.finished_summary()["figure"] == 3
    for other in (({"key": 2}, "a task", "data-1"), ({"key": 1}, "b task", "data-1"), ({"key": 1}, "a task", "data-2")):
        stranger = Study(tmp_path, "study", *other)
        assert not stranger.owns("rows")
        assert stranger.finished_summary() is None
    content = (study.path / "rows.parquet").read_bytes()
    (study.path / "rows.parquet").write_bytes(content[: len(content) // 2])
    (study.path / "summary.json").write_text("[")
    assert not study.owns("rows")
    assert study.finished_summary() is None


def test_a_study_that_is_begun_anew_is_not_finished_any_more(tmp_path):
    study = Study(tmp_path, "study", {"key": 1}, "a task")
    study.write_summary({"figure": 3})
    assert study.begin(resume=True)["figure"] == 3
    assert (study.path / "summary.json").exists()
    assert study.begin(resume=False) is None
    assert not (study.path / "summary.json").exists()
    study.write_summary({"figure": 3})
    assert Study(tmp_path, "study", {"key": 2}, "a task").begin(resume=True) is None
    assert not (study.path / "summary.json").exists()


def test_a_study_without_a_file_that_is_needed_is_not_finished(tmp_path):
    study = Study(tmp_path, "study", {"key": 1}, "a task")
    study.write_text("verdict.json", "{}")
    study.write_summary({"figure": 3})
    assert study.begin(resume=True, needed=["verdict.json"])["figure"] == 3
    (study.path / "verdict.json").unlink()
    assert study.finished_summary(["verdict.json"]) is None
    assert study.begin(resume=True, needed=["verdict.json"]) is None
    assert not (study.path / "summary.json").exists()


def test_parts_of_another_study_are_removed(tmp_path):
    frame = pd.DataFrame({"a": [1, 2]})
    Study(tmp_path, "study", {"key": 1}, "a task").write_table(part_name("runs", 0), frame)
    study = Study(tmp_path, "study", {"key": 2}, "a task")
    study.write_table(part_name("runs", 1), frame)
    (study.path / "runs" / "part-00002.parquet").write_bytes(b"half")
    assert study.finished_parts("runs") == {1}
    assert [path.name for path in (study.path / "runs").iterdir()] == ["part-00001.parquet"]
    assert len(pd.read_parquet(study.path / "runs")) == 2
