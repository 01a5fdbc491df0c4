"""The console script, tried on a small task of its own: `drive`, with records of every kind of key."""

import json
import logging
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from rearl_jax import __version__, tasks
from rearl_jax.cli import command_line
from rearl_jax.cli.composition import check_overrides, choices, compose_task
from rearl_jax.cli.multirun import swept_values
from rearl_jax.cli.sweep_files import read_sweep, sweeps_of
from rearl_jax.code_version import code_hash
from rearl_jax.config._schema import groups_of
from rearl_jax.problems import InvalidInputError, out_of_range
from rearl_jax.results import Study, config_hash
from rearl_jax.tasks import TASKS, Task, conf_dir, sweeps_dir


@pytest.fixture
def cli(monkeypatch, tmp_path):
    """The module under test with the single task `drive far`, its conf/ folder, and what it was run with."""
    from rearl_jax import cli, runtime, tasks
    from rearl_jax.config._key import key

    class Side(Enum):
        left = "left"
        right = "right"

    @dataclass(unsafe_hash=True)
    class RoadConfig:
        """The road."""

        lanes: int = key(4, "number of lanes")
        length: float = key(400.0, "length [m]")
        exits: tuple[float, ...] = key((100.0, 200.0), "positions of the exits [m]")
        span: tuple[float, float] = key((0.0, 1.0), "first and last position [m]")

        def check(self) -> None:
            if self.lanes < 1:
                raise out_of_range("lanes", "must be at least 1", self.lanes)

    @dataclass(unsafe_hash=True)
    class ResultsConfig:
        """The folder of results."""

        root: str = key("results", "folder of all studies")
        resume: bool = key(False, "leave a finished study alone")

    @dataclass(unsafe_hash=True)
    class DriveTask:
        """A drive."""

        study: str = key("drive", "name of the study")
        side: Side = key(Side.right, "side of the road that is driven on")
        limit: float | None = key(None, "speed limit [m/s]; null is none")
        road: RoadConfig = key(RoadConfig, "the road")
        results: ResultsConfig = key(ResultsConfig, "results")

    ran = []

    def run(config) -> dict:
        if config.road.lanes == 9:
            module.fail()
        ran.append(config)
        return {}

    collected = []
    module = ModuleType("drive_task")
    module.DriveTask, module.run = DriveTask, run
    module.collect = lambda config, cells: collected.append((config, cells))
    monkeypatch.setitem(sys.modules, "drive_task", module)
    task = Task(
        words="drive far",
        run="drive_task:run",
        config="drive_task:DriveTask",
        summary="drive along",
        description="Drives along a road.",
        examples=("rearl drive far road.lanes=2",),
        collect="drive_task:collect",
        implied={"road": "limit=50"},
    )
    conf = tmp_path / "conf"
    (conf / "road").mkdir(parents=True)
    (conf / "drive_far.yaml").write_text("defaults: [schema, road: narrow, _self_]\n")
    (conf / "road" / "narrow.yaml").write_text("# one lane each way\nlanes: 2\n")
    (conf / "road" / "wide.yaml").write_text("lanes: 6\nlength: 900\n")
    sweeps = tmp_path / "sweeps"
    sweeps.mkdir()
    (sweeps / "sides.yaml").write_text("# both sides\ntask: drive far\nkeys:\n  limit: 20\n  side: left,right\n")
    (sweeps / "other.yaml").write_text("# of another task\ntask: fly\nkeys: {}\n")
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    monkeypatch.setattr(tasks, "TASKS", (task,))
    monkeypatch.setattr(tasks, "conf_dir", lambda: conf)
    monkeypatch.setattr(tasks, "sweeps_dir", lambda: sweeps)
    started = []
    monkeypatch.setattr(runtime, "start", lambda x64: started.append(x64))
    seen = {"ran": ran, "started": started, "collected": collected}
    return SimpleNamespace(main=cli.main, task=module, Side=Side, work=work, **seen)


def test_defaults_then_files_then_command_line(cli):
    assert cli.main(["drive", "far", "road=wide", "road.exits=[1,2.5]", "side=left", "limit=30"]) == 0
    (config,) = cli.ran
    assert (config.road.lanes, config.road.length) == (6, 900.0)
    assert config.road.exits == (1.0, 2.5)
    assert config.road.span == (0.0, 1.0)
    assert config.side is cli.Side.left
    assert config.limit == 30.0
    assert isinstance(hash(config), int)
    assert cli.started == [False]


def test_no_litter(cli):
    assert cli.main(["drive", "far"]) == 0
    assert cli.ran[0].road.lanes == 2
    assert list(cli.work.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "code", "key", "nearest"),
    [
        ("drive far road.lane=3", "key-unknown", "road.lane", "road.lanes"),
        ("drive far lanes=3", "key-unknown", "lanes", "road.lanes"),
        ("drive far rod.lengt=3", "key-unknown", "rod.lengt", "road.length"),
        ("drive far road={lane:3}", "key-unknown", "road.lane", "road.lanes"),
        ("drive far +road.lanes=3", "key-added", "+road.lanes=3", ""),
        ("drive far ~road.lanes=3", "key-added", "~road.lanes=3", ""),
        ("drive far road.lanes=many", "wrong-type", "road.lanes", ""),
        ("drive far road.lanes=2.5", "wrong-type", "road.lanes", ""),
        ("drive far road.exits=[1,x]", "wrong-type", "road.exits", ""),
        ("drive far road.exits=7", "wrong-type", "road.exits", ""),
        ("drive far road.span=[1,2,3]", "wrong-length", "road.span", ""),
        ("drive far road.lanes=0", "out-of-range", "road.lanes", ""),
        ("drive far side=middle", "wrong-type", "side", ""),
        ("drive far study=null", "wrong-type", "study", ""),
        ("drive far road=wid", "choice-unknown", "road", "wide"),
        ("drive far road.lanes=(c", "value-unreadable", "road.lanes", ""),
        ("drive far study=(c,d", "value-unreadable", "study", ""),
        ("drive far road.exits=[1,(c]", "value-unreadable", "road.exits", ""),
        ("drive far study", "value-missing", "study", ""),
        ("drive far roda", "value-missing", "roda", "road"),
        ("drive far roda=wide", "key-unknown", "roda", "road"),
        ("drive far road=", "choice-unknown", "road", ""),
        ("drive far results=3", "wrong-type", "results", ""),
        ("drive far road.lanes=1,3", "several-values", "road.lanes", ""),
        ("drive far --multirn", "option-unknown", None, ""),
        ("drive far --config-dir nowhere", "folder-missing", None, ""),
        ("drive fat", "task-unknown", "drive fat", "rearl drive far"),
        ("drive", "task-unknown", "drive", "rearl drive far"),
        ("dive study=x", "task-unknown", "dive", "rearl drive far"),
        ("study=x", "task-missing", None, ""),
        ("drive far -m side=left,right --config", "options-conflict", "--config", ""),
        ("drive far --sweep sides --config", "options-conflict", "--config", ""),
        ("drive far -m road.lanes=interval(1,3)", "configuration-unreadable", None, ""),
        ("drive far -m road.lanes=1,3 sid=left,right", "key-unknown", "sid", "side"),
        ("drive far --sweep sidez", "choice-unknown", "--sweep", "sides"),
        ("drive far --sweep other", "sweep-of-another-task", "--sweep other", ""),
    ],
)
def test_mistakes_end_with_one_sentence(cli, capsys, words, code, key, nearest):
    with pytest.raises(InvalidInputError) as caught:
        cli.main([*words.split(), "--traceback"])
    assert (caught.value.code, caught.value.problem.key) == (code, key)
    assert not nearest or f"nearest: {nearest}" in str(caught.value)
    assert cli.main(words.split()) == 2
    assert capsys.readouterr().err == f"rearl: {caught.value}\n"
    assert "\n" not in str(caught.value)
    assert cli.ran == []
    assert list(cli.work.iterdir()) == []


def test_error_of_the_file_system_is_for_the_user(cli, capsys):
    cli.task.fail = lambda: open("missing.csv")
    assert cli.main(["drive", "far", "road.lanes=9"]) == 2
    assert "missing.csv" in capsys.readouterr().err


def test_error_raised_by_the_package_is_for_the_user(cli, capsys):
    cli.task.fail = lambda: Study("results", "../up", None, "drive far")
    assert cli.main(["drive", "far", "road.lanes=9"]) == 2
    assert "'../up'" in capsys.readouterr().err


def test_error_of_a_library_keeps_its_traceback(cli):
    cli.task.fail = lambda: int("x")
    with pytest.raises(ValueError, match="literal"):
        cli.main(["drive", "far", "road.lanes=9"])


def test_traceback_on_request_of_the_environment(cli, monkeypatch):
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    with pytest.raises(InvalidInputError):
        cli.main(["drive", "far", "road.lanes=0"])


def test_interrupt(cli, capsys):
    def fail():
        raise KeyboardInterrupt

    cli.task.fail = fail
    assert cli.main(["drive", "far", "road.lanes=9"]) == 130
    assert "interrupted" in capsys.readouterr().err


def test_own_configuration_folder_and_an_unknown_key_in_a_file_of_it(cli, tmp_path):
    file = tmp_path / "mine" / "road" / "bridge.yaml"
    file.parent.mkdir(parents=True)
    command = ["drive", "far", "--config-dir", str(tmp_path / "mine"), "road=bridge", "--traceback"]
    file.write_text("lanes: 3\n")
    assert cli.main(command) == 0
    assert cli.ran[0].road.lanes == 3
    file.write_text("lengths: 3\n")
    with pytest.raises(InvalidInputError) as caught:
        cli.main(command)
    problem = caught.value.problem
    assert (problem.code, problem.key, problem.file) == ("key-unknown", "road.lengths", "road/bridge.yaml")


def test_print_configuration(cli, capsys):
    assert cli.main(["drive", "far", "road.lanes=5", "--config"]) == 0
    assert "  lanes: 5\n" in capsys.readouterr().out
    assert cli.ran == []


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
    with pytest.raises(InvalidInputError) as caught:
        cli.main(["drive", "far", "--sweep", "mine", "--traceback"])
    assert caught.value.code == code
    assert cli.ran == []


def test_a_key_given_twice_is_told_and_the_last_one_counts(cli, capsys):
    assert cli.main(["drive", "far", "limit=1", "side=left", "limit=2", "limit=3", "side=left"]) == 0
    assert [config.limit for config in cli.ran] == [3]
    assert capsys.readouterr().err.splitlines()[0].endswith(": limit=3")
    assert cli.main(["drive", "far", "limit=1", "side=left", "side=left"]) == 0
    assert "limit" not in capsys.readouterr().err


def test_a_key_that_another_implies_is_told(cli, caplog):
    logging.getLogger("rearl_jax").setLevel(logging.NOTSET)  # as a new process has it
    assert cli.main(["drive", "far", "road.length=5"]) == 0
    assert [record.args for record in caplog.records if record.name.endswith("composition")] == [("limit=50",)]


def test_keys_of_a_group_imply_others_unless_they_are_given(cli):
    assert cli.main(["drive", "far", "road.length=5"]) == 0
    assert cli.main(["drive", "far", "road.length=5", "limit=30"]) == 0
    assert cli.main(["drive", "far", "side=left"]) == 0
    assert [config.limit for config in cli.ran] == [50, 30, None]


def test_help_lists_every_key_with_type_default_and_meaning(cli, capsys):
    assert cli.main(["drive", "far", "--help"]) == 0
    text = capsys.readouterr().out
    for part in (
        "Drives along a road.",
        "road.lanes=4  (int)",
        "number of lanes",
        "limit=null  (float or null)",
        "side=right  (left|right)",
        "road.exits=[100.0, 200.0]  ([float, ...])",
        "road=narrow  one lane each way",
        "rearl drive far road.lanes=2",
    ):
        assert part in text


def test_help_lists_tasks(cli, capsys):
    assert cli.main([]) == 0
    without = capsys.readouterr().out
    assert cli.main(["--help"]) == 0
    assert capsys.readouterr().out == without
    assert "drive far  drive along" in without
    codes = without[without.index("exit codes:") :].split()
    assert {"0", "1", "2", "129", "130", "141", "143"} <= set(codes)


def test_help_does_not_wait_for_jax():
    """The lists of tasks and of keys come from the standard library alone."""
    code = (
        "import sys; from rearl_jax.cli import main; main(['--help']); main(['evaluate', '--help']);"
        "print([m for m in ('jax', 'numpy', 'pandas', 'hydra', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_module_is_the_console_script(tmp_path):
    command = [sys.executable, "-m", "rearl_jax", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=True)
    assert done.stdout == f"rearl_jax {__version__}\n"


def test_configuration_files_are_found_in_a_wheel_and_in_a_checkout(monkeypatch, tmp_path):
    from rearl_jax.tasks import folders

    monkeypatch.setattr(folders, "__file__", str(tmp_path / "site" / "rearl_jax" / "tasks" / "folders.py"))
    with pytest.raises(FileNotFoundError):
        folders.conf_dir()
    (tmp_path / "site" / "conf").mkdir(parents=True)
    assert folders.conf_dir() == tmp_path / "site" / "conf"
    (tmp_path / "site" / "rearl_jax" / "conf").mkdir(parents=True)
    assert folders.conf_dir() == tmp_path / "site" / "rearl_jax" / "conf"


def test_the_longer_of_two_tasks_with_the_same_first_word_is_meant():
    assert command_line._task(["discover", "blind", "study=x"]).words == "discover blind"
    assert command_line._task(["discover", "study=blind"]).words == "discover"


@pytest.mark.slow
def test_wheel_holds_configuration_and_recordings(tmp_path):
    root = Path(__file__).resolve().parents[1]
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"]
    subprocess.run([*pip, "--wheel-dir", str(tmp_path), str(root)], check=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    folders = [root / "conf", root / "sweeps"]
    files = {f"rearl_jax/{file.relative_to(root).as_posix()}" for folder in folders for file in folder.rglob("*.yaml")}
    assert {"rearl_jax/conf/evaluate.yaml", "rearl_jax/sweeps/cues.yaml"} <= files
    assert {name for name in names if name.startswith(("rearl_jax/conf/", "rearl_jax/sweeps/"))} == files
    folder = root / "rearl_jax" / "data" / "shipped"
    shipped = [file for file in folder.rglob("*") if file.is_file() and file.suffix != ".pyc"]
    assert sum(file.name in ("LICENSE", "ATTRIBUTION") for file in shipped) == 12
    assert {file.relative_to(root).as_posix() for file in shipped} <= set(names)
    assert not [name for name in names if name.startswith("tests/")]


def test_every_task_composes(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for task in TASKS:
        has_results = hasattr(task.defaults(), "study")
        config = compose_task(task, ["study=mine"] if has_results else [], None)
        assert type(config) is task.load_config()
        assert has_results == (task.words != "doctor")
        assert not has_results or config.study == "mine"


def test_every_key_is_documented():
    for task in TASKS:
        groups = list(groups_of(task.defaults()))
        assert groups
        assert all(group.help for group in groups if group.name)
        assert all(key.help for group in groups for key in group.keys)


def covering(swept):
    """The fewest cells of a sweep that hold every value of every key."""
    cells = range(max(map(len, swept.values())))
    return [{key: values[number % len(values)] for key, values in swept.items()} for number in cells]


def test_every_shipped_sweep_is_a_multirun_of_its_task():
    found = 0
    for task in TASKS:
        for name in sweeps_of(task):
            overrides = read_sweep(name, task, None)
            check_overrides(task, overrides, None)
            parsed = OverridesParser.create().parse_overrides(overrides)
            swept = swept_values(parsed, choices(task))
            fixed = [text for text in overrides if text.partition("=")[0] not in swept]
            cells = covering(swept)
            assert len(cells) > 1
            for cell in cells:
                compose_task(task, [*fixed, *(f"{key}={value}" for key, value in cell.items())], None)
            found += 1
    assert found >= 12


def test_every_yaml_says_what_it_is():
    files = [file for folder in (conf_dir(), sweeps_dir()) for file in sorted(folder.rglob("*.yaml"))]
    assert files
    for file in files:
        assert file.read_text(encoding="utf-8").startswith("# "), f"{file} must begin with a comment line"
