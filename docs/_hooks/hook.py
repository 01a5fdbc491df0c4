"""Insertion of lists from the code into pages, and formulas.

A line `<!-- generated: NAME WORDS -->` in a page is replaced by what the function of that name in `GENERATED` returns.
"""

import re
from collections.abc import Callable
from typing import Any

import car_following
import code_constants
import config_keys
import effect_library
import kept_results
import tables_of_code
from formulas import formula
from mkdocs.exceptions import PluginError

GENERATED: dict[str, Callable[..., str]] = {
    "bench-keys": tables_of_code.bench_keys,
    "car-following": car_following.car_following,
    "blind-priors": code_constants.blind_priors,
    "blind-scores": kept_results.blind_scores,
    "constants": code_constants.constants,
    "curves": effect_library.curves,
    "docstring": tables_of_code.docstring,
    "effects": effect_library.effects,
    "equilibria": car_following.equilibria,
    "help": config_keys.command_help,
    "keys": config_keys.keys,
    "known-time-gaps": kept_results.known_time_gaps,
    "metrics": tables_of_code.metrics,
    "packages": tables_of_code.packages,
    "public-names": tables_of_code.public_names,
    "recording-errors": kept_results.recording_errors,
    "recording-formats": tables_of_code.recording_formats,
    "shipped-recordings": tables_of_code.shipped_recordings,
    "sweeps": config_keys.sweeps,
    "table-columns": tables_of_code.table_columns,
    "tasks": config_keys.tasks_and_keys,
    "thresholds": code_constants.thresholds,
    "units": tables_of_code.units,
    "verdicts": kept_results.verdicts,
}
"""Functions by name; each takes the words that follow the name."""

_LINE = re.compile(r"^<!-- generated: (\S+)(.*?) -->$", re.MULTILINE)


def on_config(config: Any) -> Any:
    """Blocks of code in the language `math` become formulas."""
    fence = {"name": "math", "class": "math", "format": formula}
    config.mdx_configs.setdefault("pymdownx.superfences", {}).setdefault("custom_fences", []).append(fence)
    return config


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The page with its `generated` lines replaced and its formulas drawn."""

    def made(match: re.Match[str]) -> str:
        name, words = match[1], match[2].split()
        if name not in GENERATED:
            raise PluginError(
                f"{page.file.src_path}: nothing is generated as {name!r}; there are {', '.join(GENERATED)}"
            )
        return GENERATED[name](*words)

    return _LINE.sub(made, markdown)
