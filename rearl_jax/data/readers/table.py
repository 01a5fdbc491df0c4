"""Tables in the canonical schema, Parquet or CSV."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rearl_jax.config.data import DataConfig
from rearl_jax.data.reader import Entry, Reader
from rearl_jax.data.tables import canonical


def entries(data: DataConfig, root: Path) -> Iterator[Entry]:
    """The recordings of all files."""
    for path in canonical.find_tables(root):
        file = canonical.TableFile(path, data)
        for name in file.recordings():
            yield Entry(name, partial(file.read, name), partial(file.read, name), path)


def files(root: Path) -> list[Path]:
    """The tables, and what is stated beside them."""
    tables = canonical.find_tables(root)
    return [*tables, *filter(Path.is_file, map(canonical.sidecar, tables))]


def is_generated(data: DataConfig, root: Path) -> bool:
    """True if any of the files states that it was generated."""
    tables = (canonical.TableFile(path, data) for path in canonical.find_tables(root))
    return any(info.generated for table in tables for info in table.stated().values())


READER = Reader(
    expected="a .parquet or .csv file in the canonical schema, or a folder of them",
    entries=entries,
    files=files,
    generated=is_generated,
)
