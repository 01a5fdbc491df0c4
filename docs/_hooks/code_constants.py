"""Tables of the documented constants of modules, and of the thresholds of discovery."""

import ast
from collections.abc import Iterator
from importlib import import_module
from inspect import getsource
from types import ModuleType
from typing import Any

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
