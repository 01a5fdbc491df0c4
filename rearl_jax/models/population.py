"""Populations of drivers as arrays: from a repaired model's file, or from the keys `driver` and `mobil`."""

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
        delay: Time between two decisions [s].
        period: Time between two decisions in ticks.
    """

    politeness: Float[Array | np.ndarray, "*one"]
    gain_threshold: Float[Array | np.ndarray, "*one"]
    safe_decel: Float[Array | np.ndarray, "*one"]
    delay: Float[Array | np.ndarray, "*one"]
    period: Int[Array | np.ndarray, "*one"]


class Population(eqx.Module):
    """Drivers by class, and their effects, as arrays. Parameters are log-normal.

    Attributes:
        shares: Shares of all classes but the first, which has the rest [-].
        median: Medians of the drivers' parameters; nan for parameters drawn with the initial state.
        factor: Lower triangular factor of the covariance of their logarithms.
        noise: Standard deviation [m/s^2] and correlation time [s] of the acceleration's noise.
        length: Mean and standard deviation of the length [m].
        is_truck: Whether each class is trucks.
        effects: Effects in addition to car following.
        lane_changing: MOBIL parameters; None for highway-env's.
        car_following: Name of the car-following model.
        drawn: Names of parameters drawn with the initial state, in all classes.
        is_noisy: Whether there is any noise.
        is_resized: Whether vehicle lengths differ from highway-env's 5 m.
    """

    shares: Float[Array | np.ndarray, "others *one"]
    median: Float[Array | np.ndarray, "classes parameters *one"]
    factor: Float[Array | np.ndarray, "classes parameters parameters *one"]
    noise: Float[Array | np.ndarray, "classes two *one"]
    length: Float[Array | np.ndarray, "classes two *one"]
    is_truck: Bool[Array | np.ndarray, "classes *one"]
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
    """The drivers of a repaired model, or those that were calibrated without effects.

    Args:
        model: The model.
        dtype: Floating type of the simulation.
        with_effects: Whether to take the drivers calibrated with the effects, and the effects. The effects `politeness`
            and `keep_right` take the place of the MOBIL parameters that do the same.
        lane_changing: MOBIL parameters in the place of the model's, its bias included; None for the model's, and for
            highway-env's where it has none.
        ticks_per_second: Clock of the simulation [1/s].
    """
    classes = model.population if with_effects else model.baseline
    chosen = list(model.effects) if with_effects else []
    if lane_changing is None and model.lane_changing is not None:
        calibrated, names = model.lane_changing, {effect.name for effect in chosen}
        politeness = 0.0 if Politeness.name in names else calibrated.politeness
        mobil = MobilConfig(politeness, calibrated.gain_threshold, calibrated.safe_decel, calibrated.delay)
        lane_changing = lane_changing_of(mobil, dtype, ticks_per_second)
        if calibrated.bias and KeepRight.name not in names:
            chosen.append(EffectValues(KeepRight.name, {"bias": calibrated.bias}))
    effects = tuple(effect_of(values, dtype) for values in chosen)
    ordered = {name: classes[name] for name in (CAR, TRUCK) if name in classes}
    medians = [[math.exp(drivers.log_mean[name]) for name in model.parameters] for drivers in ordered.values()]
    return _population(ordered, medians, model.car_following, dtype, effects, lane_changing)


def population_of_keys(
    driver: DriverConfig, mobil: MobilConfig, dtype: np.dtype, ticks_per_second: int
) -> Population | None:
    """The drivers of a configuration; None if they are highway-env's.

    Args:
        driver: Car following, sizes, classes.
        mobil: Lane changing.
        dtype: Floating type of the simulation.
        ticks_per_second: Clock of the simulation [1/s].
    """
    if driver.is_default and mobil.is_default:
        return None
    others = {
        name: _class(driver, name, float(keys_of_class["share"])) for name, keys_of_class in driver.classes.items()
    }
    car_share = max(1.0 - sum(drivers.share for drivers in others.values()), 0.0)
    classes = {CAR if CAR not in others else "": _class(driver, None, car_share), **others}
    medians = [_medians(driver, name) for name in (None, *others)]
    lane_changing = lane_changing_of(mobil, dtype, ticks_per_second)
    return _population(classes, medians, driver.model, dtype, (), lane_changing)


def lane_changing_of(mobil: MobilConfig, dtype: np.dtype, ticks_per_second: int) -> LaneChanging | None:
    """The MOBIL parameters of a configuration; None for highway-env's."""
    return None if mobil.is_default else lane_changing_values(mobil, dtype, ticks_per_second)


def lane_changing_values(mobil: MobilConfig, dtype: np.dtype, ticks_per_second: int) -> LaneChanging:
    """The MOBIL parameters of a configuration, also if they are highway-env's."""
    return LaneChanging(
        politeness=np.array(mobil.politeness, dtype),
        gain_threshold=np.array(mobil.gain_threshold, dtype),
        safe_decel=np.array(mobil.safe_decel, dtype),
        delay=np.array(mobil.delay, dtype),
        period=np.array(decision_period(mobil.delay, ticks_per_second), np.int32),
    )


def effect_of(values: EffectValues, dtype: np.dtype) -> Effect:
    """The effect of a model file, for traffic with one scenario axis."""
    numbers: dict[str, Any] = {name: jnp.asarray(value, dtype) for name, value in values.parameters.items()}
    numbers |= {name: value[:, None, None] for name, value in numbers.items() if name == "values"}
    if values.variable is not None:
        numbers["variable"] = values.variable
    return EFFECTS[values.name](**numbers)


def _class(driver: DriverConfig, name: str | None, share: float) -> DriverClass:
    """One class of drivers."""
    values, medians = driver.values(name), _medians(driver, name)
    log_mean = dict(zip(driver.declaration.names, map(math.log, medians), strict=True))
    covariance = np.diag([_log_variance(values, parameter) for parameter in driver.declaration.names]).tolist()
    sizes: dict[str, Any] = {key: values[key] for key in ("noise_sd", "noise_time", "length", "length_sd")}
    return DriverClass(share=share, log_mean=log_mean, log_covariance=covariance, **sizes)


def _medians(driver: DriverConfig, name: str | None) -> list[float]:
    """Medians of the parameters of a class; nan for parameters drawn with the initial state."""
    values = driver.values(name)
    # The keys are mean and standard deviation of the parameter itself, not of its logarithm.
    means = {name: math.nan if value is None else value for name, value in values.items()}
    return [means[name] * math.exp(-_log_variance(values, name) / 2) for name in driver.declaration.names]


def _log_variance(values: Mapping[str, float | None], name: str) -> float:
    """Variance of the logarithm of a log-normal parameter."""
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
    names = MODELS[car_following].names
    every = list(classes.values())

    def table(*columns: str) -> np.ndarray:
        return np.array([[getattr(drivers, name) for name in columns] for drivers in every], dtype)

    median = np.array(medians, dtype)
    length = table("length", "length_sd")
    return Population(
        shares=np.array([drivers.share for drivers in every[1:]], dtype),
        median=median,
        factor=np.stack([_factor(drivers) for drivers in every]).astype(dtype),
        noise=table("noise_sd", "noise_time"),
        length=length,
        is_truck=np.array([name == TRUCK for name in classes]),
        effects=effects,
        lane_changing=lane_changing,
        car_following=car_following,
        drawn=tuple(name for name, column in zip(names, median.T, strict=True) if np.isnan(column).all()),
        is_noisy=any(drivers.noise_sd > 0 for drivers in every),
        is_resized=bool((length != (5.0, 0.0)).any()),
    )


def _factor(drivers: DriverClass) -> np.ndarray:
    """Lower triangular L with L L' the covariance, which need not have full rank."""
    values, vectors = np.linalg.eigh(np.array(drivers.log_covariance))
    _, upper = np.linalg.qr((vectors * np.sqrt(np.maximum(values, 0.0))).T)
    return (upper * np.where(np.diag(upper) < 0, -1.0, 1.0)[:, None]).T
