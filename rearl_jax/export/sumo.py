"""Drivers as SUMO's vehicle types: one `vTypeDistribution` of types drawn from a population.

Each type is one driver with all its parameters, so the correlations between them are kept. Only car-following models
whose equation SUMO has are written.

Sources: SUMO 1.28, "Definition of Vehicles, Vehicle Types, and Routes" (attributes) and the sources of `MSCFModel_IDM`,
`MSCFModel_EIDM`, `MSCFModel_Krauss`, `MSCFModel_ACC` (equations).
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.effects.noise import PerceptionNoise
from rearl_jax.core.effects.perception import ReactionDelay
from rearl_jax.core.following import HARDEST_ACCELERATION, HARDEST_BRAKING
from rearl_jax.export.drawn import DriverColumns, draw
from rearl_jax.export.translations import Exported, Translation, untranslated_effects
from rearl_jax.models.population import Population
from rearl_jax.problems import InvalidInputError, Problem

DISTRIBUTION = "drivers"
"""Id of the distribution; the types in it are called `drivers_0`, `drivers_1`, ..."""

COMMON_ATTRIBUTES = {"desired_speed": ("maxSpeed",), "time_gap": ("tau",), "jam_gap": ("minGap",)}
"""Attributes that hold the parameters of every model."""

_ACCELERATION_ATTRIBUTES = {"max_accel": ("accel",), "comfort_decel": ("decel",)}


@dataclass(frozen=True)
class SumoModel:
    """A car-following model of SUMO.

    Attributes:
        name: Value of `carFollowModel`.
        attributes: Attributes that hold each parameter of this package's model.
        fixed: Further attributes, the same for all drivers.
        remarks: Differences from this package's model, by parameter or `equation`.
        is_extended: Whether it has further terms: a gap beyond `minGap`, noise of perception.
    """

    name: str
    attributes: Mapping[str, tuple[str, ...]]
    fixed: Mapping[str, str]
    remarks: Mapping[str, str]
    is_extended: bool = False


UNUSED_TERMS = {"ccoolness": "0", "sigmagap": "0", "sigmaleader": "0", "sigmaerror": "0", "treaction": "0"}
"""Attributes of EIDM's further terms, with the values at which these do nothing."""

MODELS = {
    "idm": SumoModel("IDM", COMMON_ATTRIBUTES | _ACCELERATION_ATTRIBUTES, {"delta": "4"}, {}),
    "improved_idm": SumoModel(
        "EIDM",
        COMMON_ATTRIBUTES | _ACCELERATION_ATTRIBUTES,
        {"delta": "4", **UNUSED_TERMS},
        {
            "equation": "from rest, SUMO's drivers start in their own way; terms that are not used are 0",
            "jam_gap": "less .3 m, which SUMO adds; at least .25 m",
        },
        is_extended=True,
    ),
    "krauss": SumoModel(
        "Krauss",
        COMMON_ATTRIBUTES | _ACCELERATION_ATTRIBUTES,
        {"sigma": "0"},
        {
            "equation": "SUMO takes the safe speed within one step, this model approaches it within a time T",
            "comfort_decel": "of the leader's braking SUMO takes the leader's value, this model the follower's",
        },
    ),
    "constant_time_headway": SumoModel(
        "ACC",
        COMMON_ATTRIBUTES
        | {
            "gap_gain": ("gapControlGainSpace", "gapClosingControlGainSpace", "collisionAvoidanceGainSpace"),
            "approach_gain": ("gapControlGainSpeed", "gapClosingControlGainSpeed", "collisionAvoidanceGainSpeed"),
            "speed_gain": ("speedControlGain",),
        },
        {"accel": f"{HARDEST_ACCELERATION:g}", "decel": f"{-HARDEST_BRAKING:g}"},
        {
            "equation": "SUMO follows below a gap of 100 m and controls the speed alone above 120 m",
            "jam_gap": "SUMO adds 2 m below 10.8 m/s, less above, nothing from 15 m/s on",
            "speed_gain": "the desired speed is a bound while following",
        },
    ),
}
"""SUMO's model with the same equation, by this package's name."""

EXTENDED = {
    "idm": replace(
        MODELS["improved_idm"],
        remarks={
            **MODELS["improved_idm"].remarks,
            "equation": "the improved IDM, which keeps s0 + T v up to the desired speed; terms that are not used are 0",
        },
    ),
    "improved_idm": MODELS["improved_idm"],
}
"""SUMO's model with the equation and further terms, by this package's name.

Source: Salles, Kaufmann & Reuss, "Extending the Intelligent Driver Model in SUMO and Verifying the Drive Off
Trajectories with Aerial Measurements" (2020).
"""

ADDED_GAP = 0.3
"""Distance [m] that EIDM keeps beyond `minGap`: .25 m subtracted from the gap, .05 m added to
the desired gap.
"""

MIN_GAP = 0.25
"""Least `minGap` [m] with which EIDM uses the true gap."""

UNITS_PER_SD = 2.0
"""`sigmagap` and `sigmaleader` per standard deviation: EIDM's processes have a standard deviation of .5."""

_NO_LANE_CHANGES = "SUMO's lane changing has no politeness, gain and braking of MOBIL: its defaults act"


def to_sumo(population: Population, n_types: int, seed: int, *, extended: bool = False) -> Exported:
    """A SUMO additional file with a distribution of vehicle types, drawn from a population with equal probability.

    The population is as of `models.population.population_of_model`; `extended` takes SUMO's model with further terms.

    Raises:
        InvalidInputError: SUMO has no car-following model with this equation.
    """
    model = sumo_model(population.car_following, extended=extended)
    drivers = type_attributes(draw(population, n_types, seed), population.effects, extended=extended)
    types = {
        f"{DISTRIBUTION}_{number}": {"probability": "1", **attributes} for number, attributes in enumerate(drivers)
    }
    text = sumo_file(types, DISTRIBUTION)
    return Exported(text, tuple(_translations(population, model)))


def sumo_file(types: Mapping[str, Mapping[str, str]], distribution: str | None = None) -> str:
    """Content of an additional file: vehicle types, attributes by id, in a distribution if its id is given."""
    root = ET.Element("additional")
    parent = root if distribution is None else ET.SubElement(root, "vTypeDistribution", id=distribution)
    for name, attributes in types.items():
        ET.SubElement(parent, "vType", {"id": name, **attributes})
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def sumo_model(car_following: str, *, extended: bool = False) -> SumoModel:
    """SUMO's model with the equation of one of this package's models, or its extension by further terms.

    Raises:
        InvalidInputError: SUMO has none.
    """
    models = EXTENDED if extended else MODELS
    if car_following not in models:
        extension = " with further terms" if extended else ""
        raise InvalidInputError(
            Problem(
                "equation-unknown-there",
                f"has an equation that no car-following model of SUMO{extension} has",
                f"calibrate one of {', '.join(models)}, or choose another target",
                key="car_following",
                value=car_following,
            )
        )
    return models[car_following]


def type_attributes(
    drivers: DriverColumns, effects: tuple[Effect, ...], *, extended: bool = False
) -> list[dict[str, str]]:
    """Attributes of one vehicle type per driver, without id and probability.

    Args:
        drivers: The drivers.
        effects: Effects on them: a reaction delay becomes `actionStepLength`, noise of perception becomes terms of an
            extended model.
        extended: Whether to take SUMO's model with further terms.
    """
    model = sumo_model(drivers.car_following, extended=extended)
    common = {
        "carFollowModel": model.name,
        **model.fixed,
        "emergencyDecel": f"{-HARDEST_BRAKING:g}",
        "speedFactor": "1",
        "speedDev": "0",
    }
    for effect in effects:
        common |= _effect_attributes(effect, model)
    return [
        {
            **common,
            "vClass": "truck" if drivers.is_truck[k] else "passenger",
            "length": _number(drivers.length[k]),
            **{
                attribute: _number(in_sumo(values[k], attribute, model))
                for name, values in drivers.values.items()
                for attribute in model.attributes[name]
            },
        }
        for k in range(len(drivers))
    ]


ACTION_STEPS_PER_DELAY = 2.0
"""`actionStepLength` over the reaction delay [-]: what a driver reacts to is between zero and one action step old,
half a step on average.
"""


def _effect_attributes(effect: Effect, model: SumoModel) -> dict[str, str]:
    """Attributes that hold an effect; none if the model has no such term.

    A reaction delay is the mean of its two delays, and is written if positive.
    """
    if isinstance(effect, ReactionDelay) and not model.is_extended:
        delay = float(np.mean([effect.delay, effect.own_delay]))
        return {"actionStepLength": _number(ACTION_STEPS_PER_DELAY * delay)} if delay > 0 else {}
    if isinstance(effect, PerceptionNoise) and model.is_extended:
        gap, rate, time = (float(np.mean(value)) for value in (effect.gap_error, effect.rate_error, effect.time))
        attributes = {"sigmagap": UNITS_PER_SD * gap, "sigmaleader": UNITS_PER_SD * rate, "tPersEstimate": time}
        return {attribute: _number(value) for attribute, value in attributes.items()}
    return {}


_EFFECT_REMARKS = {
    ReactionDelay.name: "not a delay: drivers act in steps of twice its length, on what is half of a step old on "
    "average",
    PerceptionNoise.name: "only above 3 m/s, where SUMO lets the errors change",
}


def in_sumo(value: float, attribute: str, model: SumoModel) -> float:
    """A parameter in SUMO's definition."""
    if attribute == "speedControlGain":
        return -value  # SUMO's gain acts on the speed's excess
    if attribute == "minGap" and model.is_extended:
        return max(value - ADDED_GAP, MIN_GAP)
    return value


def from_sumo(value: float, attribute: str, model: SumoModel) -> float:
    """A parameter from its value in SUMO's definition, the inverse of `in_sumo`."""
    if attribute == "speedControlGain":
        return -value
    return value + ADDED_GAP if attribute == "minGap" and model.is_extended else value


def _translations(population: Population, model: SumoModel) -> list[Translation]:
    """Counterpart in SUMO of each part of the model."""
    parts = [Translation(f"car_following {population.car_following}", model.name, model.remarks.get("equation", ""))]
    parts += [
        Translation(name, ", ".join(attributes), model.remarks.get(name, ""))
        for name, attributes in model.attributes.items()
    ]
    parts += [Translation("length", "length"), Translation("class of vehicles", "vClass")]
    for effect in population.effects:
        attributes = _effect_attributes(effect, model)
        if attributes:
            parts.append(Translation(effect.name, ", ".join(attributes), _EFFECT_REMARKS[effect.name]))
        else:
            parts += untranslated_effects([effect.name], "SUMO")
    if population.is_noisy:
        parts.append(Translation("noise_sd, noise_time", None, "SUMO's sigma only slows drivers down"))
    return [*parts, Translation("lane changing", None, _NO_LANE_CHANGES)]


def _number(value: float) -> str:
    return f"{value:.6g}"
