"""Multiruns and sweep files of the task `drive far`."""

import json
import sys

import pytest

from rearl_jax import tasks
from rearl_jax.cli.composition import compose_task
from rearl_jax.code_version import code_hash
from rearl_jax.results import config_hash
from tests.refusal import refused


def test_multirun_gives_each_job_its_folder(cli):
    arguments = ["drive", "far", "-m", "road.lanes=1,3", "side=left,right", "limit=20", "study=sweep"]
    command = list(sys.argv)
    assert cli.main(arguments) == 0
    assert sys.argv == command
    jobs = [(1, "left"), (1, "right"), (3, "left"), (3, "right")]
    assert [(config.road.lanes, config.side.name) for config in cli.ran] == jobs
    studies = [config.study for config in cli.ran]
    assert studies[0] == "sweep/road.lanes=1/side=left"
    assert len(set(studies)) == 4
    assert all((cli.work / "results" / study).is_dir() for study in studies)
    assert [path.name for path in cli.work.iterdir()] == ["results"]
    assert not list(cli.work.rglob(".hydra"))


@pytest.mark.parametrize(
    ("word", "values"),
    [
        ("road.lanes=3,1", ["3", "1"]),
        ("road.lanes=range(1,6,2)", ["1", "3", "5"]),
        ("road.lanes=choice(4,2)", ["4", "2"]),
        ("road=glob(*,exclude=n*)", ["wide"]),
        ("road=narrow,wide", ["narrow", "wide"]),
    ],
)
def test_multirun_runs_one_job_for_every_value(cli, word, values):
    assert cli.main(["drive", "far", "-m", word, "limit=20"]) == 0
    key = word.partition("=")[0]
    assert [config.study for config in cli.ran] == [f"drive/{key}={value}" for value in values]
    ((_, cells),) = cli.collected
    assert cells == [{key: value} for value in values]


def test_multirun_goes_on_after_a_failed_job(cli, capsys):
    assert cli.main(["drive", "far", "-m", "road.lanes=0,3"]) == 2
    assert [config.road.lanes for config in cli.ran] == [3]
    error = capsys.readouterr().err
    assert "road.lanes=0: road.lanes must be at least 1" in error
    assert "Traceback" not in error


def test_cells_are_put_together_also_after_a_failed_job(cli):
    assert cli.main(["drive", "far", "-m", "road.lanes=0,3", "limit=20", "study=s"]) == 2
    ((config, cells),) = cli.collected
    assert cells == [{"road.lanes": "0"}, {"road.lanes": "3"}]
    assert (config.study, config.limit) == ("s", 20)


def write_earlier_summaries(cli, code):
    """Summaries of two jobs; the task of these tests writes none, so these stay whatever is run."""
    for lanes in (9, 3):
        folder = cli.work / "results" / "s" / f"road.lanes={lanes}"
        folder.mkdir(parents=True)
        config = compose_task(tasks.TASKS[0], [f"road.lanes={lanes}", "limit=20"], None)
        first = {"config_hash": config_hash(config), "code_hash": code}
        (folder / "summary.json").write_text(json.dumps([first]))


def test_a_failed_job_leaves_nothing_of_other_code(cli, capsys):
    write_earlier_summaries(cli, "other")
    cli.task.fail = lambda: open("missing.csv")
    assert cli.main(["drive", "far", "-m", "road.lanes=9,3", "limit=20", "study=s"]) == 2
    ((_, cells),) = cli.collected
    assert cells == []
    assert capsys.readouterr().out.count("were computed by other code and are left out") == 2


def test_a_failed_job_leaves_nothing_of_another_configuration(cli, capsys):
    write_earlier_summaries(cli, code_hash())
    cli.task.fail = lambda: open("missing.csv")
    assert cli.main(["drive", "far", "-m", "road.lanes=9,3", "limit=20", "study=s"]) == 2
    assert cli.main(["drive", "far", "-m", "road.lanes=9,3", "limit=30", "study=s"]) == 2
    (_, same), (_, other) = cli.collected
    assert same == [{"road.lanes": "9"}, {"road.lanes": "3"}]
    assert other == []
    assert capsys.readouterr().out.count("belong to another configuration and are left out") == 2


def test_a_study_outside_the_results_is_refused_before_anything_is_written(cli):
    with refused("name-unusable", key="study"):
        cli.main(["drive", "far", "-m", "road.lanes=1,3", "study=../up", "--traceback"])
    assert cli.ran == []
    assert not list(cli.work.iterdir())


def test_jobs_resume_unless_told_otherwise(cli):
    assert cli.main(["drive", "far", "-m", "side=left,right"]) == 0
    assert cli.main(["drive", "far", "-m", "side=left,right", "results.resume=false"]) == 0
    assert [config.results.resume for config in cli.ran] == [True, True, False, False]
    assert cli.ran[-1].study == "drive/side=right"


def test_a_sweep_file_is_a_multirun_written_down(cli, capsys, tmp_path):
    assert cli.main(["drive", "far", "--sweep", "sides", "limit=30"]) == 0
    assert [(config.side.name, config.limit) for config in cli.ran] == [("left", 30), ("right", 30)]
    assert [config.study for config in cli.ran] == ["sides/side=left", "sides/side=right"]
    mine = tmp_path / "mine" / "sweeps"
    mine.mkdir(parents=True)
    (mine / "lanes.yaml").write_text("task: drive far\nkeys: {road.lanes: '1,2', study: own}\n")
    assert cli.main(["drive", "far", "--sweep", "lanes", "--config-dir", str(tmp_path / "mine")]) == 0
    assert cli.ran[-1].study == "own/road.lanes=2"
    assert cli.main(["drive", "far", "--help"]) == 0
    assert "--sweep sides  both sides" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "code"),
    [
        ("task: drive far\nkeys: {}\nmore: 1\n", "sweep-malformed"),
        ("task: [", "file-unreadable"),
        ("task: drive far\nkeys: {sid: left}\n", "key-unknown"),
    ],
)
def test_a_wrong_sweep_file(cli, tmp_path, content, code):
    (tmp_path / "sweeps" / "mine.yaml").write_text(content)
    with refused(code):
        cli.main(["drive", "far", "--sweep", "mine", "--traceback"])
    assert cli.ran == []
