"""Time gaps at equilibrium of each car (or person) under each setting (or leader): measured, and calibrated.

Measured time gaps need no model: they are the median of gap over speed in intervals near equilibrium. For calibrated
time gaps, the car-following model chosen by discovery is calibrated to all tracks of a setting; the time gap of a car
is the median over its tracks of the equilibrium gap over speed, at the median speed of these intervals. A piece is an
uninterrupted stretch of one track.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from rearl_jax.config import DiscoverConfig
from rearl_jax.config.driver import DriverConfig
from rearl_jax.discovery.observe.base import base_of
from rearl_jax.discovery.observe.drivers import prior_of
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.report.equilibrium import time_gaps
from rearl_jax.discovery.resampling import Resampling
from rearl_jax.study.real.known import TOLERANCE, KnownTimeGap

MAX_ACCELERATION, MAX_APPROACH_RATE, MIN_SPEED = 0.2, 0.3, 5.0
"""Limits of near equilibrium: largest acceleration [m/s^2], largest approach rate [m/s], smallest speed [m/s]."""

MIN_STEADY_TIME = 2.0
"""Smallest time near equilibrium for a measured time gap [s]."""

FACT_COLUMNS = ("setting", "car", "tracks", "runs", "steady_seconds", "speed", "model_free", "model_free_deviation")
FACT_COLUMNS += ("calibrated", "difference", "known", "known_deviation", "within")


def near_equilibrium(data: Measured) -> Bool[np.ndarray, "steps pieces"]:
    """True for counted time steps in which drivers hardly accelerate or approach their leaders."""
    speed = data.smooth_speed
    acceleration = np.gradient(speed, data.dt, axis=0)
    approach = speed - data.surroundings.leader_speed
    is_steady = (np.abs(acceleration) < MAX_ACCELERATION) & (np.abs(approach) < MAX_APPROACH_RATE)
    return is_steady & (speed > MIN_SPEED) & (data.weight > 0)


def facts_of(
    data: Measured,
    by: str,
    car: str,
    models: Mapping[str, DriverConfig],
    known: Mapping[str, Mapping[str, KnownTimeGap]],
    *,
    lane_changes: bool,
) -> pd.DataFrame:
    """One row per setting and car, with FACT_COLUMNS; null for values that cannot be determined.

    Args:
        data: All drivers.
        by: Label of the setting.
        car: Label of the car or person.
        models: Car-following model to calibrate in each setting; settings without one are measured only.
        known: Known time gaps by car and setting; `within` is true up to a difference of TOLERANCE.
        lane_changes: Whether the calibrated model responds to lane changes, as in `base_of`.
    """
    rows = []
    settings = data.labels[by]
    for setting in sorted({value for value in settings.tolist() if value is not None}):
        of_setting = data.select(np.flatnonzero(settings == setting))
        is_steady = near_equilibrium(of_setting)
        speed = float(np.median(of_setting.smooth_speed[is_steady])) if is_steady.any() else np.nan
        driver_time_gap = np.full(of_setting.n_drivers, np.nan)
        if setting in models and np.isfinite(speed):
            driver_time_gap = _calibrated(of_setting, models[setting], speed, lane_changes=lane_changes)
        cars = of_setting.label(car)
        for name in sorted({value for value in cars.tolist() if value is not None}):
            row = {"setting": setting, "car": name, "speed": speed}
            row |= _measured(of_setting, is_steady, of_setting.labels[car] == name)
            row |= {"tracks": int((cars == name).sum()), "calibrated": _median(driver_time_gap[cars == name])}
            row["difference"] = row["calibrated"] - row["model_free"]
            if (fact := known.get(name, {}).get(setting)) is not None:
                row |= {"known": fact.value, "known_deviation": fact.deviation}
                if np.isfinite(row["calibrated"]):
                    row["within"] = bool(abs(row["calibrated"] - fact.value) <= TOLERANCE)
            rows.append(row)
    table = pd.DataFrame(rows, columns=list(FACT_COLUMNS))
    kinds = {"tracks": "Int64", "runs": "Int64", "within": "boolean"}
    numbers = [name for name in FACT_COLUMNS if name not in ("setting", "car", *kinds)]
    return table.astype(kinds | dict.fromkeys(numbers, "Float64"))


def _calibrated(
    data: Measured, model: DriverConfig, speed: float, *, lane_changes: bool
) -> Float[np.ndarray, " drivers"]:
    """Time gaps [s] at equilibrium of the drivers of a calibrated model."""
    solver = solver_of(data, prior_of(model))
    return time_gaps(solver, base_of(solver, data, lane_changes=lane_changes).fit.state, speed)


def _measured(data: Measured, is_steady: np.ndarray, pieces: np.ndarray) -> dict[str, float | int]:
    """Measured time gap of the given pieces, its standard error between runs, and the amount of data."""
    time_gap = data.gap / np.maximum(data.smooth_speed, MIN_SPEED)
    step = data.dt * data.stride

    def median(chosen: np.ndarray) -> float:
        values = time_gap[:, chosen][is_steady[:, chosen]]
        return float(np.median(values)) if len(values) * step >= MIN_STEADY_TIME else np.nan

    runs = np.unique(data.recording[pieces])
    by_run = np.array([median(pieces & (data.recording == run)) for run in runs])
    by_run = by_run[np.isfinite(by_run)]
    standard_error = float(by_run.std(ddof=1) / np.sqrt(len(by_run))) if len(by_run) > 1 else np.nan
    return {
        "runs": len(runs),
        "steady_seconds": float(is_steady[:, pieces].sum() * step),
        "model_free": median(pieces),
        "model_free_deviation": standard_error,
    }


def _median(values: Float[np.ndarray, " tracks"]) -> float:
    """Median of the known values; NaN if fewer than half are known."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) and len(known) >= len(values) / 2 else np.nan


def differences_of(facts: pd.DataFrame, options: DiscoverConfig) -> pd.DataFrame:
    """Differences between settings in the time gap of the same cars: mean with an interval over cars.

    One row per set, pair of settings and method (`calibrated`, `model_free`): `first`, `second`, `cars`, `first_mean`,
    `second_mean`, `value`, `low`, `high` [s] and `longer`, the number of cars that keep the longer time gap in `first`.
    Pairs of settings that fewer than two cars drove in are left out.
    """
    resampling, rows = Resampling(options.confidence, options.draws, options.seed), []
    for name, of_set in facts.groupby("set", sort=False):
        title, settings = of_set["title"].iloc[0], sorted(set(of_set["setting"].tolist()))
        for number, first in enumerate(settings):
            for second in settings[number + 1 :]:
                for method in ("calibrated", "model_free"):
                    wide = of_set.pivot(index="car", columns="setting", values=method)[[first, second]].dropna()
                    pair = wide.to_numpy(float)  # [cars, two settings]
                    if len(pair) < 2:
                        continue
                    difference = pair[:, 0] - pair[:, 1]
                    row = {"set": name, "title": title, "first": first, "second": second, "method": method}
                    row |= {"cars": len(difference), "first_mean": pair[:, 0].mean(), "second_mean": pair[:, 1].mean()}
                    figure = resampling.figure(resampling.drawn(difference, np.mean))
                    rows.append(row | figure | {"longer": int((difference > 0).sum())})
    columns = ["set", "title", "first", "second", "method", "cars", "first_mean", "second_mean", "value", "low", "high"]
    return pd.DataFrame(rows, columns=[*columns, "longer"])
