"""Tables of the documented constants of modules, and of the thresholds of discovery."""

import ast
from collections.abc import Iterator
from importlib import import_module
from inspect import getsource
from types import ModuleType
from typing import Any

from rearl_jax.blind.traffic.priors import CHOICES, PRIORS
from rearl_jax.discovery.thresholds import THRESHOLDS, meanings


def constants(*modules: str) -> str:
    """Name, value and meaning of every documented public constant of the modules."""
    rows = [row for name in modules for row in _rows(import_module(name))]
    return "\n".join(["| | value | meaning |", "|---|---|---|", *rows])


def thresholds() -> str:
    """Every threshold of discovery: its name, its value and what it is."""
    texts = {name: text.replace("|", r"\|") for name, text in meanings().items()}
    rows = [f"| `{name}` | {_written(value)} | {texts[name]} |" for name, value in THRESHOLDS.plain().items()]
    return "\n".join(["| | value | meaning |", "|---|---|---|", *rows])


def blind_priors() -> str:
    """Every broad prior of the blind study: its range, the range with 1.5 times the width, and what is drawn."""
    wide = {row["name"]: row for row in PRIORS.widened(1.5).rows()}
    rows = [
        f"| `{row['name']}` | {_ends(row)} | {_ends(wide[row['name']])} | {row['unit']} | "
        f"{'logarithm' if row['is_log'] else 'value'} | {row['meaning']} |"
        for row in PRIORS.rows()
    ]
    head = ["| | from, to | 1.5 times as broad | unit | uniform | drawn |", "|---|---|---|---|---|---|"]
    choices = [
        f"| `{name}` | {', '.join(map(str, values))} | the same | | choice | one of these |"
        for name, values in CHOICES.items()
    ]
    return "\n".join([*head, *rows, *choices])


def _ends(row: dict[str, Any]) -> str:
    return f"{row['low']:.3g}, {row['high']:.3g}"


def _rows(module: ModuleType) -> Iterator[str]:
    body = ast.parse(getsource(module)).body
    for statement, after in zip(body, body[1:], strict=False):
        if not (isinstance(statement, ast.Assign) and isinstance(after, ast.Expr)):
            continue
        targets = [name.id for target in statement.targets for name in ast.walk(target) if isinstance(name, ast.Name)]
        values = [getattr(module, name) for name in targets]
        if not (isinstance(after.value, ast.Constant) and isinstance(after.value.value, str)):
            continue
        if any(name.startswith("_") for name in targets) or not all(map(_is_number, values)):
            continue
        names = "<br>".join(f"`{name}`" for name in targets)
        meaning = " ".join(after.value.value.split()).replace("|", r"\|")
        yield f"| {names} | {'<br>'.join(map(_written, values))} | {meaning} |"


def _is_number(value: Any) -> bool:
    if isinstance(value, tuple):
        return bool(value) and all(map(_is_number, value))
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _written(value: Any) -> str:
    return ", ".join(map(_written, value)) if isinstance(value, tuple) else f"{value:.4g}"
