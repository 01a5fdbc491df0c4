"""Keys of the drivers: car-following model, values and spreads of its parameters.

Every module in this folder with a `MODEL` declares one car-following model, chosen by `driver=NAME`; its keys follow
from the declaration. A new model needs one new file here.
"""

import math
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass, fields, make_dataclass
from importlib import import_module
from typing import Any

from rearl_jax.config._key import key, mapping_key
from rearl_jax.config._schema import nearest
from rearl_jax.config.driver.declaration import DriverModel, DriverParameter
from rearl_jax.problems import InvalidInputError, Problem, out_of_range

DEFAULT = "highway_env_idm"
"""The default model of `driver`: highway-env's, with identical results."""

MODELS: dict[str, DriverModel] = {
    model.name: model
    for module in sorted(info.name for info in pkgutil.iter_modules(__path__))
    if isinstance(model := getattr(import_module(f"{__name__}.{module}"), "MODEL", None), DriverModel)
}
"""Every car-following model by its name."""


@dataclass(unsafe_hash=True)
class DriverConfig:
    """Car following, sizes and classes of the drivers."""

    model: str = key(DEFAULT, "car-following model; driver=NAME chooses it")
    classes: dict[str, Any] = mapping_key(
        "additional classes of drivers by name, each with its share of all vehicles and the keys that "
        "differ, as in "
        "'driver.classes={truck: {share: 0.1, time_gap: 1.8, length: 12}}'; all others have the keys below"
    )
    length: float = key(5.0, "mean length of the vehicles [m]; highway-env 1.12.1, Vehicle.LENGTH")
    length_sd: float = key(0.0, "standard deviation of the length between vehicles [m]")
    noise_sd: float = key(0.0, "standard deviation of the acceleration noise of the drivers [m/s^2]; 0 = none")
    noise_time: float = key(
        1.5, "correlation time of the acceleration noise [s]; Treiber, Kesting & Helbing, Physica A 360 (2006) 71"
    )

    @property
    def declaration(self) -> DriverModel:
        """Declaration of the car-following model."""
        return MODELS[self.model]

    @property
    def is_default(self) -> bool:
        """True if all keys have the values of highway-env's drivers."""
        return self == record_of(DEFAULT)()

    @staticmethod
    def record_for(plain: Any, prefix: str = "driver.") -> "type[DriverConfig]":
        """The record class of a model.

        Args:
            plain: Name of the model, or plain keys that name it.
            prefix: Beginning of the full names of the keys.

        Raises:
            ValueError: There is no such model.
        """
        name = plain.get("model", DEFAULT) if isinstance(plain, Mapping) else plain
        if not isinstance(name, str) or name not in MODELS:
            message = f"must be a car-following model, one of {', '.join(MODELS)}"
            raise InvalidInputError(Problem("choice-unknown", message, key=f"{prefix}model", value=name))
        return record_of(name)

    def values(self, class_name: str | None = None) -> dict[str, float | None]:
        """Value of every key of one class of drivers; without a name, of drivers outside all classes."""
        keys_of_class = {} if class_name is None else self.classes[class_name]
        return {name: getattr(self, name) for name in self._names()} | {
            k: v for k, v in keys_of_class.items() if k != "share"
        }

    def check_prior(self) -> None:
        """Raise InvalidInputError if these keys cannot be the prior of a calibration, which itself estimates spreads,
        sizes and noise.
        """
        usual = record_of(self.model)()
        changed = (item.name for item in fields(self) if getattr(self, item.name) != getattr(usual, item.name))
        for name in changed:
            if name not in self.declaration.names:
                message = "is estimated by the calibration: leave it out"
                raise InvalidInputError(Problem("found-by-calibration", message, key=f"driver.{name}"))

    def _names(self) -> list[str]:
        """Names of the keys with a value per class of drivers."""
        return [item.name for item in fields(self) if item.name not in ("model", "classes")]

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its bounds, an unknown key of a class, or shares with a sum above
        1.
        """
        if type(self) is not record_of(self.model):
            message = "must be left out: choose a car-following model with driver=NAME"
            raise InvalidInputError(Problem("driver-keys-of-another", message, key="model", value=self.model))
        known = self._names()
        _check_values(self.values(), self.declaration, "")
        total = 0.0
        for class_name, keys_of_class in self.classes.items():
            place = f"classes.{class_name}"
            if not isinstance(keys_of_class, Mapping) or not isinstance(keys_of_class.get("share"), (int, float)):
                raise out_of_range(
                    place, "must be keys and values with a share, as {share: 0.1, time_gap: 1.8}", keys_of_class
                )
            for name, value in keys_of_class.items():
                if name not in ("share", *known):
                    close = nearest(str(name), ["share", *known])
                    message = f"is not a key of driver={self.model}; nearest: {close}"
                    raise InvalidInputError(Problem("key-unknown", message, key=f"{place}.{name}"))
                if isinstance(value, bool) or not isinstance(value, (int, float)):
                    raise out_of_range(f"{place}.{name}", "must be a number", value)
            if not 0 < keys_of_class["share"] <= 1:
                raise out_of_range(f"{place}.share", "must be within 0 and 1", keys_of_class["share"])
            total += keys_of_class["share"]
            _check_values(self.values(class_name), self.declaration, f"{place}.")
        if total > 1 + 1e-9:
            raise out_of_range("classes", "must have shares with a sum of at most 1", f"{total:g}")


def _check_values(values: Mapping[str, float | None], model: DriverModel, place: str) -> None:
    """Raise InvalidInputError for a value outside its bounds; `place` is the beginning of its key in the message."""
    for parameter in model.parameters:
        value, sd = values[parameter.name], values[f"{parameter.name}_sd"]
        if value is not None and not parameter.low <= value <= parameter.high:
            bounds = f"must be within {parameter.low:g} and {parameter.high:g} {parameter.unit}"
            raise out_of_range(f"{place}{parameter.name}", bounds, value)
        if sd is None or not 0 <= sd < math.inf:
            raise out_of_range(f"{place}{parameter.name}_sd", "must be at least 0 and finite", sd)
        if sd > 0 and value is None:
            message = f"needs {place}{parameter.name} as well"
            raise InvalidInputError(Problem("key-missing", message, key=f"{place}{parameter.name}_sd={sd:g}"))
    for name, low, high in (("length", 1.0, 40.0), ("length_sd", 0, 10), ("noise_sd", 0, 3), ("noise_time", 0.05, 60)):
        value = values[name]
        if value is None or not low <= value <= high:
            raise out_of_range(f"{place}{name}", f"must be within {low:g} and {high:g}", value)


def record_of(name: str) -> type[DriverConfig]:
    """The configuration record of a model."""
    return _RECORDS[name]


def _record(model: DriverModel) -> type[DriverConfig]:
    """DriverConfig with two more keys per parameter of the model: its value, and its spread between drivers."""

    def keys_of(parameter: DriverParameter) -> list[tuple]:
        unit = "" if parameter.unit == "-" else f" [{parameter.unit}]"
        kind = float if parameter.usual is not None else float | None
        value = key(parameter.usual, f"{parameter.meaning}{unit}; {parameter.source}")
        spread = key(0.0, f"standard deviation of {parameter.name} between drivers{unit}, log-normal; 0 = all alike")
        return [(parameter.name, kind, value), (f"{parameter.name}_sd", float, spread)]

    model_key = [("model", str, key(model.name, DriverConfig.__dataclass_fields__["model"].metadata["help"]))]
    items = model_key + [item for parameter in model.parameters for item in keys_of(parameter)]
    record = make_dataclass(f"{model.name}_driver", items, bases=(DriverConfig,), unsafe_hash=True)
    record.__doc__, record.__module__ = f"{model.title}; {model.source}.", __name__
    globals()[record.__name__] = record  # pickle looks the class up here
    return record


_RECORDS = {name: _record(model) for name, model in MODELS.items()}
