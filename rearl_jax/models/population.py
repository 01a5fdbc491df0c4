"""Populations of drivers as arrays: from the file of a repaired model, or from the keys `driver` and `mobil`.

A repaired model is a traffic model with the effects that discovery found, and with drivers calibrated together with
these effects (`models.record.RepairedModel`).

The last axis of the arrays, `*shared`, does not exist in the results of this module. `evaluation.rollouts` appends it
with length 1 to arrays that are the same for all scenarios.
"""

import math
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from rearl_jax.config.driver import MODELS, DriverConfig
from rearl_jax.config.mobil import MobilConfig
from rearl_jax.core.effects import EFFECTS
from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.effects.lane_changes import KeepRight, Politeness
from rearl_jax.core.timer import decision_period
from rearl_jax.models.record import CAR, TRUCK, DriverClass, EffectValues, RepairedModel


class LaneChanging(eqx.Module):
    """Parameters of MOBIL, the same for all drivers; see `core.drivers.MOBILParams`.

    Attributes:
        politeness: Weight of the followers' gain [-].
        gain_threshold: Smallest gain of a change [m/s^2].
        safe_decel: Largest deceleration of the new follower [m/s^2].
        delay: Time between two decisions [s]; the time of the first decision depends on it.
        period: The same in time steps, as highway-env's timer counts them (`core.timer`).
    """

    politeness: Float[Array | np.ndarray, "*shared"]
    gain_threshold: Float[Array | np.ndarray, "*shared"]
    safe_decel: Float[Array | np.ndarray, "*shared"]
    delay: Float[Array | np.ndarray, "*shared"]
    period: Int[Array | np.ndarray, "*shared"]


class Population(eqx.Module):
    """Classes of drivers and their effects, as arrays. In each class the parameters of car following are log-normal.

    Attributes:
        shares: Shares of all classes except the first [-]; the first has the remaining drivers.
        median: Medians of the parameters; nan for a parameter whose values are drawn with the initial state instead.
        factor: Lower triangular factor of the covariance of the parameters' logarithms.
        noise: Standard deviation [m/s^2] and correlation time [s] of the acceleration noise.
        length: Mean and standard deviation of the vehicle length [m].
        is_truck: Whether the vehicles of each class are trucks.
        effects: Effects in addition to car following.
        lane_changing: MOBIL parameters; None for highway-env's.
        car_following: Name of the car-following model.
        drawn: Names of the parameters that are drawn with the initial state in all classes.
        is_noisy: Whether any class has acceleration noise.
        is_resized: Whether any vehicle length differs from highway-env's 5 m.
    """

    shares: Float[Array | np.ndarray, "others *shared"]
    median: Float[Array | np.ndarray, "classes parameters *shared"]
    factor: Float[Array | np.ndarray, "classes parameters parameters *shared"]
    noise: Float[Array | np.ndarray, "classes sd_and_time *shared"]
    length: Float[Array | np.ndarray, "classes mean_and_sd *shared"]
    is_truck: Bool[Array | np.ndarray, "classes *shared"]
    effects: tuple[Effect, ...]
    lane_changing: LaneChanging | None
    car_following: str = eqx.field(static=True)
    drawn: tuple[str, ...] = eqx.field(static=True)
    is_noisy: bool = eqx.field(static=True)
    is_resized: bool = eqx.field(static=True)


def population_of_model(
    model: RepairedModel,
    dtype: np.dtype,
    *,
    with_effects: bool,
    lane_changing: LaneChanging | None = None,
    ticks_per_second: int = 15,
) -> Population:
    """The drivers in the file of a repaired model, with or without its effects.

    Args:
        model: The model.
        dtype: Floating type of the simulation.
        with_effects: True for the effects and the drivers calibrated together with them; False for the drivers
            calibrated without effects. The effects `politeness` and `keep_right` replace politeness and bias of the
            model's lane changing.
        lane_changing: MOBIL parameters that replace those of the model, including its bias; None for the model's own,
            or highway-env's if the model has none.
        ticks_per_second: Time steps per second [1/s].
    """
    classes = model.population if with_effects else model.baseline
    effect_values = list(model.effects) if with_effects else []
    if lane_changing is None and model.lane_changing is not None:
        calibrated, names = model.lane_changing, {effect.name for effect in effect_values}
        politeness = 0.0 if Politeness.name in names else calibrated.politeness
        mobil = MobilConfig(politeness, calibrated.gain_threshold, calibrated.safe_decel, calibrated.delay)
        lane_changing = lane_changing_of(mobil, dtype, ticks_per_second)
        if calibrated.bias and KeepRight.name not in names:
            # MOBIL has no bias to one side, so the effect takes over the bias of the model.
            effect_values.append(EffectValues(KeepRight.name, {"bias": calibrated.bias}))
    effects = tuple(effect_of(values, dtype) for values in effect_values)
    ordered = {name: classes[name] for name in (CAR, TRUCK) if name in classes}
    medians = [[math.exp(drivers.log_mean[name]) for name in model.parameters] for drivers in ordered.values()]
    return _population(ordered, medians, model.car_following, dtype, effects, lane_changing)


def population_of_keys(
    driver: DriverConfig, mobil: MobilConfig, dtype: np.dtype, ticks_per_second: int
) -> Population | None:
    """The drivers described by configuration keys; None if all keys have the values of highway-env's drivers.

    Args:
        driver: Keys of car following, vehicle sizes and classes.
        mobil: Keys of lane changing.
        dtype: Floating type of the simulation.
        ticks_per_second: Time steps per second [1/s].
    """
    if driver.is_default and mobil.is_default:
        return None
    others = {
        name: _class(driver, name, float(keys_of_class["share"])) for name, keys_of_class in driver.classes.items()
    }
    # The first class has the remaining drivers. It is called `car` unless the keys define another class of this name.
    remaining_share = max(1.0 - sum(drivers.share for drivers in others.values()), 0.0)
    classes = {CAR if CAR not in others else "": _class(driver, None, remaining_share), **others}
    # Directly from the keys, without the rounding errors of exp(log(median)).
    medians = [_medians(driver, name) for name in (None, *others)]
    lane_changing = lane_changing_of(mobil, dtype, ticks_per_second)
    return _population(classes, medians, driver.model, dtype, (), lane_changing)


def lane_changing_of(mobil: MobilConfig, dtype: np.dtype, ticks_per_second: int) -> LaneChanging | None:
    """The MOBIL parameters of the keys as arrays; None if they are highway-env's."""
    return None if mobil.is_default else lane_changing_values(mobil, dtype, ticks_per_second)


def lane_changing_values(mobil: MobilConfig, dtype: np.dtype, ticks_per_second: int) -> LaneChanging:
    """The MOBIL parameters of the keys as arrays, also if they are highway-env's."""
    return LaneChanging(
        politeness=np.array(mobil.politeness, dtype),
        gain_threshold=np.array(mobil.gain_threshold, dtype),
        safe_decel=np.array(mobil.safe_decel, dtype),
        delay=np.array(mobil.delay, dtype),
        period=np.array(decision_period(mobil.delay, ticks_per_second), np.int32),
    )


def effect_of(values: EffectValues, dtype: np.dtype) -> Effect:
    """An effect of a model file, with arrays for traffic with one axis of scenarios."""
    numbers: dict[str, Any] = {name: jnp.asarray(value, dtype) for name, value in values.parameters.items()}
    # Values of a curve have an axis of knots, before the axes of vehicles and scenarios.
    numbers |= {name: value[:, None, None] for name, value in numbers.items() if name == "values"}
    if values.variable is not None:
        numbers["variable"] = values.variable
    return EFFECTS[values.name](**numbers)


def _class(driver: DriverConfig, name: str | None, share: float) -> DriverClass:
    """The drivers of one class, described by configuration keys; without a name, those outside all classes."""
    values, medians = driver.values(name), _medians(driver, name)
    log_mean = dict(zip(driver.declaration.names, map(math.log, medians), strict=True))
    covariance = np.diag([_log_variance(values, parameter) for parameter in driver.declaration.names]).tolist()
    sizes: dict[str, Any] = {key: values[key] for key in ("noise_sd", "noise_time", "length", "length_sd")}
    return DriverClass(share=share, log_mean=log_mean, log_covariance=covariance, **sizes)


def _medians(driver: DriverConfig, name: str | None) -> list[float]:
    """Medians of the parameters of a class; nan for parameters drawn with the initial state."""
    values = driver.values(name)
    # The keys state mean and standard deviation of the parameter itself. If V is the variance of its logarithm, the
    # median is mean exp(-V / 2).
    means = {key: math.nan if value is None else value for key, value in values.items()}
    return [means[key] * math.exp(-_log_variance(values, key) / 2) for key in driver.declaration.names]


def _log_variance(values: Mapping[str, float | None], name: str) -> float:
    """Variance of the logarithm of a log-normal parameter, from mean and standard deviation of the parameter."""
    value, sd = values[name], values[f"{name}_sd"]
    return math.log1p((sd / value) ** 2) if value and sd else 0.0


def _population(
    classes: Mapping[str, DriverClass],
    medians: list[list[float]],
    car_following: str,
    dtype: np.dtype,
    effects: tuple[Effect, ...],
    lane_changing: LaneChanging | None,
) -> Population:
    """The population of these classes, the first with the remaining drivers; `medians` by class and parameter."""
    names = MODELS[car_following].names
    drivers_of_classes = list(classes.values())

    def table(*columns: str) -> np.ndarray:
        return np.array([[getattr(drivers, name) for name in columns] for drivers in drivers_of_classes], dtype)

    median = np.array(medians, dtype)
    length = table("length", "length_sd")
    return Population(
        shares=np.array([drivers.share for drivers in drivers_of_classes[1:]], dtype),
        median=median,
        factor=np.stack([_factor(drivers) for drivers in drivers_of_classes]).astype(dtype),
        noise=table("noise_sd", "noise_time"),
        length=length,
        is_truck=np.array([name == TRUCK for name in classes]),
        effects=effects,
        lane_changing=lane_changing,
        car_following=car_following,
        drawn=tuple(name for name, column in zip(names, median.T, strict=True) if np.isnan(column).all()),
        is_noisy=any(drivers.noise_sd > 0 for drivers in drivers_of_classes),
        is_resized=bool((length != (5.0, 0.0)).any()),
    )


def _factor(drivers: DriverClass) -> np.ndarray:
    """Lower triangular matrix L with L L^T equal to the covariance, which may lack full rank."""
    values, vectors = np.linalg.eigh(np.array(drivers.log_covariance))
    _, upper = np.linalg.qr((vectors * np.sqrt(np.maximum(values, 0.0))).T)
    return (upper * np.where(np.diag(upper) < 0, -1.0, 1.0)[:, None]).T
