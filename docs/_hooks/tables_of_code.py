"""Tables that the code holds: columns and formats of recordings, metrics, keys of measurements, public names."""

import ast
from importlib import import_module
from pathlib import Path

import rearl_jax
from rearl_jax.config.data import DataFormat
from rearl_jax.data.readers import reader_of
from rearl_jax.data.schema import COLUMNS
from rearl_jax.data.tables.spelling import KINDS
from rearl_jax.data.units import UNITS
from rearl_jax.metrics import METRICS

BENCH = {
    "core": "benchmarks.core_results",
    "loop": "benchmarks.loop_results",
    "boundary": "benchmarks.boundary",
    "discover": "benchmarks.discover",
    "readers": "benchmarks.readers",
}
"""Module whose docstring explains the keys of a speed measurement, by benchmark."""

AREAS = {
    "core": "Traffic",
    "environments": "Environments",
    "data": "Recordings and scenes",
    "config": "Configuration",
    "metrics": "Metrics",
    "results": "Results",
    "workflows": "Tasks as functions",
}
"""Headings of the public names, by the package or module that owns them."""


def table_columns() -> str:
    """The columns of the canonical table."""
    rows = [
        f"| `{column.name}`{' *' if column.nullable else ''} | {column.dtype} | {column.unit} | {column.meaning} |"
        for column in COLUMNS
    ]
    return "\n".join(["| column | type | unit | meaning |", "|---|---|---|---|", *rows])


def recording_formats() -> str:
    """The formats of recordings: first line of their module, and meaning of data.root."""
    rows = []
    for kind in DataFormat:
        module = import_module(f"rearl_jax.data.readers.{kind.name}")
        what = (module.__doc__ or "").partition("\n")[0].rstrip(".")
        rows.append(f"| `{kind.name}` | {what} | {_cell(reader_of(kind).expected)} |")
    return "\n".join(["| `data=` | what is read | `data.root` names |", "|---|---|---|", *rows])


def units() -> str:
    """The units of foreign tables, by the columns that may be in them."""
    rows = []
    for kind, known in UNITS.items():
        columns = ", ".join(f"`{name}`" for name, unit in KINDS.items() if unit == kind)
        rows.append(f"| {columns} | {', '.join(f'`{unit}`' for unit in known)} |")
    return "\n".join(["| columns | units |", "|---|---|", *rows])


def shipped_recordings() -> str:
    """The shipped recordings: the table of the README beside them."""
    readme = Path(rearl_jax.__file__).parent / "data" / "shipped" / "README.md"
    return "\n".join(line for line in readme.read_text(encoding="utf-8").splitlines() if line.startswith("|"))


def metrics() -> str:
    """The metric table."""
    rows = [
        f"| `{metric.name}` | {metric.title} | {metric.unit} | {metric.direction.name} | {_cell(metric.definition)} | "
        f"{_cell(metric.source)} |"
        for metric in METRICS.values()
    ]
    head = "| name | | unit | better | definition | source |"
    return "\n".join([head, "|---|---|---|---|---|---|", *rows])


def bench_keys(name: str) -> str:
    """Meaning of the figures of `python -m benchmarks NAME`."""
    meanings: dict[str, str] = import_module(BENCH[name]).MEANINGS
    rows = [f"| `{key}` | {_cell(meaning)} |" for key, meaning in meanings.items()]
    return "\n".join(["| key | meaning |", "|---|---|", *rows])


def docstring(module: str) -> str:
    """Docstring of a module after its first line, with its layout."""
    lines = (import_module(module).__doc__ or "").strip().splitlines()
    return "\n".join(["```text", *lines[2:], "```"])


def packages() -> str:
    """The packages of `rearl_jax` with the first paragraph of their docstrings; none is imported."""
    rows = []
    for folder in sorted(file.parent for file in Path(rearl_jax.__file__).parent.glob("*/__init__.py")):
        source = (folder / "__init__.py").read_text(encoding="utf-8")
        paragraph = " ".join((ast.get_docstring(ast.parse(source)) or "").partition("\n\n")[0].split())
        rows.append(f"| `rearl_jax.{folder.name}` | {_cell(paragraph)} |")
    return "\n".join(["| package | content |", "|---|---|", *rows])


def public_names() -> str:
    """Every name of `rearl_jax`, as the modules that own them document it."""
    names: dict[str, list[str]] = {}
    for name, home in sorted(rearl_jax._HOMES.items()):
        entry = f"::: {home}.{name}\n    options: {{show_root_full_path: false}}"
        names.setdefault(home.split(".")[1], []).append(entry)
    blocks = []
    for area, entries in names.items():
        blocks += [f"## {AREAS.get(area, area.capitalize())}", *entries]
    return "\n\n".join(blocks)


def _cell(text: str) -> str:
    return text.replace("|", r"\|").replace("_", r"\_").replace("<", "&lt;")
