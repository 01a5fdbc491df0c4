"""Text of `rearl --help`: tasks, and every key of a task with its type, default and meaning."""

import shutil
import textwrap

from rearl_jax import tasks
from rearl_jax.cli.composition import choices, defaults_with, first_comment
from rearl_jax.cli.sweep_files import sweeps_of
from rearl_jax.config._schema import Key, groups_of
from rearl_jax.tasks import Task

_OPTIONS = """\
options:
  -h, --help         tasks, or with a task its keys
  -m, --multirun     one job for every combination of comma-separated values, e.g. -m eval.seed=1,2,3;
                     hydra/launcher=joblib, ray or submitit_slurm runs them in parallel
  --sweep NAME       the multirun stored in sweeps/NAME.yaml
  --json             the summary of the finished task as one line of JSON on standard output, all else on standard error
  --config           print the complete configuration and stop
  --config-dir DIR   look for configuration files in DIR as well
  --traceback        show where an error arose
  --version          version of the package"""

_EXIT_CODES = """\
exit codes:
  0 done    1 a check or the program has failed    2 an error in the input: one sentence names it and the remedy
  130 ended by Ctrl-C, 143 by SIGTERM, 129 by SIGHUP: the last line is the command that continues
  141 the reader of the output has closed it"""

_EXAMPLES = (
    "rearl doctor                          check the installation",
    "rearl evaluate                        simulate the shipped recordings and compare",
    "rearl evaluate --help                 every key of the task",
    "rearl evaluate --json | jq .rows[0].h",
    "rearl discover data=highd data.root=/data/highD study=mine",
    "rearl report study=mine               the finished study as one page",
)


def general_help() -> str:
    """Tasks and options."""
    width = max(len(task.words) for task in tasks.TASKS)
    lines = "\n".join(f"  {task.words:<{width}}  {task.summary}" for task in tasks.TASKS)
    return (
        "rearl: batch highway traffic simulation, compared with measured trajectories\n\n"
        f"usage: rearl TASK [options] [key=value ...]\n\ntasks:\n{lines}\n\n{_OPTIONS}\n\n"
        f"{_listed('examples:', _EXAMPLES)}\n\n{_EXIT_CODES}\n\n"
        "`rearl TASK --help` lists the keys of a task."
    )


def tasks_beginning_with(words: list[str]) -> list[Task]:
    """Tasks of several words whose first word is the given one; none if the given words name a task themselves."""
    if any(words[: len(name)] == name for name in (task.words.split() for task in tasks.TASKS)):
        return []
    return [task for task in tasks.TASKS if task.words.startswith(f"{words[0]} ")]


def group_help(group: list[Task]) -> str:
    """Tasks that begin with the same word, each with its examples."""
    parts = [f"rearl {task.words}: {task.summary}\n" + _listed("", task.examples).lstrip("\n") for task in group]
    return "\n\n".join([*parts, "`rearl TASK --help` lists the keys of a task."])


def task_help(task: Task, overrides: list[str]) -> str:
    """One task: what it does, its keys, its sweep files, examples, options."""
    columns = min(shutil.get_terminal_size((110, 24)).columns, 120)
    blocks = [
        f"rearl {task.words}: {task.summary}",
        f"usage: rearl {task.words} [options] [key=value ...]",
        textwrap.fill(task.description, columns),
        "Defaults are shown after the equals sign; a default without a source was chosen for this project.",
    ]
    for group in groups_of(defaults_with(task, overrides)):
        heading = f"{group.name}: {group.help}" if group.name else "keys:"
        names = [f"  {group.name}={name}  {line}" for name, line in choices(task).get(group.name, {}).items()]
        blocks.append("\n".join([heading, *names, *(_key_help(key, columns) for key in group.keys)]))
    files = sweeps_of(task)
    if files:
        width = max(map(len, files))
        blocks.append(
            "\n".join(["sweeps:", *(f"  --sweep {n:<{width}}  {first_comment(f)}" for n, f in files.items())])
        )
    return "\n\n".join([*blocks, _listed("examples:", task.examples), _OPTIONS, _EXIT_CODES])


def _listed(heading: str, lines: tuple[str, ...]) -> str:
    return "\n".join([heading, *(f"  {line}" for line in lines)])


def _key_help(key: Key, columns: int) -> str:
    text = textwrap.wrap(key.help, columns, initial_indent=" " * 6, subsequent_indent=" " * 6)
    return "\n".join([f"  {key.name}={key.default}  ({key.type_name})", *text])
