"""Composes the configuration record of a task from the command line and conf/.

Errors are detected before Hydra runs if this allows a better message, with the nearest valid key.
"""

import functools
import logging
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import make_dataclass, replace
from pathlib import Path
from typing import Any

import yaml
from yaml import YAMLError

from rearl_jax import tasks
from rearl_jax.cli.values import readable, with_original_keys
from rearl_jax.config._address import check_no_secret
from rearl_jax.config._schema import Key, finished, groups_of, keys_of, nearest
from rearl_jax.config.driver import MODELS, DriverConfig, record_of
from rearl_jax.config.quoting import quoted
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.tasks import Task

log = logging.getLogger(__name__)


class UsageError(InvalidInputError):
    """Error in the command line; its problem names the remedy."""


def compose_task(task: Task, overrides: list[str], config_dir: str | None) -> Any:
    """The finished record of a task: defaults, then conf/, then the command line.

    Raises:
        UsageError: The folder of `config_dir` is missing, or a key, a value or a file cannot be read.
    """
    from hydra import compose, initialize_config_dir
    from omegaconf import OmegaConf

    overrides = with_mappings_opened(task, checked_overrides(task, overrides, config_dir, many=False))
    if config_dir is not None:
        folder = Path(config_dir).resolve()
        if not folder.is_dir():
            raise UsageError(Problem("folder-missing", "there is no such folder for --config-dir", file=config_dir))
        overrides = [f"hydra.searchpath=['file://{folder}']", *overrides]
    register(task)
    with hydra_errors(task, overrides), initialize_config_dir(str(tasks.conf_dir()), version_base="1.3"):
        try:
            composed = OmegaConf.to_object(compose(task.config_name, overrides))
        except _READ_ERRORS as error:
            raise _unreadable(overrides, config_dir, error) from error
    return finished(with_original_keys(composed))


_READ_ERRORS = (YAMLError, UnicodeError, OSError, AssertionError, OverflowError, TypeError, ValueError, RecursionError)
"""Exceptions that Hydra does not catch when it cannot read a configuration file or a value."""


def _unreadable(overrides: list[str], config_dir: str | None, error: Exception) -> Exception:
    """The problem after a failure of Hydra; it names the unreadable configuration file, else the command line."""
    from hydra.errors import HydraException
    from omegaconf.errors import OmegaConfBaseException

    if isinstance(error, (HydraException, OmegaConfBaseException)):
        return error
    for file in sorted(Path(config_dir).rglob("*.yaml")) if config_dir is not None else ():
        if problem := file_problem(file):
            return UsageError(Problem("file-unreadable", problem, file=str(file)))
    message = f"cannot be read ({str(error).partition(chr(10))[0]})"
    return UsageError(Problem("value-unreadable", message, key=" ".join(overrides)))


def file_problem(file: Path) -> str:
    """Reason why a configuration file cannot be used; empty if it can."""
    try:
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
    except UnicodeDecodeError as error:
        return f"is not UTF-8 text (byte {error.start})"
    except (YAMLError, ValueError, TypeError, RecursionError) as error:
        return f"is not readable YAML: {' '.join(str(error).split())}"
    return "" if content is None or isinstance(content, dict) else "must hold one `key: value` per line"


def checked_overrides(task: Task, overrides: list[str], config_dir: str | None, *, many: bool) -> list[str]:
    """The overrides and those they imply, quoted for Hydra and checked; arguments and errors of `check_overrides`."""
    overrides = with_implied(task, overrides)
    overrides = readable(overrides, keys_of(defaults_with(task, overrides)))
    check_overrides(task, overrides, config_dir, many=many)
    return overrides


def with_implied(task: Task, overrides: list[str]) -> list[str]:
    """The overrides, preceded by the values that keys of some groups imply, unless these keys are given.

    A threshold of the detection without `method=...` means `method=rearl`: the default method would ignore it. If
    several groups imply a value of the same key, the last group in the task's list counts.
    """
    given_keys = [text.partition("=")[0] for text in overrides]
    groups = {key.split(".")[0] for key in given_keys}
    implied = {word.partition("=")[0]: word for group, word in task.implied.items() if group in groups}
    new = sorted(word for key, word in implied.items() if key not in given_keys)
    if new:
        log.info("%s, because of the keys given", ", ".join(new))
    return [*new, *overrides]


def with_mappings_opened(task: Task, overrides: list[str]) -> list[str]:
    """The overrides; those of a mapping with names of the user, such as `data.columns`, get Hydra's prefix `++`."""
    mappings = {name for name, key in keys_of(defaults_with(task, overrides)).items() if key.type_name == "dict"}
    return [f"++{text}" if _inside(text.partition("=")[0], mappings) else text for text in overrides]


def _inside(name: str, mappings: Iterable[str]) -> bool:
    """True if a key is one of the mappings, or inside one."""
    return any(name == mapping or name.startswith(f"{mapping}.") for mapping in mappings)


def register(task: Task) -> None:
    """Makes the task's record known to Hydra."""
    _register_drivers()
    _register_schema(task.load_config())


@functools.lru_cache(maxsize=1)
def _register_schema(config: type) -> None:
    """Makes the record of a task known to Hydra, which takes .1 s, unless it was the last one."""
    from hydra.core.config_store import ConfigStore

    defaults = config()
    # `driver` gets the common base record, because Hydra can replace a record only by one of a derived class.
    schema = replace(defaults, driver=DriverConfig()) if hasattr(defaults, "driver") else defaults
    ConfigStore.instance().store(name="schema", node=schema)


@functools.cache
def _register_drivers() -> None:
    """Makes the records of the driver models known to Hydra, once in a process."""
    from hydra.core.config_store import ConfigStore

    for name in MODELS:
        ConfigStore.instance().store(group="driver", name=name, node=record_of(name))


def choices(task: Task, config_dir: str | None = None) -> dict[str, dict[str, str]]:
    """Config groups of a task, such as `data`, each with the names that `data=NAME` accepts and their descriptions."""
    roots = [tasks.conf_dir()] if config_dir is None else [tasks.conf_dir(), Path(config_dir)]
    groups = sorted(group.name for group in groups_of(task.defaults()) if group.name)
    files = {name: sorted(file for root in roots for file in (root / name).glob("*.yaml")) for name in groups}
    comments = {name: {file.stem: first_comment(file) for file in files[name]} for name in groups}
    if "driver" in comments:
        comments["driver"] = {name: model.title for name, model in MODELS.items()} | comments["driver"]
    return {name: chosen for name, chosen in comments.items() if chosen}


def first_comment(file: Path) -> str:
    """The comment a file begins with; empty for none."""
    # A file that is not text is reported when it is chosen; here it is only listed.
    first = file.read_text(encoding="utf-8", errors="replace").partition("\n")[0]
    return first.lstrip("# ") if first.startswith("#") else ""


def defaults_with(task: Task, overrides: list[str]) -> Any:
    """The record of a task with all defaults, for the driver model that the overrides choose."""
    record = task.defaults()
    models = [value for text in overrides for name, _, value in [text.partition("=")] if name == "driver"]
    if not hasattr(record, "driver") or not models:
        return record
    return replace(record, driver=record_of(models[-1])() if models[-1] in MODELS else _every_driver_key())


@functools.cache
def _every_driver_key() -> Any:
    """A record with the keys of all driver models, for a chosen file whose driver model is not known yet."""
    return make_dataclass("every_driver", [], bases=tuple(record_of(name) for name in MODELS))()


def repeated_keys(overrides: list[str]) -> list[str]:
    """Last override of every key that is given more than once with different values; earlier ones have no effect."""
    last = {text.partition("=")[0]: text for text in overrides}
    return list(dict.fromkeys(last[key] for text in overrides if last[key := text.partition("=")[0]] != text))


def check_overrides(task: Task, overrides: list[str], config_dir: str | None, *, many: bool = True) -> None:
    """Raise UsageError for unreadable words and unknown keys before Hydra sees them; it names the nearest valid key.

    With `many` a key may have several values, one for each job of a multirun.
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException

    keys = keys_of(defaults_with(task, overrides))
    mappings = [name for name, key in keys.items() if key.type_name == "dict"]
    records = {name.rpartition(".")[0] for name in keys}
    known_groups = choices(task, config_dir)
    for text in overrides:
        if "=" not in text:
            close = nearest(text, [*keys, *known_groups])
            raise UsageError(Problem("value-missing", f"is not key=value; nearest: {close}", key=text))
        try:
            override = OverridesParser.create().parse_override(text)
        except HydraException as error:
            raise UsageError(_unreadable_value(text, keys)) from error
        name = override.key_or_group
        if name.split(".")[0].split("/")[0] == "hydra":
            continue
        if text[0] in "+~":
            remedy = f"write {text.lstrip('+~')}"
            raise UsageError(Problem("key-added", "would add or remove a key", remedy, key=text))
        if name not in keys and name not in known_groups and name not in records and not _inside(name, mappings):
            raise UsageError(_no_such_key(task, name, [*keys, *known_groups]))
        if problem := _value_problem(override, keys, known_groups, many=many):
            raise UsageError(problem)


def _unreadable_value(text: str, keys: Mapping[str, Key]) -> Problem:
    """The problem of a word whose value Hydra cannot read."""
    name, _, value = text.partition("=")
    check_no_secret(value, name)
    kind = keys[name].type_name if name in keys else ""
    if kind == "dict":
        remedy = f"quote words with other characters than letters, digits and blanks: '{name}={{\"a (b)\": c}}'"
    elif kind.startswith("["):
        remedy = f"write {kind}, and quote words with other characters than letters and digits: '{name}=[\"a (b)\", c]'"
    elif kind.startswith("str"):
        remedy = f"quote it twice: '{name}={quoted(value)}'"
    else:
        remedy = f"write {kind}" if kind else ""
    return Problem("value-unreadable", "has a value that cannot be read", remedy, key=name, value=value)


def _value_problem(
    override: Any, keys: Mapping[str, Key], known_groups: Mapping[str, Mapping[str, str]], *, many: bool
) -> Problem | None:
    """Problem with the value of a known key that does not depend on the key's type; None if there is none."""
    name, value = override.key_or_group, override.input_line.partition("=")[2]
    if override.is_sweep_override():
        kind = keys[name].type_name if name in keys else ""
        remedy = "add -m for one job per value"
        if kind.startswith("["):
            remedy += f", or write {name}=[{value}] for a list"
        elif kind.startswith("str"):
            remedy += f", or quote a text twice: '{name}={quoted(value)}'"
        return None if many else Problem("several-values", "has several values", remedy, key=name, value=value)
    if name in known_groups and override.value() == "":
        return Problem("choice-unknown", f"must be one of {', '.join(known_groups[name])}", key=name, value="''")
    keys_inside = sorted(key for key in keys if key.startswith(f"{name}."))
    if keys_inside and name not in known_groups and not isinstance(override.value(), dict):
        return Problem("wrong-type", f"is a group of keys, such as {keys_inside[0]}", key=name, value=value)
    return None


@contextmanager
def hydra_errors(task: Task, overrides: list[str]) -> Iterator[None]:
    """Turns errors of Hydra and OmegaConf into a UsageError with the full key and the nearest valid one."""
    from hydra.errors import HydraException, MissingConfigException
    from omegaconf.errors import OmegaConfBaseException

    try:
        yield
    except MissingConfigException as error:
        group, _, name = (error.missing_cfg_file or "").rpartition("/")
        if not (name and error.options):
            raise UsageError(Problem("configuration-unreadable", str(error))) from error
        message = f"must be one of {', '.join(sorted(error.options))}; nearest: {nearest(name, error.options)}"
        raise UsageError(Problem("choice-unknown", message, key=group, value=name)) from error
    except (HydraException, OmegaConfBaseException) as error:
        raise UsageError(_problem(task, overrides, error)) from error


def _no_such_key(task: Task, name: str, known: Iterable[str], file: str | None = None) -> Problem:
    message = f"is not a key of `rearl {task.words}`; nearest: {nearest(name, known)}"
    return Problem("key-unknown", message, key=name, file=file)


def _problem(task: Task, overrides: list[str], error: BaseException) -> Problem:
    """The problem behind an error of Hydra or OmegaConf, with the key and the file that the error names."""
    cause: BaseException | None = error
    while cause is not None and getattr(cause, "full_key", None) is None:
        cause = cause.__cause__ or cause.__context__
    if cause is None:
        return Problem("configuration-unreadable", str(error))
    keys = keys_of(defaults_with(task, overrides))
    reason = str(cause).split("\n")[0]
    name = str(getattr(cause, "full_key", "")).partition("[")[0]
    match = re.match(r"In '(.+?)'", str(error))
    file = f"{match[1]}.yaml" if match else None
    if name in keys:
        return Problem("wrong-type", f"must be {keys[name].type_name}: {reason}", key=name, file=file)
    if name:
        return _no_such_key(task, name, keys, file)
    return Problem("configuration-unreadable", reason, file=file or " ".join(overrides))
