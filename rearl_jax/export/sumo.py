"""Drivers as SUMO's vehicle types: one `vTypeDistribution` of types drawn from a population.

Each type is one driver with all its parameters, so the correlations between them are kept. Only car-following models
whose equation SUMO has are written.

Sources: SUMO 1.28, "Definition of Vehicles, Vehicle Types, and Routes" (attributes) and the sources of `MSCFModel_IDM`,
`MSCFModel_Krauss`, `MSCFModel_ACC` (equations).
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.effects.perception import ReactionDelay
from rearl_jax.core.following import HARDEST_ACCELERATION, HARDEST_BRAKING
from rearl_jax.export.drawn import DriverColumns, draw
from rearl_jax.export.said import Exported, Said, unsaid_effects
from rearl_jax.models.population import Population
from rearl_jax.problems import InvalidInputError, Problem

DISTRIBUTION = "drivers"
"""Id of the distribution; the types in it are called `drivers_0`, `drivers_1`, ..."""

SETPOINTS = {"desired_speed": ("maxSpeed",), "time_gap": ("tau",), "jam_gap": ("minGap",)}
"""Attributes of the parameters that every model has."""

_BOUNDS = {"max_accel": ("accel",), "comfort_decel": ("decel",)}


@dataclass(frozen=True)
class SumoModel:
    """A car-following model of SUMO.

    Attributes:
        name: Value of `carFollowModel`.
        attributes: Attributes that hold each parameter of ours.
        fixed: Further attributes, the same for all drivers.
        remarks: Differences between the two, by parameter or `equation`.
    """

    name: str
    attributes: Mapping[str, tuple[str, ...]]
    fixed: Mapping[str, str]
    remarks: Mapping[str, str]


MODELS = {
    "idm": SumoModel("IDM", SETPOINTS | _BOUNDS, {"delta": "4"}, {}),
    "krauss": SumoModel(
        "Krauss",
        SETPOINTS | _BOUNDS,
        {"sigma": "0"},
        {
            "equation": "SUMO takes the safe speed within one step, this model approaches it within a time T",
            "comfort_decel": "of the leader's braking SUMO takes the leader's value, this model the follower's",
        },
    ),
    "constant_time_headway": SumoModel(
        "ACC",
        SETPOINTS
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
"""SUMO's model with the same equation, by our name."""

_NO_LANE_CHANGES = "SUMO's lane changing has no politeness, gain and braking of MOBIL: its defaults act"


def to_sumo(population: Population, n_types: int, seed: int) -> Exported:
    """A SUMO additional file with a distribution of vehicle types, drawn from a population with equal probability.

    Args:
        population: The drivers, as of `models.population.population_of_model`.
        n_types: Number of types.
        seed: Seed of the draw.

    Raises:
        InvalidInputError: SUMO has no car-following model with this equation.
    """
    model = sumo_model(population.car_following)
    drivers = type_attributes(draw(population, n_types, seed), population.effects)
    types = {f"{DISTRIBUTION}_{number}": {"probability": "1", **own} for number, own in enumerate(drivers)}
    text = sumo_file(types, DISTRIBUTION)
    return Exported(text, tuple(_said(population, model)))


def sumo_file(types: Mapping[str, Mapping[str, str]], distribution: str | None = None) -> str:
    """Content of an additional file with vehicle types.

    Args:
        types: Attributes of each type by its id.
        distribution: Id of the distribution that they form; None for none.
    """
    root = ET.Element("additional")
    parent = root if distribution is None else ET.SubElement(root, "vTypeDistribution", id=distribution)
    for name, attributes in types.items():
        ET.SubElement(parent, "vType", {"id": name, **attributes})
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def sumo_model(car_following: str) -> SumoModel:
    """SUMO's model with the equation of ours.

    Raises:
        InvalidInputError: There is none.
    """
    if car_following not in MODELS:
        raise InvalidInputError(
            Problem(
                "equation-unknown-there",
                "has an equation that no car-following model of SUMO has",
                f"calibrate one of {', '.join(MODELS)}, or choose another target",
                key="car_following",
                value=car_following,
            )
        )
    return MODELS[car_following]


def type_attributes(drivers: DriverColumns, effects: tuple[Effect, ...]) -> list[dict[str, str]]:
    """Attributes of one vehicle type per driver, without id and probability.

    Args:
        drivers: The drivers.
        effects: Effects on them, of which a reaction delay becomes `actionStepLength`.
    """
    model = sumo_model(drivers.car_following)
    same = {
        "carFollowModel": model.name,
        **model.fixed,
        "emergencyDecel": f"{-HARDEST_BRAKING:g}",
        "speedFactor": "1",
        "speedDev": "0",
    }
    delay = reaction_delay(effects)
    if delay > 0:
        same["actionStepLength"] = _number(ACTION_STEPS_PER_DELAY * delay)
    return [
        {
            **same,
            "vClass": "truck" if drivers.is_truck[k] else "passenger",
            "length": _number(drivers.length[k]),
            **{
                attribute: _number(-values[k] if attribute == "speedControlGain" else values[k])
                for name, values in drivers.values.items()
                for attribute in model.attributes[name]
            },
        }
        for k in range(len(drivers))
    ]


ACTION_STEPS_PER_DELAY = 2.0
"""`actionStepLength` over the reaction delay [-]: what a driver acts on is between nothing and one action step old,
half of one on average.
"""


def reaction_delay(effects: tuple[Effect, ...]) -> float:
    """Mean of both delays of the effect `reaction_delay` [s]; 0 without it."""
    delays = [
        float(np.mean([effect.delay, effect.own_delay])) for effect in effects if isinstance(effect, ReactionDelay)
    ]
    return sum(delays)


def _said(population: Population, model: SumoModel) -> list[Said]:
    said = [Said(f"car_following {population.car_following}", model.name, model.remarks.get("equation", ""))]
    said += [
        Said(name, ", ".join(attributes), model.remarks.get(name, "")) for name, attributes in model.attributes.items()
    ]
    said += [Said("length", "length"), Said("class of vehicles", "vClass")]
    delayed = [effect for effect in population.effects if isinstance(effect, ReactionDelay)]
    for effect in delayed:
        if reaction_delay((effect,)) > 0:
            remark = "not a delay: drivers act in steps of twice its length, on what is half of a step old on average"
            said.append(Said(effect.name, "actionStepLength", remark))
        else:
            said += unsaid_effects([effect.name], "SUMO")
    said += unsaid_effects(
        (effect.name for effect in population.effects if not isinstance(effect, ReactionDelay)), "SUMO"
    )
    if population.is_noisy:
        said.append(Said("noise_sd, noise_time", None, "SUMO's sigma only slows drivers down"))
    return [*said, Said("lane changing", None, _NO_LANE_CHANGES)]


def _number(value: float) -> str:
    return f"{value:.6g}"
