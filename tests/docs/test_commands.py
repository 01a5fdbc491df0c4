"""Every command that README and documentation show can be called like that: task, keys and types are right."""

import re
import tomllib
from fnmatch import fnmatch
from importlib.util import find_spec
from pathlib import Path
from unittest.mock import patch

import pytest

from rearl_jax import tasks
from tests.docs.blocks import EXTENDING, PAGES, ROOT, blocks, commands, spans


def jobs(overrides):
    """Overrides of so many jobs of a multirun that every value is in one of them."""
    from hydra.core.override_parser.overrides_parser import OverridesParser

    ways = []
    for text, one in zip(overrides, OverridesParser.create().parse_overrides(overrides), strict=True):
        name = text.partition("=")[0]
        ways.append([f"{name}={value}" for value in one.sweep_string_iterator()] if one.is_sweep_override() else [text])
    n_jobs = max(len(way) for way in ways)
    assert n_jobs > 1, "a multirun of one job"
    return [[way[number % len(way)] for way in ways] for number in range(n_jobs)]


def check_launcher(task, words):
    """Raise what Hydra raises for keys of a launcher that it does not know."""
    from hydra import compose, initialize_config_dir
    from hydra.core.override_parser.overrides_parser import OverridesParser

    from rearl_jax.cli import launchers
    from rearl_jax.cli.composition import register

    register(task)
    said = {one.key_or_group: one.value() for one in OverridesParser.create().parse_overrides(words)}
    with patch.object(launchers.shutil, "which", lambda name: name):  # the machine that has Slurm is another one
        shares = launchers.settings(said, 2)
    with initialize_config_dir(str(tasks.conf_dir()), version_base="1.3"):
        assert compose(task.config_name, [*shares, *words], return_hydra_config=True).hydra.launcher


COMPOSED = set()
"""Jobs that were right before, each as its task and its overrides."""


def check_rearl(words):
    """Raise UsageError or ValueError where `rearl` would complain before anything runs."""
    from rearl_jax.cli.command_line import _is_file, _parser, _task
    from rearl_jax.cli.composition import compose_task
    from rearl_jax.cli.sweep_files import read_sweep

    options = _parser().parse_intermixed_args(words)
    said = " ".join(options.words)
    if not said or any(task.words.startswith(f"{said} ") for task in tasks.TASKS):
        return  # help, of all tasks or of those that begin like this
    task = _task(options.words)
    overrides = options.words[len(task.words.split()) :]
    if task.on_file is not None and len(overrides) == 1 and _is_file(overrides[0]):
        return  # a file of the reader's own
    if options.sweep:
        of_sweep = read_sweep(options.sweep, task, options.config_dir)
        if not overrides and options.config_dir is None:
            return  # tests/test_cli.py composes the jobs of every shipped sweep
        overrides = [*of_sweep, *overrides]
    launcher = [word for word in overrides if word.startswith("hydra")]
    if launcher:
        check_launcher(task, launcher)
    own = [word for word in overrides if word not in launcher]
    for job in jobs(own) if options.multirun or options.sweep else [own]:
        key = task.words, *job
        if key not in COMPOSED:
            compose_task(task, job, options.config_dir)
        if options.config_dir is None:
            COMPOSED.add(key)


def check_make(words):
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert words
    assert all(word in targets or "=" in word for word in words), words


def check_pip(words):
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    assert words[0] == "install"
    for extra in re.findall(r"\[(.+)\]", " ".join(words)):
        assert set(extra.split(",")) <= set(extras), extra


def check_python(words):
    if words[:2] == ["-m", "benchmarks"]:
        from benchmarks.__main__ import configured

        configured(words[2], words[3:])
    elif "-m" in words:
        assert find_spec(words[words.index("-m") + 1]), words


CHECKS = {
    "rearl": check_rearl,
    "make": check_make,
    "pip": check_pip,
    "python": check_python,
    "python3": check_python,
    "pytest": lambda words: None,
    "pyright": lambda words: None,
    "ruff": lambda words: None,
}
"""By program; another one must be thought about before it is shown."""


SEEN = set()
"""Commands that were right before, on whatever page."""


def check(words):
    if tuple(words) in SEEN:
        return
    program = words[0].removeprefix(".venv/bin/")
    assert program in CHECKS, f"{program}: no check for this program"
    CHECKS[program](words[1:])
    if "--config-dir" not in words:
        SEEN.add(tuple(words))


def completed(words):
    """A command of running text, which may leave out where the recordings are."""
    reads = any(re.fullmatch("data=(highd|ngsim|table)", word) for word in words)
    return [*words, "data.root=FOLDER"] if reads and "data.root" not in " ".join(words) else words


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_of_a_page(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shown = blocks(page)
    for block in shown:
        # Configuration files that the page has its reader write.
        if block.language == "python" and 'Path("conf' in block.text:
            exec(compile(block.text, block.where, "exec"), {})
    # What needs files that a page adds is run by tests/docs/test_how_to.py.
    scripts = [] if page in EXTENDING else [block for block in shown if block.language == "sh"]
    faults = []
    for where, words in [
        *((block.where, words) for block in scripts for words in commands(block.text)),
        *((page.name, completed(words)) for words in spans(page)),
    ]:
        try:
            check(words)
        except Exception as error:
            faults.append(f"{where}: {' '.join(words)}: {type(error).__name__}: {error}")
    assert not faults, "\n".join(faults)


def test_examples_of_the_tasks():
    shown = [example for task in tasks.TASKS for example in task.examples]
    assert len(shown) >= 2 * len(tasks.TASKS) - 10
    for example in shown:
        check(commands(example)[0])


def test_the_checks_see_what_is_wrong():
    from rearl_jax.cli.composition import UsageError

    for wrong in (
        "rearl evaluat",
        "rearl evaluate metod=base",
        "rearl evaluate eval.n_runs=two",
        "rearl sweep scale n_rollouts=0",
        "python -m benchmarks core bench.vehicle=[10]",
    ):
        with pytest.raises(ValueError, match="nearest|must be"):
            check(wrong.split())
    with pytest.raises(UsageError):
        check(["rearl", "evaluate", "-m", "data=us101,nothing"])
    with pytest.raises(UsageError):
        check(["rearl", "evaluate", "--sweep", "nothing"])
    for wrong in (
        ["make", "dinner"],
        ["pip", "install", "rearl_jax[nothing]"],
        ["python", "-m", "rearl_jax.nothing"],
        ["rm", "x"],
    ):
        with pytest.raises(AssertionError):
            check(wrong)


def test_there_is_something_to_check():
    shown = [
        words for page in PAGES for block in blocks(page) if block.language == "sh" for words in commands(block.text)
    ]
    assert sum(words[0] == "rearl" for words in shown) > 60
    assert sum(bool(spans(page)) for page in PAGES) > 10
    # Every task is shown on some page in a whole command.
    called = {" ".join(words[1:3]) for words in shown} | {words[1] for words in shown if len(words) > 1}
    for task in tasks.TASKS:
        assert any(fnmatch(words, f"{task.words}*") for words in called), task.words


def test_commands_are_split_as_a_shell_does(tmp_path):
    text = "rearl evaluate -m a=1,2 \\\n  study='my study'   # a remark\n\nmake run && rearl --help | cat > help.txt\n"
    expected = [["rearl", "evaluate", "-m", "a=1,2", "study=my study"], ["make", "run"], ["rearl", "--help"], ["cat"]]
    assert commands(text) == expected
    page = tmp_path / "page"
    page.write_text("`rearl cluster` and `rearl TASK --help`, not ``rearl evaluate``\n", encoding="utf-8")
    assert spans(Path(page)) == [["rearl", "cluster"]]
