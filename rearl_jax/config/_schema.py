"""Configuration records as a flat list of keys, with type and meaning.

From a task's dataclass (standard library only) this module derives the keys by full name, the nearest key to a misspelt
one, and finished records, with the declared tuples instead of lists. A record's own method `check`, if there is one,
raises InvalidInputError for a value outside its range; `finished` calls it.
"""

import difflib
import math
import types
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import Field, dataclass, fields, is_dataclass, replace
from enum import Enum
from numbers import Integral, Real
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from rearl_jax.config.quoting import quoted
from rearl_jax.problems import InvalidInputError, Problem

Record = TypeVar("Record")


@dataclass(frozen=True)
class Key:
    """A configuration key: full name, type and default as written on the command line, documentation."""

    name: str
    type_name: str
    default: str
    help: str


@dataclass(frozen=True)
class Group:
    """The keys of one record: its full name (empty for the task itself) and its description."""

    name: str
    help: str
    keys: tuple[Key, ...]


def configured_fields(record: Any) -> list[Field]:
    """Fields of a record that are configuration: those that take part in comparisons."""
    return [item for item in fields(record) if item.compare]


def groups_of(record: Any, name: str = "", help: str = "") -> Iterator[Group]:
    """The groups of a record of defaults, outermost first; `name` and `help` are those of the record itself."""
    hints = get_type_hints(type(record))
    prefix = f"{name}." if name else ""
    values = {item: getattr(record, item.name) for item in configured_fields(record)}
    keys = tuple(
        Key(prefix + item.name, type_name(hints[item.name]), as_written(value), item.metadata["help"])
        for item, value in values.items()
        if not is_dataclass(value)
    )
    if keys:
        yield Group(name, help, keys)
    for item, value in values.items():
        if is_dataclass(value):
            yield from groups_of(value, prefix + item.name, item.metadata["help"])


def keys_of(record: Any) -> dict[str, Key]:
    """Keys of a record of defaults by their full names."""
    return {key.name: key for group in groups_of(record) for key in group.keys}


def values_of(record: Any) -> dict[str, Any]:
    """Values of a record by the full names of their keys."""
    values: dict[str, Any] = {}
    for item in configured_fields(record):
        value = getattr(record, item.name)
        if is_dataclass(value):
            values |= {f"{item.name}.{name}": part for name, part in values_of(value).items()}
        else:
            values[item.name] = value
    return values


def nearest(name: str, known: Iterable[str]) -> str:
    """The known name most similar to a given one, also by the last part alone (`stride` for `scenes.stride`)."""

    def similarity(candidate: str) -> float:
        whole = difflib.SequenceMatcher(None, name.lower(), candidate.lower()).ratio()
        last_parts = (name.lower().rpartition(".")[2], candidate.lower().rpartition(".")[2])
        return max(whole, 0.99 * difflib.SequenceMatcher(None, *last_parts).ratio())

    return max(sorted(known), key=similarity)


def type_name(hint: Any) -> str:
    """A type in readable form, e.g. `float`, `str or null`, `pooled|per_direction`, `[float, ...]`."""
    if hint is type(None):
        return "null"
    if get_origin(hint) in (Union, types.UnionType):
        return " or ".join(type_name(part) for part in get_args(hint))
    if get_origin(hint) is Sequence:
        return f"[{type_name(*get_args(hint))}, ...]"
    if get_origin(hint) is tuple:
        parts = ("..." if part is Ellipsis else type_name(part) for part in get_args(hint))
        return f"[{', '.join(parts)}]"
    if isinstance(hint, type) and issubclass(hint, Enum):
        return "|".join(hint.__members__)
    return hint.__name__


def as_written(value: Any) -> str:
    """A value as written on the command line, e.g. `null`, `true`, `[1, 2]`, an enumeration by its name."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, tuple):
        return f"[{', '.join(as_written(part) for part in value)}]"
    if isinstance(value, Mapping):
        pairs = (f"{_in_mapping(name)}: {_in_mapping(part)}" for name, part in value.items())
        return "{" + ", ".join(pairs) + "}"
    return str(value) or "''"


def _in_mapping(part: Any) -> str:
    """A key or value of a mapping, quoted so that Hydra reads a text as a text."""
    return quoted(part) if isinstance(part, str) else as_written(part)


def as_plain(value: Any) -> Any:
    """A record as dictionaries, lists, texts and numbers, the same on every machine; infinities and NaN as texts."""
    if is_dataclass(value) and not isinstance(value, type):
        return {item.name: as_plain(getattr(value, item.name)) for item in configured_fields(value)}
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Mapping):
        return {str(name): as_plain(part) for name, part in value.items()}
    if isinstance(value, (tuple, list)):
        return [as_plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def from_plain(record: type[Record], plain: Mapping[str, Any], prefix: str = "") -> Record:
    """The record from the result of `as_plain`; missing keys have their defaults.

    Raises:
        InvalidInputError: A key is unknown, or a value has a wrong type or is not among the choices.
    """
    if not isinstance(plain, Mapping):
        raise _wrong_type(prefix.rstrip(".") or "it", "a mapping of keys to values", plain)
    hints = get_type_hints(record)
    unknown = sorted(plain.keys() - {item.name for item in fields(record)})  # type: ignore[arg-type]
    if unknown:
        raise InvalidInputError(Problem("key-unknown", "is not a key of this version", key=f"{prefix}{unknown[0]}"))
    return record(**{name: _from_plain(hints[name], value, prefix + name) for name, value in plain.items()})


def _from_plain(hint: Any, value: Any, name: str) -> Any:
    if value is None:
        if type(None) not in get_args(hint):
            raise _wrong_type(name, type_name(hint), "None")
        return None
    if get_origin(hint) in (Union, types.UnionType):
        hint = next(part for part in get_args(hint) if part is not type(None))
    if is_dataclass(hint) and isinstance(hint, type):
        return _record_from_plain(hint, value, name)
    if get_origin(hint) is dict:
        if not isinstance(value, Mapping):
            raise _wrong_type(name, "a mapping of keys to values", value)
        return dict(value)
    if isinstance(hint, type) and issubclass(hint, Enum):
        if not (isinstance(value, str) and value in hint.__members__):
            message = f"must be one of {type_name(hint)}"
            raise InvalidInputError(Problem("choice-unknown", message, key=name, value=value))
        return hint[value]
    if get_origin(hint) is Sequence:
        hint, value = tuple[*get_args(hint), ...], value.tolist() if hasattr(value, "tolist") else value
    if get_origin(hint) is tuple:
        parts = get_args(hint)
        if not isinstance(value, (list, tuple)) or not (Ellipsis in parts or len(parts) == len(value)):
            raise _wrong_type(name, type_name(hint), value)
        inner = [parts[0]] * len(value) if Ellipsis in parts else parts
        return tuple(_from_plain(part, item, name) for part, item in zip(inner, value, strict=True))
    is_inf_or_nan = hint is float and value in ("inf", "-inf", "nan")  # as `as_plain` writes them
    kind = {int: Integral, float: Real}.get(hint, hint)
    if not is_inf_or_nan and (not isinstance(value, kind) or (isinstance(value, bool) and hint is not bool)):
        raise _wrong_type(name, type_name(hint), value)
    return hint(value) if hint in (int, float) else value


def _record_from_plain(hint: type, value: Any, name: str) -> Any:
    """The record of a group; a group with one record per model, such as `driver`, may be given as the model's name."""
    record_for = getattr(hint, "record_for", None)
    if record_for is None:
        return from_plain(hint, value, f"{name}.")
    plain = {"model": value} if isinstance(value, str) else value
    return from_plain(record_for(value, f"{name}."), plain, f"{name}.")


def finished(record: Record, prefix: str = "") -> Record:
    """The record with lists turned into the declared tuples, after every nested `check` has passed.

    Raises:
        InvalidInputError: A tuple has the wrong length, a number is NaN, or a record's `check` refuses it; the error
            has the full key.
    """
    hints = get_type_hints(type(record))
    changed = {}
    for item in fields(record):  # type: ignore[arg-type]
        value = getattr(record, item.name)
        if is_dataclass(value):
            changed[item.name] = finished(value, f"{prefix}{item.name}.")
        elif isinstance(value, (list, tuple)):
            changed[item.name] = _tuple_of(value, hints[item.name], prefix + item.name)
        elif value is not None and _is_tuple(hints[item.name]):
            # For example from ${oc.env:NAME}, which OmegaConf does not convert.
            raise _wrong_type(prefix + item.name, type_name(hints[item.name]), repr(value))
        parts = value if isinstance(value, (list, tuple)) else (value,)
        if any(isinstance(part, float) and math.isnan(part) for part in parts):
            # Every comparison with NaN is false, so a check such as `value < 0` would accept it.
            raise _wrong_type(prefix + item.name, type_name(hints[item.name]), math.nan)
    record = replace(record, **changed)  # type: ignore[type-var]
    check = getattr(record, "check", None)
    if check is not None:
        try:
            check()
        except InvalidInputError as error:
            raise error.within(prefix) from error
    return record


def _wrong_type(name: str, wanted: str, value: Any) -> InvalidInputError:
    return InvalidInputError(Problem("wrong-type", f"must be {wanted}", key=name, value=value))


def _is_tuple(hint: Any) -> bool:
    return tuple in (get_origin(hint), *map(get_origin, get_args(hint)))


def _tuple_of(values: Any, hint: Any, name: str) -> tuple:
    if get_origin(hint) in (Union, types.UnionType):
        hint = next(part for part in get_args(hint) if get_origin(part) is tuple)
    parts = get_args(hint)
    if Ellipsis not in parts and len(values) != len(parts):
        message = f"must have {len(parts)} values {type_name(hint)}"
        raise InvalidInputError(Problem("wrong-length", message, key=name, value=len(values)))
    return tuple(values)
