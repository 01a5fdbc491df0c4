"""Vehicle types of SUMO as a population of drivers: means, spreads and correlations by class of vehicles."""

import math
from collections.abc import Sequence

import numpy as np

from rearl_jax.config.driver import MODELS as DECLARED
from rearl_jax.config.driver import record_of
from rearl_jax.config.driver.declaration import DriverParameter
from rearl_jax.export.sumo import MODELS, UNUSED_TERMS, from_sumo
from rearl_jax.export.translations import Translation
from rearl_jax.export.vehicle_types import VehicleType
from rearl_jax.models.record import CAR, TRUCK, DriverClass

OUR_MODELS = {sumo.name: name for name, sumo in MODELS.items()}
"""This package's car-following model by SUMO's name of it."""

ROUNDING_TOLERANCE = 1e-6
"""Relative difference [-] of two numbers below which they count as equal, because files round them."""

_UNREAD = {
    "delta": "the exponent is 4 here",
    "sigma": "no dawdling here; driver.noise_sd is another noise",
    "actionStepLength": "a time step, not a delay; the effect reaction_delay with half of it is similar",
    "emergencyDecel": "9 m/s^2 here",
    "speedFactor": "needs sumo.speed_limit",
    "speedDev": "needs sumo.speed_limit",
}
"""Why attributes have no counterpart, if their values differ from `NEUTRAL_VALUES`."""

NEUTRAL_VALUES = {"delta": 4.0, "sigma": 0.0, "emergencyDecel": 9.0, "speedFactor": 1.0, "speedDev": 0.0}
NEUTRAL_VALUES |= {attribute: float(value) for attribute, value in UNUSED_TERMS.items()}
"""Values of attributes that have no influence, so that leaving them out loses nothing."""


def population_of_types(
    types: Sequence[VehicleType], speed_limit: float | None
) -> tuple[str, dict[str, DriverClass], list[Translation]]:
    """Name of the car-following model, drivers by class, and the translation of each attribute.

    Args:
        types: The types, which share one car-following model.
        speed_limit: Limit of the roads [m/s], which speedFactor multiplies; None for the largest speed alone.

    Raises:
        InvalidInputError: The types have several models or one without counterpart, a value is outside the bounds of
            its parameter, or all are trucks.
    """
    name = _model(types)
    rows = [_driver(vehicle_type, name, speed_limit) for vehicle_type in types]
    kinds = np.array([vehicle_type.vehicle_class.kind for vehicle_type in types])
    weights = np.array([vehicle_type.weight for vehicle_type in types])
    if weights.sum() <= 0 or not weights[kinds == CAR].sum() > 0:
        raise types[0].refuse("cars-missing", "no type with a probability is a car", "add one", "vClass")
    classes = {}
    for kind in (CAR, TRUCK):
        is_member = (kinds == kind) & (weights > 0)
        if is_member.any():
            members = [rows[k] for k in np.flatnonzero(is_member)]
            total = weights[is_member].sum()
            classes[kind] = _class(members, name, weights[is_member] / total, total / weights.sum())
    return name, classes, _translations(types, name, speed_limit)


def _model(types: Sequence[VehicleType]) -> str:
    """This package's name of the types' model; InvalidInputError for several, or for one without counterpart."""
    models = sorted({vehicle_type.model for vehicle_type in types})
    if len(models) > 1:
        fault = f"differs between types: {', '.join(models)}; a population has one"
        raise types[0].refuse("models-several", fault, "choose types of one with sumo.types", "carFollowModel")
    if models[0] not in OUR_MODELS:
        fault = f"is {models[0]}, whose equation no model here has"
        raise types[0].refuse("equation-unknown-here", fault, f"use one of {', '.join(OUR_MODELS)}", "carFollowModel")
    return OUR_MODELS[models[0]]


def _driver(vehicle_type: VehicleType, name: str, speed_limit: float | None) -> dict[str, tuple[float, float]]:
    """Value and standard deviation of every parameter, and of the length, by name."""
    defaults = vehicle_type.vehicle_class
    values = {"length": vehicle_type.number("length", defaults.length)}
    for parameter in DECLARED[name].parameters:
        attributes = MODELS[name].attributes[parameter.name]
        read = [vehicle_type.number(attribute, getattr(defaults, attribute, None)) for attribute in attributes]
        if any(not math.isclose(value, read[0][0], rel_tol=ROUNDING_TOLERANCE) for value, _ in read):
            fault = f"differs from {' and '.join(attributes[1:])}: here one gain serves all modes of following"
            raise vehicle_type.refuse("gains-differ", fault, "give them one value, or use another model", attributes[0])
        value, sd = read[0]
        value = from_sumo(value, attributes[0], MODELS[name])
        if parameter.name == "desired_speed":
            value, sd = _desired_speed(vehicle_type, value, sd, speed_limit)
        values[parameter.name] = _in_bounds(vehicle_type, name, parameter, value), sd
    return values


def _desired_speed(
    vehicle_type: VehicleType, max_speed: float, sd: float, speed_limit: float | None
) -> tuple[float, float]:
    """Desired speed [m/s] and its standard deviation: the smaller of maxSpeed and speedFactor times the limit."""
    if speed_limit is None:
        if "maxSpeed" not in vehicle_type.attributes:
            fault = "is missing, and so is the limit of the roads"
            raise vehicle_type.refuse("attribute-missing", fault, "set sumo.speed_limit=METRES_PER_SECOND", "maxSpeed")
        return max_speed, sd
    factor, deviation = vehicle_type.number("speedFactor", 1.0)
    if "(" not in vehicle_type.attributes.get("speedFactor", ""):
        deviation, _ = vehicle_type.number("speedDev", vehicle_type.vehicle_class.speedDev)
    return (max_speed, sd) if max_speed < factor * speed_limit else (factor * speed_limit, deviation * speed_limit)


def _in_bounds(vehicle_type: VehicleType, name: str, parameter: DriverParameter, value: float) -> float:
    """The value of a parameter; InvalidInputError outside of its bounds."""
    if not parameter.low <= value <= parameter.high:
        fault = f"gives {parameter.name} = {value:g}, which must be within {parameter.low:g} and {parameter.high:g}"
        remedy = "correct it, or leave the type out with sumo.types"
        raise vehicle_type.refuse("out-of-range", fault, remedy, MODELS[name].attributes[parameter.name][0])
    return value


def _class(
    members: Sequence[dict[str, tuple[float, float]]], name: str, weights: np.ndarray, share: float
) -> DriverClass:
    """Weighted means and covariance of the logarithms; a spread within a type adds to that between types.

    Args:
        members: Value and standard deviation of every parameter, for each type of the class.
        name: Name of the car-following model.
        weights: Weight of each type; their sum is 1.
        share: Share of the class in all vehicles [-].
    """
    names = DECLARED[name].names
    # 0: value, 1: standard deviation.
    values, deviations = (np.array([[member[key][k] for key in names] for member in members]) for k in (0, 1))
    within = np.log1p((deviations / values) ** 2)
    logs = np.log(values) - within / 2  # the file states means, not medians
    mean = weights @ logs
    deviation = logs - mean
    covariance = (weights[:, None] * deviation).T @ deviation + np.diag(weights @ within)
    lengths, length_sd = (np.array([member["length"][k] for member in members]) for k in (0, 1))
    length = float(weights @ lengths)
    defaults = record_of(name)()
    return DriverClass(
        share=float(share),
        log_mean=dict(zip(names, mean.tolist(), strict=True)),
        log_covariance=((covariance + covariance.T) / 2).tolist(),
        noise_sd=defaults.noise_sd,
        noise_time=defaults.noise_time,
        length=length,
        length_sd=float(np.sqrt(weights @ ((lengths - length) ** 2 + length_sd**2))),
    )


def _translations(types: Sequence[VehicleType], name: str, speed_limit: float | None) -> list[Translation]:
    """Translation of each attribute of the file, and of those that it leaves to SUMO's defaults."""
    targets = {
        attribute: parameter for parameter, attributes in MODELS[name].attributes.items() for attribute in attributes
    }
    targets |= {"length": "length", "vClass": "class of vehicles", "carFollowModel": f"car_following {name}"}
    if speed_limit is not None:
        targets |= {"speedFactor": "desired_speed", "speedDev": "desired_speed"}
    found = []
    for attribute, target in targets.items():
        left = sum(attribute not in vehicle_type.attributes for vehicle_type in types)
        found.append(Translation(attribute, target, f"SUMO's default for {left} of {len(types)} types" if left else ""))
    others = dict.fromkeys(
        attribute for vehicle_type in types for attribute in vehicle_type.attributes if attribute not in targets
    )
    if MODELS[name].is_extended:
        others |= dict.fromkeys(UNUSED_TERMS)  # also where the file leaves them to SUMO, which does not leave them out
    return found + [_unread(attribute, types) for attribute in others]


def _unread(attribute: str, types: Sequence[VehicleType]) -> Translation:
    """An attribute without counterpart; nothing is lost where all types that state it have its neutral value, and all
    types state it if it is one of UNUSED_TERMS.
    """
    stated = [vehicle_type.attributes[attribute] for vehicle_type in types if attribute in vehicle_type.attributes]
    neutral = NEUTRAL_VALUES.get(attribute)
    is_open = attribute in UNUSED_TERMS and len(stated) < len(types)
    if neutral is not None and not is_open and all(_is_number(text, neutral) for text in stated):
        return Translation(attribute, f"is {neutral:g} here")
    return Translation(attribute, None, _UNREAD.get(attribute, "has no counterpart in a population of drivers"))


def _is_number(text: str, number: float) -> bool:
    try:
        return float(text) == number
    except ValueError:
        return False
