"""Drivers of the rows of the budget, from a repaired model whose parts are switched on and off.

All rows with calibrated drivers have the same effects; those that a row lacks have strength 0. So the rows share one
compiled program and the same random numbers.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from rearl_jax.config.budget import FOUND, LANE_CHANGES, VARIATION
from rearl_jax.config.core import CoreConfig
from rearl_jax.config.mobil import MobilConfig
from rearl_jax.core.effects import EFFECTS
from rearl_jax.core.effects.lane_changes import KeepRight, Politeness
from rearl_jax.models.population import Population, lane_changing_values, population_of_model
from rearl_jax.models.record import EffectValues, RepairedModel
from rearl_jax.study.budget.components import Row


def components_of(model: RepairedModel) -> dict[str, bool]:
    """Components besides calibrated drivers, and whether a model has them."""
    is_noisy = any(drivers.noise_sd > 0 for drivers in model.population.values())
    return {
        FOUND: any(not is_random(effect) for effect in model.effects),
        LANE_CHANGES: model.lane_changing is not None,
        VARIATION: is_noisy or any(is_random(effect) for effect in model.effects),
    }


def is_random(effect: EffectValues) -> bool:
    """True if an effect varies a driver over time, as `time_gap_variation` does."""
    return EFFECTS[effect.name].kind == "random"


def drivers_of(model: RepairedModel, row: Row, core: CoreConfig) -> Population:
    """Drivers of a row.

    Rows without the effects that discovery found have the drivers calibrated without effects. Acceleration noise
    belongs to the variation within drivers: rows with it have the noise that was estimated with the effects.

    Args:
        model: The model.
        row: Components of the row, calibrated drivers among them.
        core: Clock and floating type of the simulation.
    """
    dtype = np.dtype(core.dtype.name)
    classes = model.population if FOUND in row else model.baseline
    noise = {name: (drivers.noise_sd, drivers.noise_time) for name, drivers in model.population.items()}
    classes = {
        name: replace(drivers, noise_sd=noise[name][0], noise_time=noise[name][1]) for name, drivers in classes.items()
    }
    population = population_of_model(
        replace(model, population=classes, effects=tuple(_effects(model, row)), lane_changing=None),
        dtype,
        with_effects=True,
        lane_changing=None
        if model.lane_changing is None
        else lane_changing_values(_mobil(model, row), dtype, core.ticks_per_second),
        ticks_per_second=core.ticks_per_second,
    )
    if VARIATION in row:
        return population
    # Columns of the noise: standard deviation and correlation time.
    return replace(population, noise=np.asarray(population.noise) * np.array([[0, 1]], dtype))


def _effects(model: RepairedModel, row: Row) -> Iterable[EffectValues]:
    """Effects of a model, switched off where the row lacks them, and `keep_right` with the calibrated bias."""
    bias = 0.0 if model.lane_changing is None or LANE_CHANGES not in row else model.lane_changing.bias
    has_bias = False
    for effect in model.effects:
        is_on = (VARIATION if is_random(effect) else FOUND) in row
        if effect.name == KeepRight.name and not is_on:
            yield EffectValues(effect.name, dict(effect.parameters) | {"bias": bias})
        else:
            yield effect if is_on else switched_off(effect)
        has_bias |= effect.name == KeepRight.name
    if model.lane_changing is not None and not has_bias:
        yield EffectValues(KeepRight.name, {"bias": bias})


def switched_off(effect: EffectValues) -> EffectValues:
    """The effect with every strength at its value without influence."""
    parameters = dict(effect.parameters)
    for parameter in EFFECTS[effect.name].parameters:
        if parameter.is_strength and parameter.name in parameters:
            old, off = parameters[parameter.name], parameter.off
            parameters[parameter.name] = off if isinstance(old, (int, float)) else [off] * len(old)
    return EffectValues(effect.name, parameters, effect.variable)


def _mobil(model: RepairedModel, row: Row) -> MobilConfig:
    """Parameters of lane changes: the model's or highway-env's; politeness 0 beside an effect on politeness."""
    calibrated = model.lane_changing
    if calibrated is None or LANE_CHANGES not in row:
        return MobilConfig()
    is_replaced = FOUND in row and any(effect.name == Politeness.name for effect in model.effects)
    politeness = 0.0 if is_replaced else calibrated.politeness
    return MobilConfig(politeness, calibrated.gain_threshold, calibrated.safe_decel, calibrated.delay)
