"""Writing and reading of `model.yaml`, the file of a repaired model; every key is checked. Its keys:

schema: 1
car_following: idm
source: {data_id: ..., study: ..., code_version: ...}
population: {car: {share: ..., log_mean: {...}, log_covariance: [[...], ...], noise_sd: ..., ...}, truck: {...}}
effects: [{name: ..., parameters: {...}}, ...]
lane_changing: {politeness: ..., gain_threshold: ..., safe_decel: ..., bias: ..., delay: ...}
baseline: {car: {...}, truck: {...}}
"""

import hashlib
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from rearl_jax.config._schema import nearest
from rearl_jax.config.driver import MODELS
from rearl_jax.config.driver.declaration import DriverModel
from rearl_jax.core.effects import EFFECTS, VARIABLES
from rearl_jax.models.record import (
    CAR,
    LANE_CHANGE_BOUNDS,
    SCHEMA,
    TRUCK,
    DriverClass,
    EffectValues,
    LaneChangeValues,
    RepairedModel,
    Source,
)
from rearl_jax.problems import InvalidInputError, MissingInputError, Problem
from rearl_jax.whole_files import replacing

RANGES = {
    "share": (0.0, 1.0),
    "noise_sd": (0.0, 3.0),
    "noise_time": (0.05, 60.0),
    "length": (1.0, 40.0),
    "length_sd": (0.0, 10.0),
}
"""Bounds of the numbers of a class of drivers, in the units of `DriverClass`."""


class BadModelError(InvalidInputError):
    """A model file that cannot be used: which file, which key, and what to do."""


def write_model(path: str | Path, model: RepairedModel) -> None:
    """Writes a model, which is checked first; the file appears whole or not at all.

    Raises:
        BadModelError: The model could not be read back.
    """
    plain = asdict(model)
    content = _plain(
        {
            "schema": SCHEMA,
            **{name: plain[name] for name in ("car_following", "source", "population", "effects", "baseline")},
        }
    )
    if plain["lane_changing"] is not None:
        content["lane_changing"] = _plain(plain["lane_changing"])
    for effect in content["effects"]:
        if effect["variable"] is None:
            del effect["variable"]
    _checked(Path(path), content)
    with replacing(Path(path)) as unfinished:
        unfinished.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


def read_model(path: str | Path) -> RepairedModel:
    """The model in a file.

    Raises:
        MissingInputError: There is no such file.
        IsADirectoryError: The path is a folder.
        BadModelError: A key is missing, unknown or outside its bounds.
    """
    path = Path(path)
    try:
        content = _Loader(path.read_text(encoding="utf-8")).get_single_data()
    except FileNotFoundError:
        message = "must name a file that is there; `rearl discover` writes model.yaml"
        raise MissingInputError(Problem("file-missing", message, key="model", value=str(path))) from None
    except IsADirectoryError:
        raise IsADirectoryError(f"model={path} is a folder: name the file model.yaml in it") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: no UTF-8, or no number or date
        raise BadModelError(Problem("not-yaml", f"the file is not YAML: {error}", file=str(path))) from error
    return _checked(path, content)


def model_id(path: str | Path) -> str:
    """Identity of a model file: a hash of its content."""
    return f"model-{hashlib.sha256(Path(path).read_bytes()).hexdigest()[:12]}"


def _plain(value: Any) -> Any:
    """Dictionaries, lists, texts and Python numbers only."""
    if isinstance(value, Mapping):
        return {str(key): _plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(part) for part in value]
    return value.item() if isinstance(value, np.generic) else value


class _Loader(yaml.SafeLoader):
    """Reader of YAML that refuses a key that occurs twice in a mapping, of which PyYAML would take the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            if key.value in seen:
                raise yaml.constructor.ConstructorError(None, None, f"the key {key.value} occurs twice", key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep)


class _Reader:
    """Checks of the parts of a model file; each raises BadModelError, which names the file and the key of the part."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def refuse(self, code: str, key: str, message: str) -> BadModelError:
        """The error for a key of the file."""
        return BadModelError(Problem(code, message, file=str(self._path), key=key))

    def mapping(self, value: Any, key: str, names: Sequence[str], optional: Sequence[str] = ()) -> dict[str, Any]:
        """A mapping with exactly these keys."""
        if not isinstance(value, dict):
            raise self.refuse("wrong-type", key, f"must be a mapping with {', '.join(names)}, got {value!r}")
        for name in value:
            if name not in (*names, *optional):
                known = (*names, *optional)
                raise self.refuse("key-unknown", f"{key}.{name}", f"is not a key; nearest: {nearest(str(name), known)}")
        for name in names:
            if name not in value:
                message = "is missing: write it, or let `rearl discover` write the file"
                raise self.refuse("key-missing", f"{key}.{name}", message)
        return value

    def number(self, value: Any, key: str, low: float, high: float) -> float:
        """A number within bounds."""
        number = math.nan
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            with suppress(OverflowError):  # a whole number of hundreds of digits
                number = float(value)
        if not math.isfinite(number):
            message = f"must be a finite number, got {value!r:.80} (YAML wants 1.0e-3, not 1e-3)"
            raise self.refuse("not-a-number", key, message)
        if not low <= number <= high:
            raise self.refuse("out-of-range", key, f"must be within {low:g} and {high:g}, got {number:g}")
        return number

    def numbers(self, value: Any, key: str, low: float, high: float) -> list[float]:
        """A list of numbers within bounds."""
        if not isinstance(value, list) or not value:
            raise self.refuse("wrong-type", key, f"must be a list of numbers, got {value!r}")
        return [self.number(item, f"{key}[{index}]", low, high) for index, item in enumerate(value)]

    def text(self, value: Any, key: str) -> str:
        """A text that is not empty."""
        if not isinstance(value, str) or not value:
            raise self.refuse("wrong-type", key, f"must be a text, got {value!r}")
        return value


def _checked(path: Path, content: Any) -> RepairedModel:
    reader = _Reader(path)
    whole = reader.mapping(
        content,
        "the file",
        ("schema", "source", "population", "effects", "baseline"),
        ("car_following", "lane_changing"),
    )
    if whole["schema"] != SCHEMA:
        raise reader.refuse(
            "schema-unknown",
            "schema",
            f"is {whole['schema']!r}, but this version reads {SCHEMA}: write the model again with it",
        )
    car_following = whole.get("car_following", "idm")  # the model of files without this key
    if car_following not in MODELS:
        close = nearest(str(car_following), MODELS)
        raise reader.refuse(
            "choice-unknown",
            "car_following",
            f"is {car_following!r}; nearest: {close}; models: {', '.join(MODELS)}",
        )
    drivers_of = MODELS[car_following]
    names = [item.name for item in fields(Source)]
    source = reader.mapping(whole["source"], "source", names)
    population, baseline = (_population(reader, whole[name], name, drivers_of) for name in ("population", "baseline"))
    if population.keys() != baseline.keys():
        raise reader.refuse(
            "classes-differ", "baseline", f"must have the classes of population: {', '.join(population)}"
        )
    for kind, drivers in population.items():
        for name in ("share", "length", "length_sd"):
            if getattr(drivers, name) != getattr(baseline[kind], name):
                raise reader.refuse(
                    "vehicles-differ", f"baseline.{kind}.{name}", f"must equal population.{kind}.{name}: same vehicles"
                )
    if not isinstance(whole["effects"], list):
        raise reader.refuse("wrong-type", "effects", f"must be a list, [] for none, got {whole['effects']!r}")
    effects = [_effect(reader, value, f"effects[{index}]") for index, value in enumerate(whole["effects"])]
    called = [(effect.name, effect.variable) for effect in effects]
    for index, name in enumerate(called):
        if name in called[:index]:
            raise reader.refuse(
                "effect-twice", f"effects[{index}].name", f"{name[0]} occurs twice: write each effect once"
            )
    return RepairedModel(
        Source(**{name: reader.text(source[name], f"source.{name}") for name in names}),
        population,
        baseline,
        tuple(effects),
        car_following,
        _lane_changing(reader, whole["lane_changing"]) if "lane_changing" in whole else None,
    )


def _lane_changing(reader: _Reader, value: Any) -> LaneChangeValues:
    part = reader.mapping(value, "lane_changing", list(LANE_CHANGE_BOUNDS))
    numbers = {
        name: reader.number(part[name], f"lane_changing.{name}", *bounds) for name, bounds in LANE_CHANGE_BOUNDS.items()
    }
    return LaneChangeValues(**numbers)


def _population(reader: _Reader, value: Any, key: str, model: DriverModel) -> dict[str, DriverClass]:
    classes = reader.mapping(value, key, (CAR,), (TRUCK,))
    drivers_of = {name: _drivers(reader, part, f"{key}.{name}", model) for name, part in classes.items()}
    total = sum(drivers.share for drivers in drivers_of.values())
    if abs(total - 1) > 1e-6:
        raise reader.refuse("shares", key, f"has shares with the sum {total:g}: they must add up to 1")
    return {name: drivers_of[name] for name in (CAR, TRUCK) if name in drivers_of}


def _drivers(reader: _Reader, value: Any, key: str, model: DriverModel) -> DriverClass:
    part = reader.mapping(value, key, [item.name for item in fields(DriverClass)])
    means, names = reader.mapping(part["log_mean"], f"{key}.log_mean", model.names), ", ".join(model.names)
    mean = {
        item.name: reader.number(
            means[item.name], f"{key}.log_mean.{item.name}", math.log(item.low), math.log(item.high)
        )
        for item in model.parameters
    }
    name, rows, size = f"{key}.log_covariance", part["log_covariance"], len(model.names)
    if not isinstance(rows, list) or len(rows) != size:
        raise reader.refuse("wrong-length", name, f"must have {size} rows, in the order {names}")
    covariance = [reader.numbers(row, f"{name}[{index}]", -25.0, 25.0) for index, row in enumerate(rows)]
    if {len(row) for row in covariance} != {size}:
        raise reader.refuse("wrong-length", name, f"must have {size} columns, in the order {names}")
    matrix = np.array(covariance)
    if not np.allclose(matrix, matrix.T, atol=1e-9) or np.linalg.eigvalsh(matrix).min() < -1e-9:
        raise reader.refuse("no-covariance", name, "must be symmetric and positive semidefinite, as a covariance is")
    others = {item: reader.number(part[item], f"{key}.{item}", *bounds) for item, bounds in RANGES.items()}
    return DriverClass(log_mean=mean, log_covariance=covariance, **others)


def _effect(reader: _Reader, value: Any, key: str) -> EffectValues:
    part = reader.mapping(value, key, ("name", "parameters"), ("variable",))
    name = part["name"]
    if not isinstance(name, str) or name not in EFFECTS:
        known = ", ".join(EFFECTS)
        raise reader.refuse(
            "choice-unknown", f"{key}.name", f"is {name!r}; nearest: {nearest(str(name), EFFECTS)}; effects: {known}"
        )
    kind = EFFECTS[name]
    given = reader.mapping(part["parameters"], f"{key}.parameters", [item.name for item in kind.parameters])
    is_curve = "variable" in {item.name for item in fields(kind)}
    parameters = {}
    for item in kind.parameters:
        read = reader.numbers if item.is_list else reader.number
        parameters[item.name] = read(given[item.name], f"{key}.parameters.{item.name}", item.low, item.high)
    variable = part.get("variable")
    if is_curve:
        _check_curve(reader, parameters, variable, key)
    elif variable is not None:
        raise reader.refuse("key-unknown", f"{key}.variable", f"is not used by {name}: leave it out")
    return EffectValues(name, parameters, variable)


def _check_curve(reader: _Reader, parameters: dict[str, Any], variable: Any, key: str) -> None:
    """Raise BadModelError if an effect that is a curve has an unknown variable or unsuitable knots."""
    if not isinstance(variable, str) or variable not in VARIABLES:
        raise reader.refuse(
            "choice-unknown", f"{key}.variable", f"is {variable!r}, but must be one of {', '.join(VARIABLES)}"
        )
    knots = np.array(parameters["knots"])
    steps = np.diff(knots)
    if len(knots) < 2 or len(knots) != len(parameters["values"]):
        raise reader.refuse("wrong-length", f"{key}.parameters.knots", "must be at least two, as many as values")
    if steps.min() <= 0 or not np.allclose(steps, steps[0], rtol=1e-4):
        raise reader.refuse("knots-uneven", f"{key}.parameters.knots", "must rise in equal steps")
