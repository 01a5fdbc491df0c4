"""What every page shares: one look, figures inside the file, data and licences, the command that repeats the study."""

import json
import shlex
from base64 import b64encode
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from rearl_jax.code_version import __version__, git_sha
from rearl_jax.config._schema import as_plain, keys_of
from rearl_jax.config.driver import record_of
from rearl_jax.data.records import RecordingInfo
from rearl_jax.results import config_hash

_HOME = "rearl_jax.evaluation"
"""The package that holds `layout.html.j2`, which templates extend."""


_SHORT = 40
"""Characters of a table's cell that stays on one line."""


def render_page(
    template: str,
    *,
    package: str = _HOME,
    words: str,
    config: Any,
    figures: Mapping[str, bytes],
    captions: Mapping[str, str],
    data_id: str | None = None,
    made_by: Mapping[str, Any] | None = None,
    **content: Any,
) -> str:
    """The page as HTML text; nothing in it is loaded from anywhere else.

    Args:
        template: File that extends `layout.html.j2`.
        package: The package that holds it.
        words: The task, as in `evaluate`.
        config: Its record.
        figures: PNG files by name.
        captions: What is below each figure, by name.
        data_id: Identity of the data; None without data.
        made_by: Provenance of results that were made before, as `results.PROVENANCE` names it; None for those made now.
        **content: What the blocks of the template need, and `title`, `generated`, `data`.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package, ""), PackageLoader(_HOME, "")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    environment.tests |= {"long": lambda text: len(text) > _SHORT, "words": lambda text: text[:1].isalpha()}
    if made_by is None:
        made_by = {
            "code_version": __version__,
            "config_hash": config_hash(config),
            "git_sha": git_sha(),
            "data_id": None if data_id is None else f"scenes {data_id}",
        }
    identity = "" if made_by["data_id"] is None else f"{made_by['data_id']}, "
    version, code = made_by["code_version"], made_by["git_sha"] or made_by["code_version"]
    return environment.get_template(template).render(
        subtitle=f"rearl_jax {version}, study {config.study}",
        figures=[
            {"alt": name.replace("_", " "), "content": b64encode(png).decode(), "caption": captions[name]}
            for name, png in figures.items()
        ],
        command=command(words, config),
        provenance=f"configuration {made_by['config_hash']}, {identity}code {code}",
        configuration=json.dumps(as_plain(config), indent=2),
        **content,
    )


def command(words: str, config: Any) -> str:
    """The command that repeats a study: every key that differs from its default.

    Args:
        words: The task, and words that are always said, as in `evaluate method=base`.
        config: Its record.
    """
    usual, said = type(config)(), {word.partition("=")[0] for word in words.split()}
    if hasattr(config, "driver") and config.driver.model != usual.driver.model:
        words = f"{words} driver={config.driver.model}"
        usual = replace(usual, driver=record_of(config.driver.model)())
    defaults, chosen = keys_of(usual), keys_of(config)
    changed = [
        f"{name}={key.default}"
        for name, key in chosen.items()
        if key.default != defaults[name].default and name not in said
    ]
    return " ".join(["rearl", words, *map(shlex.quote, changed)])


def data_sources(infos: Iterable[RecordingInfo]) -> list[dict[str, object]]:
    """Data sets with their licence and what must be known about them, each once."""
    found: dict[tuple[str, str, str], list[str]] = {}
    for info in infos:
        notes = found.setdefault((info.source, info.attribution, info.licence), [])
        notes += [note for note in info.notes if note not in notes]
    return [
        {"name": name, "attribution": attribution.rstrip("."), "licence": licence.rstrip("."), "notes": notes}
        for (name, attribution, licence), notes in found.items()
    ]
