"""The console script `rearl TASK [words] [key=value ...]`.

In: the command line and conf/. Out: one finished configuration record, handed to the task's function. This is
the only module that knows Hydra; everything below it takes plain records. Mistakes of the user end with one
sentence and exit code 2, mistakes of the program with a traceback and exit code 1.
"""

import argparse
import logging
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

from rearl_jax import __version__
from rearl_jax.config._schema import Key, finished, groups_of, keys_of, nearest
from rearl_jax.tasks import TASKS, Task, conf_dir

_PACKAGE = str(Path(__file__).resolve().parent)


class UsageError(ValueError):
    """The command line cannot be carried out; the message says what to write instead."""


class JobError(RuntimeError):
    """One job of a multirun failed for a reason the user can mend."""


def main(argv: list[str] | None = None) -> int:
    """Exit code of `rearl`: 0 done, 2 a fault the user can mend, 130 interrupted; other faults are raised."""
    arguments = sys.argv[1:] if argv is None else list(argv)
    show_traceback = "--traceback" in arguments or os.environ.get("HYDRA_FULL_ERROR") == "1"
    try:
        _dispatch(arguments)
    except KeyboardInterrupt:
        _complain("interrupted")
        return 130
    except Exception as error:
        if show_traceback or not _is_for_user(error):
            raise
        _complain(str(error))
        return 2
    return 0


def _dispatch(arguments: list[str]) -> None:
    options = _parser().parse_intermixed_args(arguments)
    if options.version:
        print(f"rearl_jax {__version__}")
        return
    if not options.words:
        print(_general_help())
        return
    task = _task(options.words)
    overrides = options.words[len(task.words.split()) :]
    if options.help:
        print(_task_help(task))
    elif options.multirun:
        _run_many(task, overrides, options.config_dir)
    else:
        config = _compose(task, overrides, options.config_dir)
        if options.config:
            from omegaconf import OmegaConf

            print(OmegaConf.to_yaml(OmegaConf.structured(config)), end="")
            return
        logging.basicConfig(format="%(message)s")
        logging.getLogger("rearl_jax").setLevel(logging.INFO)
        _run(task, config)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; `rearl --help` lists tasks and options")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="rearl", add_help=False, allow_abbrev=False)
    parser.add_argument("words", nargs="*")
    parser.add_argument("-h", "--help", action="store_true")
    parser.add_argument("-m", "--multirun", action="store_true")
    parser.add_argument("--config", action="store_true")
    parser.add_argument("--config-dir")
    parser.add_argument("--traceback", action="store_true")
    parser.add_argument("--version", action="store_true")
    return parser


def _task(words: list[str]) -> Task:
    if "=" in words[0]:
        raise UsageError(f"name a task before {words[0]!r}: rearl TASK {words[0]}")
    for task in TASKS:
        if words[: len(task.words.split())] == task.words.split():
            return task
    said = " ".join(word for word in words[:2] if "=" not in word)
    beginning = [task.words for task in TASKS if task.words.startswith(f"{words[0]} ")]
    close = nearest(said, beginning or [task.words for task in TASKS])
    raise UsageError(f"there is no task {said!r}; nearest: rearl {close}; `rearl --help` lists all tasks")


def _compose(task: Task, overrides: list[str], config_dir: str | None) -> Any:
    """The finished record of a task: defaults, then conf/, then the command line."""
    from hydra import compose, initialize_config_dir

    _check_overrides(task, overrides, config_dir)
    if config_dir is not None:
        overrides = [f"hydra.searchpath=[{_search_path(config_dir)}]", *overrides]
    _register(task)
    with _hydra_errors(task, overrides), initialize_config_dir(str(conf_dir()), version_base="1.3"):
        return _record(compose(task.config_name, overrides))


def _register(task: Task) -> None:
    from hydra.core.config_store import ConfigStore

    ConfigStore.instance().store(name="schema", node=task.load_config())


def _record(config: Any) -> Any:
    from omegaconf import OmegaConf

    return finished(OmegaConf.to_object(config))


def _search_path(config_dir: str) -> str:
    folder = Path(config_dir).resolve()
    if not folder.is_dir():
        raise UsageError(f"--config-dir {config_dir}: there is no such folder")
    return f"'file://{folder}'"


def _choices(task: Task, config_dir: str | None = None) -> dict[str, list[Path]]:
    """Config groups of a task, e.g. `data`, and the files one of which is chosen by `data=NAME`."""
    roots = [conf_dir()] if config_dir is None else [conf_dir(), Path(config_dir)]
    fields = {group.name for group in groups_of(task.defaults())}
    return {name: files for name in sorted(fields) if name and (files := _yaml_files(name, roots))}


def _yaml_files(group: str, roots: Iterable[Path]) -> list[Path]:
    return sorted(file for root in roots for file in (root / group).glob("*.yaml"))


def _check_overrides(task: Task, overrides: list[str], config_dir: str | None) -> None:
    """Refuse unreadable words and unknown keys before Hydra sees them, naming the nearest valid key."""
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException

    keys = keys_of(task.defaults())
    records = {name.rpartition(".")[0] for name in keys}
    choices = _choices(task, config_dir)
    for text in overrides:
        if "=" not in text:
            raise UsageError(f"{text!r} is not key=value; nearest key: {nearest(text, keys)}")
        try:
            override = OverridesParser.create().parse_override(text)
        except HydraException as error:
            name, _, value = text.partition("=")
            raise UsageError(
                f"{name}: the value {value} cannot be read; quote it twice if it holds blanks, commas or "
                f"brackets: '{name}=\"{value}\"'"
            ) from error
        name = override.key_or_group
        if name.split(".")[0].split("/")[0] == "hydra":
            continue
        if text[0] in "+~":
            raise UsageError(f"{text}: keys are neither added nor removed; write {text.lstrip('+~')}")
        if name not in keys and name not in choices and name not in records:
            raise UsageError(_no_such_key(task, name))


@contextmanager
def _hydra_errors(task: Task, overrides: list[str]) -> Iterator[None]:
    """Turn what Hydra and OmegaConf raise into one sentence with the full key and the nearest valid one."""
    from hydra.errors import HydraException, MissingConfigException
    from omegaconf.errors import OmegaConfBaseException

    try:
        yield
    except MissingConfigException as error:
        group, _, name = (error.missing_cfg_file or "").partition("/")
        if not (name and error.options):
            raise UsageError(str(error)) from error
        raise UsageError(
            f"{group}={name}: there is no such choice; nearest: {nearest(name, error.options)}; "
            f"choices: {', '.join(sorted(error.options))}"
        ) from error
    except (HydraException, OmegaConfBaseException) as error:
        raise UsageError(_sentence(task, overrides, error)) from error


def _no_such_key(task: Task, name: str) -> str:
    close = nearest(name, keys_of(task.defaults()))
    return f"there is no key {name!r} in `rearl {task.words}`; nearest: {close}"


def _sentence(task: Task, overrides: list[str], error: BaseException) -> str:
    cause: BaseException | None = error
    while cause is not None and getattr(cause, "full_key", None) is None:
        cause = cause.__cause__ or cause.__context__
    if cause is None:
        return str(error)
    keys = keys_of(task.defaults())
    reason = str(cause).split("\n")[0]
    name = str(getattr(cause, "full_key", "")).partition("[")[0]
    file = re.match(r"In '(.+?)'", str(error))
    where = f"{file[1]}.yaml: " if file else ""
    if name in keys:
        return f"{where}{name} must be {keys[name].type_name}: {reason}"
    if name:
        return where + _no_such_key(task, name)
    return f"{where or ' '.join(overrides) + ': '}{reason}"


def _run(task: Task, config: Any) -> None:
    from rearl_jax import runtime

    runtime.start(x64=task.x64)
    task.load_run()(config)
    folder = Path(config.results.root) / config.study
    if folder.is_dir():
        print(f"results: {folder}")


def _run_many(task: Task, overrides: list[str], config_dir: str | None) -> None:
    """Hydra multirun: one job for every combination of the swept values, each in a folder of its own."""
    import hydra
    from hydra.core.override_parser.overrides_parser import OverridesParser

    _check_overrides(task, overrides, config_dir)
    parsed = OverridesParser.create().parse_overrides(overrides)
    fixed = [item.key_or_group for item in parsed if not item.is_sweep_override()]
    defaults = [
        "hydra.output_subdir=null",
        f"hydra.job.name={task.config_name}",
        f"hydra.job.config.override_dirname.exclude_keys=[{','.join(['study', 'results.root', *fixed])}]",
        "hydra.job.config.override_dirname.item_sep='/'",
        "hydra.sweep.dir=${results.root}/${study}",
        "hydra.sweep.subdir=${hydra.job.override_dirname}",
    ]
    folder = [] if config_dir is None else [f"--config-dir={Path(config_dir).resolve()}"]
    _register(task)
    command, environment = sys.argv, os.environ.get("HYDRA_FULL_ERROR")
    # Hydra reads sys.argv, and prints and exits by itself unless it is asked for the whole error.
    sys.argv = ["rearl", "--multirun", *folder, *defaults, *overrides]
    os.environ["HYDRA_FULL_ERROR"] = "1"
    try:
        with _hydra_errors(task, overrides):
            hydra.main(config_path=str(conf_dir()), config_name=task.config_name, version_base="1.3")(_job)()
    finally:
        sys.argv = command
        if environment is None:
            del os.environ["HYDRA_FULL_ERROR"]
        else:
            os.environ["HYDRA_FULL_ERROR"] = environment


def _job(composed: Any) -> None:
    """One job of a multirun; a launcher may call it in another process."""
    from hydra.core.hydra_config import HydraConfig

    job = HydraConfig.get().job
    task = next(task for task in TASKS if task.config_name == job.config_name)
    try:
        config = _record(composed)
        config.study = "/".join(part for part in (config.study, job.override_dirname) if part)
        _run(task, config)
    except Exception as error:
        if not _is_for_user(error):
            raise
        _complain(f"{job.override_dirname}: {error}")
        raise JobError(f"at least one job failed, the first at {job.override_dirname}: {error}") from error


_OPTIONS = """\
options:
  -h, --help         tasks, or with a task its keys
  -m, --multirun     one job for every combination of comma-separated values, e.g. -m seed=1,2,3
  --config           print the complete configuration and stop
  --config-dir DIR   look for configuration files in DIR as well
  --traceback        show where an error arose
  --version          version of the package"""


def _general_help() -> str:
    width = max(len(task.words) for task in TASKS)
    tasks = "\n".join(f"  {task.words:<{width}}  {task.summary}" for task in TASKS)
    return (
        "rearl: batch highway traffic simulation, held to measured trajectories\n\n"
        f"usage: rearl TASK [options] [key=value ...]\n\ntasks:\n{tasks}\n\n{_OPTIONS}\n\n"
        "`rearl TASK --help` lists the keys of a task."
    )


def _task_help(task: Task) -> str:
    columns = min(shutil.get_terminal_size((110, 24)).columns, 120)
    blocks = [
        f"rearl {task.words}: {task.summary}",
        f"usage: rearl {task.words} [options] [key=value ...]",
        textwrap.fill(task.description, columns),
    ]
    for group in groups_of(task.defaults()):
        heading = f"{group.name}: {group.help}" if group.name else "keys:"
        files = _choices(task).get(group.name, [])
        names = [f"  {group.name}={file.stem}  {_first_comment(file)}" for file in files]
        blocks.append("\n".join([heading, *names, *(_key_help(key, columns) for key in group.keys)]))
    blocks.append("\n".join(["examples:", *(f"  {example}" for example in task.examples)]))
    return "\n\n".join([*blocks, _OPTIONS])


def _key_help(key: Key, columns: int) -> str:
    text = textwrap.wrap(key.help, columns, initial_indent=" " * 6, subsequent_indent=" " * 6)
    return "\n".join([f"  {key.name}={key.default}  ({key.type_name})", *text])


def _first_comment(file: Path) -> str:
    first = file.read_text(encoding="utf-8").partition("\n")[0]
    return first.lstrip("# ") if first.startswith("#") else ""


def _is_for_user(error: BaseException) -> bool:
    """Whether an error speaks to the user: raised with a message by this package, or by the file system."""
    if isinstance(error, (OSError, JobError)):
        return True
    if not isinstance(error, (ValueError, ImportError)) or error.__traceback__ is None:
        return False
    last = error.__traceback__
    while last.tb_next is not None:
        last = last.tb_next
    return last.tb_frame.f_code.co_filename.startswith(_PACKAGE + os.sep)


def _complain(message: str) -> None:
    colour = sys.stderr.isatty() and "NO_COLOR" not in os.environ
    start, stop = ("\033[31m", "\033[0m") if colour else ("", "")
    print(f"{start}rearl: {message}{stop}", file=sys.stderr)
