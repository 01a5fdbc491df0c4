"""What `rearl --help` prints: tasks, and every key of a task with its type, default and meaning."""

import shutil
import textwrap
from pathlib import Path

from rearl_jax import tasks
from rearl_jax.cli.composition import choices
from rearl_jax.cli.sweep_files import sweeps_of
from rearl_jax.config._schema import Key, groups_of
from rearl_jax.tasks import Task

_OPTIONS = """\
options:
  -h, --help         tasks, or with a task its keys
  -m, --multirun     one job for every combination of comma-separated values, e.g. -m eval.seed=1,2,3;
                     hydra/launcher=joblib, ray or submitit_slurm runs them side by side
  --sweep NAME       the multirun that is written down in sweeps/NAME.yaml
  --config           print the complete configuration and stop
  --config-dir DIR   look for configuration files in DIR as well
  --traceback        show where an error arose
  --version          version of the package"""


def general_help() -> str:
    """Tasks and options."""
    width = max(len(task.words) for task in tasks.TASKS)
    lines = "\n".join(f"  {task.words:<{width}}  {task.summary}" for task in tasks.TASKS)
    return (
        "rearl: batch highway traffic simulation, held to measured trajectories\n\n"
        f"usage: rearl TASK [options] [key=value ...]\n\ntasks:\n{lines}\n\n{_OPTIONS}\n\n"
        "`rearl TASK --help` lists the keys of a task."
    )


def task_help(task: Task) -> str:
    """One task: what it does, its keys, its sweep files, examples, options."""
    columns = min(shutil.get_terminal_size((110, 24)).columns, 120)
    blocks = [
        f"rearl {task.words}: {task.summary}",
        f"usage: rearl {task.words} [options] [key=value ...]",
        textwrap.fill(task.description, columns),
    ]
    for group in groups_of(task.defaults()):
        heading = f"{group.name}: {group.help}" if group.name else "keys:"
        files = choices(task).get(group.name, [])
        names = [f"  {group.name}={file.stem}  {_first_comment(file)}" for file in files]
        blocks.append("\n".join([heading, *names, *(_key_help(key, columns) for key in group.keys)]))
    files = sweeps_of(task)
    if files:
        width = max(map(len, files))
        blocks.append(
            "\n".join(["sweeps:", *(f"  --sweep {n:<{width}}  {_first_comment(f)}" for n, f in files.items())])
        )
    blocks.append("\n".join(["examples:", *(f"  {example}" for example in task.examples)]))
    return "\n\n".join([*blocks, _OPTIONS])


def _key_help(key: Key, columns: int) -> str:
    text = textwrap.wrap(key.help, columns, initial_indent=" " * 6, subsequent_indent=" " * 6)
    return "\n".join([f"  {key.name}={key.default}  ({key.type_name})", *text])


def _first_comment(file: Path) -> str:
    first = file.read_text(encoding="utf-8").partition("\n")[0]
    return first.lstrip("# ") if first.startswith("#") else ""
