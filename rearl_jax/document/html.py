"""A document as one self-contained HTML page: figures, licences, and the command that repeats the study."""

import json
import shlex
from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from rearl_jax.code_version import __version__, git_sha
from rearl_jax.config._schema import as_plain, as_written, values_of
from rearl_jax.config.driver import record_of
from rearl_jax.config.quoting import quoted_if_needed
from rearl_jax.document.document import Document
from rearl_jax.document.table import spoken
from rearl_jax.results import config_hash
from rearl_jax.tasks import TASKS


@dataclass(frozen=True)
class Player:
    """The replay of scenes on a page: HTML, style sheet and program, rendered by jinja2, so not escaped again."""

    html: str
    style: str
    script: str


def page_of(
    document: Document,
    config: Any,
    figures: Mapping[str, bytes],
    *,
    data_id: str | None = None,
    made_by: Mapping[str, Any] | None = None,
    player: Player | None = None,
) -> str:
    """HTML text of a document: verdict, replay, sections, figures, data; then the collapsed sections.

    Args:
        document: The document.
        config: Record of its task.
        figures: PNG files by name.
        data_id: Identity of the data; None without data.
        made_by: Provenance of stored results, with the keys of `results.PROVENANCE`; None for results of this run.
        player: Scenes replayed; None for none.
    """
    environment = Environment(
        loader=PackageLoader("rearl_jax.document", ""), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    if made_by is None:
        made_by = {
            "code_version": __version__,
            "config_hash": config_hash(config),
            "git_sha": git_sha(),
            "data_id": None if data_id is None else f"scenes {data_id}",
        }
    identity = "" if made_by["data_id"] is None else f"{made_by['data_id']}, "
    version = made_by["code_version"]
    names = [*(name for name in document.captions if name in figures)]
    names += sorted(name for name in figures if name not in names)
    return environment.get_template("page.html.j2").render(
        document=document,
        subtitle=f"rearl_jax {version}, study {config.study}",
        figures=[
            {
                "title": spoken(name),
                "content": b64encode(figures[name]).decode(),
                "caption": document.captions.get(name, spoken(name)),
            }
            for name in names
        ],
        command=command(document.command, config),
        provenance=f"configuration {made_by['config_hash']}, {identity}code {made_by['git_sha'] or version}",
        configuration=json.dumps(as_plain(config), indent=2),
        player=player,
    )


def command(task: str, config: Any) -> str:
    """The command that repeats a study: the task with its fixed keys, such as `evaluate method=base`, then every key
    that differs from its default.
    """
    default, fixed = type(config)(), {word.partition("=")[0] for word in task.split()}
    implied = _implied(task)
    if hasattr(config, "driver") and config.driver.model != default.driver.model:
        task = f"{task} driver={config.driver.model}"
        default = replace(default, driver=record_of(config.driver.model)())
    defaults, values = values_of(default), values_of(config)
    given = {name for name, value in values.items() if value != defaults[name] and name not in fixed}
    groups = {word.split(".")[0] for word in given} | ({"driver"} if "driver=" in task else set())
    # A key that others imply is stated even if it has its default, which is not what they imply.
    given |= {key for group, key in implied.items() if group in groups and key not in fixed}
    stated = [f"{name}={_written(value)}" for name, value in values.items() if name in given]
    return " ".join(["rearl", task, *map(shlex.quote, stated)])


def _implied(task: str) -> dict[str, str]:
    """The key that each group of keys of a task implies."""
    named = [known for known in TASKS if f"{task} ".startswith(f"{known.words} ")]
    longest = max(named, key=lambda known: len(known.words), default=None)
    return {} if longest is None else {group: word.partition("=")[0] for group, word in longest.implied.items()}


def _written(value: Any) -> str:
    """A value as it is typed on the command line."""
    if isinstance(value, tuple) and all(isinstance(part, str) for part in value):
        return f"[{', '.join(map(quoted_if_needed, value))}]"
    return quoted_if_needed(value) if isinstance(value, str) and value else as_written(value)
