"""Formats of recordings, one per file: the name of the module is that of the format, and it holds a `READER`.

`data.format` takes the names of these modules, so a new format needs one new file here and no registration.
"""

from importlib import import_module

from rearl_jax.config.data import DataFormat
from rearl_jax.data.reader import Reader


def reader_of(format: DataFormat) -> Reader:
    """The reader of a format; the modules of other formats are not imported.

    Raises:
        TypeError: The module of the format holds none.
    """
    module = import_module(f"{__name__}.{format.name}")
    reader = getattr(module, "READER", None)
    if not isinstance(reader, Reader):
        raise TypeError(f"{module.__file__} must hold a Reader called READER")
    return reader
