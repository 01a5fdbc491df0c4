"""Tasks and configuration keys as pages, from the records that `rearl TASK --help` prints."""

import ast
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path

from rearl_jax import tasks
from rearl_jax.cli.composition import choices, first_comment
from rearl_jax.cli.help import general_help
from rearl_jax.cli.sweep_files import sweeps_of
from rearl_jax.config._schema import Group, Key, groups_of
from rearl_jax.tasks import Task


def command_help() -> str:
    """Output of `rearl --help`."""
    return f"```text\n{general_help()}\n```"


def tasks_and_keys() -> str:
    """Description, own keys, shared groups, sweeps and examples of every task."""
    return "\n\n".join(_task(task) for task in tasks.TASKS)


def keys() -> str:
    """Every key that tasks share, by group."""
    groups: dict[str, list[tuple[Task, Group]]] = {}
    for task in tasks.TASKS:
        for group in groups_of(task.defaults()):
            if group.name:
                groups.setdefault(group.name, []).append((task, group))
    return "\n\n".join(_group(name, groups[name]) for name in groups)


def sweeps(words: str) -> str:
    """The shipped sweep files of a task."""
    task = next(task for task in tasks.TASKS if task.config_name == words)
    rows = [f"| `{name}` | {first_comment(file).rstrip('.')} |" for name, file in sweeps_of(task).items()]
    return "\n".join(["| `--sweep` | what is varied |", "|---|---|", *rows])


def _task(task: Task) -> str:
    groups = list(groups_of(task.defaults()))
    shared = ", ".join(f"[`{group.name}`](keys.md#{_anchor(group.name)})" for group in groups if group.name)
    blocks = [f"## rearl {task.words}", task.description, *_files(task)]
    blocks += [_definition([(task, key)]) for group in groups if not group.name for key in group.keys]
    blocks.append(f"Groups of keys: {shared}.")
    if sweeps_of(task):
        blocks.append(sweeps(task.config_name))
    blocks.append("\n".join(["```sh", *task.examples, "```"]))
    return "\n\n".join(blocks)


def _files(task: Task) -> list[str]:
    """Files of a task, from the docstring of its module, which is not imported."""
    spec = find_spec(task.run.partition(":")[0])
    assert spec is not None
    assert spec.origin is not None
    docstring = ast.get_docstring(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))) or ""
    return [" ".join(paragraph.split()) for paragraph in docstring.split("\n\n")[1:]]


def _group(name: str, having: Sequence[tuple[Task, Group]]) -> str:
    blocks = [f"## {name} {{ #{_anchor(name)} }}"]
    meanings = {group.help: None for _, group in having}
    blocks.append(f"{'; '.join(meanings)}. Of {_named(task for task, _ in having)}.")
    chosen = {choice: line for task, _ in having for choice, line in choices(task).get(name, {}).items()}
    if chosen:
        blocks.append("\n".join(f"- `{name}={choice}`: {line.rstrip('.')}" for choice, line in chosen.items()))
    by_name: dict[str, list[tuple[Task, Key]]] = {}
    for task, group in having:
        for key in group.keys:
            by_name.setdefault(key.name, []).append((task, key))
    return "\n\n".join([*blocks, *(_definition(rows) for rows in by_name.values())])


def _definition(rows: Sequence[tuple[Task, Key]]) -> str:
    """One key; if tasks differ in its default or meaning, one entry per variant with the tasks it holds for."""
    ways: dict[Key, list[Task]] = {}
    for task, key in rows:
        ways.setdefault(key, []).append(task)
    lines = []
    for key, having in ways.items():
        of = f" (of {_named(having)})" if len(ways) > 1 else ""
        lines.append(f"`{key.name}={key.default}`{of}\n:   {_escaped(key.help)}. Type: `{key.type_name}`")
    return "\n\n".join(lines)


def _named(having: Iterable[Task]) -> str:
    return ", ".join(f"`{task.words}`" for task in having)


def _anchor(name: str) -> str:
    return name.replace(".", "-")


def _escaped(text: str) -> str:
    """Text of the terminal as Markdown."""
    return text.replace("*", r"\*").replace("<", "&lt;").replace("_", r"\_").rstrip(".")
