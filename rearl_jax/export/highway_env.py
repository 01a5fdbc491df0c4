"""Drivers as attributes of highway-env's `IDMVehicle`, one mapping per driver, as JSON.

    for name, value in driver.items():
        setattr(vehicle, name, value)

Source: highway-env 1.12.1, `vehicle/behavior.py` (IDMVehicle).
"""

import json

import numpy as np

from rearl_jax.config.driver import DEFAULT
from rearl_jax.core.car_following.highway_env_idm import VEHICLE_LENGTH
from rearl_jax.export.drawn import DriverColumns, draw
from rearl_jax.export.translations import Exported, Translation, untranslated_effects
from rearl_jax.models.population import Population
from rearl_jax.problems import InvalidInputError, Problem

ATTRIBUTES = {
    "desired_speed": "target_speed",
    "time_gap": "TIME_WANTED",
    "jam_gap": "DISTANCE_WANTED",
    "max_accel": "COMFORT_ACC_MAX",
    "comfort_decel": "COMFORT_ACC_MIN",
    "accel_exponent": "DELTA",
}
"""Attribute of an `IDMVehicle` that holds each parameter."""

LANE_CHANGING = {
    "politeness": "POLITENESS",
    "gain_threshold": "LANE_CHANGE_MIN_ACC_GAIN",
    "safe_decel": "LANE_CHANGE_MAX_BRAKING_IMPOSED",
    "delay": "LANE_CHANGE_DELAY",
}
"""Attribute that holds each parameter of MOBIL."""

PUBLISHED_IDM = "idm"
"""The published IDM, which differs from highway-env's by its gaps."""

_CENTRES = (
    "highway-env measures from centre to centre: the same gap in steady following, but a weaker answer to a short one"
)


def to_highway_env(population: Population, n_drivers: int, seed: int) -> Exported:
    """A JSON list of drivers drawn from a population, each an object of attributes of `IDMVehicle`.

    The population is as of `models.population.population_of_model`.

    Raises:
        InvalidInputError: The drivers have another car-following model than IDM.
    """
    if population.car_following not in (DEFAULT, PUBLISHED_IDM):
        raise InvalidInputError(
            Problem(
                "equation-unknown-there",
                "has another equation than highway-env's IDM",
                f"calibrate {PUBLISHED_IDM} or {DEFAULT}, or choose another target",
                key="car_following",
                value=population.car_following,
            )
        )
    drawn = draw(population, n_drivers, seed)
    drivers = [_attributes(drawn, number) | _lane_changing(population) for number in range(n_drivers)]
    return Exported(json.dumps(drivers, indent=1) + "\n", tuple(_translations(population, drawn)))


def _attributes(drawn: DriverColumns, number: int) -> dict[str, float]:
    """Attributes of one driver of those drawn, as highway-env defines them."""
    values = {name: float(column[number]) for name, column in drawn.values.items()}
    attributes = {ATTRIBUTES[name]: value for name, value in values.items() if np.isfinite(value)}
    attributes["DISTANCE_WANTED"] += VEHICLE_LENGTH
    attributes["COMFORT_ACC_MIN"] *= -1
    if drawn.car_following == PUBLISHED_IDM:
        attributes["DELTA"] = 4.0
    return {name: float(f"{value:.6g}") for name, value in attributes.items()}


def _lane_changing(population: Population) -> dict[str, float]:
    """Attributes of MOBIL; none if the population does not state it."""
    mobil = population.lane_changing
    if mobil is None:
        return {}
    return {attribute: float(f"{float(getattr(mobil, name)):.6g}") for name, attribute in LANE_CHANGING.items()}


def _translations(population: Population, drawn: DriverColumns) -> list[Translation]:
    """Counterpart in highway-env of each part of the model."""
    has_other_gaps = drawn.car_following == PUBLISHED_IDM
    parts = [Translation(f"car_following {drawn.car_following}", "IDMVehicle", _CENTRES if has_other_gaps else "")]
    parts += [Translation(name, ATTRIBUTES[name], "plus 5 m" if name == "jam_gap" else "") for name in drawn.values]
    parts += [Translation(name, None, "highway-env draws it with each vehicle") for name in population.drawn]
    if population.lane_changing is not None:
        parts += [Translation(f"lane_changing {name}", attribute) for name, attribute in LANE_CHANGING.items()]
    parts += untranslated_effects((effect.name for effect in population.effects), "highway-env")
    if population.is_noisy:
        parts.append(Translation("noise_sd, noise_time", None, "highway-env's drivers have no noise"))
    if population.is_resized:
        parts.append(Translation("length, class of vehicles", None, "all vehicles of highway-env are 5 m long"))
    return parts
