"""The console script and the files that come with it: tasks, configurations, sweeps, the wheel."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from rearl_jax import __version__
from rearl_jax.cli import command_line
from rearl_jax.cli.composition import check_overrides, choices, compose_task
from rearl_jax.cli.multirun import swept_values
from rearl_jax.cli.sweep_files import read_sweep, sweeps_of
from rearl_jax.config._schema import groups_of
from rearl_jax.tasks import TASKS, conf_dir, sweeps_dir


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
