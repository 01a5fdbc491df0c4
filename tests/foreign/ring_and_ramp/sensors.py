"""What is measured of the true traffic: an aircraft that drifts along with it.

Sensors (drawn by seed)
    video  drone film at 20 Hz; speed is derived from the positions, which may be smoothed before release.
    radar  surveillance radar on a helicopter at 10 Hz; speed is its own Doppler speed, released as it comes.
Sources: Hoogendoorn, van Zuylen, Schreuder, Gorte and Vosselman 2003 (helicopter); Krajewski et al. 2018 and
Barmpounakis and Geroliminis 2020 (drone accuracy); Thiemann, Treiber and Kesting 2008 and Punzo, Borzacchiello
and Ciuffo 2011 (errors and smoothing of trajectories).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .models import Array
from .traffic import DT, OPEN, Run


@dataclass(frozen=True)
class Flight:
    """One recording: the window is centred on start + speed * (time - begin)."""

    begin: float  # s
    end: float  # s
    start: float  # m
    speed: float  # m/s
    half: float  # m


@dataclass(frozen=True)
class Sensor:
    """Measurement chain; errors are standard deviations."""

    kind: str  # video, radar
    rate: float  # Hz
    white: float  # m, independent from frame to frame
    slow: float  # m, correlated per vehicle
    slow_time: float  # s
    sway: float  # m, correlated and common to all vehicles (camera movement)
    lateral: float  # m
    doppler: float  # m/s, error of the own speed sensor (radar only)
    scale: float  # 1, error of the speed scale per track (radar only)
    smoothing: str  # none, polynomial, average
    window: float  # s, of the smoothing, or of the difference that gives the speed if none


def draw_sensor(rng: np.random.Generator) -> Sensor:
    """Draw one of the two sensors with its errors."""
    if rng.random() < 0.6:
        smoothing = str(rng.choice(["none", "polynomial", "average"]))
        window = {"none": 0.5, "polynomial": float(rng.uniform(0.9, 1.5)), "average": float(rng.uniform(0.5, 0.9))}
        return Sensor(
            "video",
            20.0,
            float(rng.uniform(0.02, 0.07)),
            float(rng.uniform(0.05, 0.18)),
            float(rng.uniform(0.8, 3.0)),
            float(rng.uniform(0.05, 0.25)),
            0.08,
            0.0,
            0.0,
            smoothing,
            window[smoothing],
        )
    smoothing = str(rng.choice(["none", "polynomial"]))
    return Sensor(
        "radar",
        10.0,
        float(rng.uniform(0.06, 0.14)),
        float(rng.uniform(0.0, 0.12)),
        float(rng.uniform(2.0, 6.0)),
        float(rng.uniform(0.0, 0.20)),
        0.15,
        float(rng.uniform(0.06, 0.14)),
        0.004,
        smoothing,
        1.0,
    )


def draw_flights(site: str, warm_up: float, rng: np.random.Generator) -> list[Flight]:
    """One flight over the ring; one long flight or two short ones with the traffic towards the merge of the ramp."""
    if site == "ring":
        end = warm_up + float(rng.uniform(320.0, 370.0))
        return [Flight(warm_up, end, float(rng.uniform(0.0, 2400.0)), float(rng.uniform(8.5, 10.5)), 520.0)]
    speed = float(rng.uniform(4.2, 5.0))  # m/s
    if rng.random() < 0.5:
        return [Flight(warm_up, warm_up + 1600.0 / speed, 400.0, speed, float(rng.uniform(190.0, 220.0)))]
    pause = warm_up + 800.0 / speed
    half = float(rng.uniform(160.0, 185.0))
    return [
        Flight(warm_up, pause, 600.0, speed, half),
        Flight(pause + 8.0, pause + 8.0 + 800.0 / speed, 950.0, speed, half),
    ]


def coloured(n: int, sd: float, tau: float, dt: float, rng: np.random.Generator) -> Array:
    """First-order correlated noise: n values with standard deviation sd and correlation time tau (s)."""
    keep = float(np.exp(-dt / tau))
    out = rng.standard_normal(n) * sd * np.sqrt(1.0 - keep * keep)
    out[0] = rng.standard_normal() * sd
    for k in range(1, n):
        out[k] += keep * out[k - 1]
    return out


def smooth(y: Array, half: int, order: int) -> tuple[Array, Array]:
    """Local polynomial of an order over 2 * half + 1 frames: value and slope per frame; ends use the end fit."""
    half = max(1, min(half, (y.size - 1) // 2))
    k = np.arange(-half, half + 1.0)
    fit = np.linalg.pinv(np.vander(k, order + 1, increasing=True))
    views = np.lib.stride_tricks.sliding_window_view(y, k.size) @ fit.T
    value, slope = np.empty(y.size), np.empty(y.size)
    value[half : y.size - half] = views[:, 0]
    slope[half : y.size - half] = views[:, 1]
    for rows, coef, at in ((slice(0, half), views[0], k[:half]), (slice(y.size - half, None), views[-1], k[-half:])):
        value[rows] = np.vander(at, order + 1, increasing=True) @ coef
        steps = np.arange(1, order + 1)
        slope[rows] = np.vander(at, order, increasing=True) @ (coef[1:] * steps)
    return value, slope


def _speed_and_position(sensor: Sensor, seen: Array, true_v: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    half = max(1, round(sensor.window * sensor.rate / 2.0))
    if sensor.kind == "radar":
        speed = true_v * (1.0 + sensor.scale * rng.standard_normal())
        speed = np.round((speed + sensor.doppler * rng.standard_normal(seen.size)) / 0.05) * 0.05
        place = smooth(seen, half, 2)[0] if sensor.smoothing == "polynomial" else seen
        return place, np.maximum(speed, 0.0)
    place, slope = smooth(seen, half, 2 if sensor.smoothing == "polynomial" else 1)
    if sensor.smoothing == "average":
        slope = np.gradient(place)
    return seen if sensor.smoothing == "none" else place, np.maximum(slope * sensor.rate, 0.0)


def pieces(seen: NDArray[np.bool_], shortest: int) -> list[tuple[int, int]]:
    """Runs of True of at least `shortest` frames, as (first, past the last)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], seen.astype(np.int8), [0]])))
    return [(int(b), int(e)) for b, e in edges.reshape(-1, 2) if e - b >= shortest]


def observe(
    run: Run, sensor: Sensor, flights: list[Flight], rng: np.random.Generator
) -> tuple[pd.DataFrame, dict[int, int]]:
    """Measured table, and the vehicle (index in the fleet) behind every track_id."""
    every = round(1.0 / (sensor.rate * DT))
    parts: list[pd.DataFrame] = []
    vehicle_of: dict[int, int] = {}
    track = int(rng.integers(100, 900))
    for number, flight in enumerate(flights, start=1):
        rows = np.flatnonzero((run.time >= flight.begin - 1e-6) & (run.time < flight.end - 1e-6))[::every]
        centre = flight.start + flight.speed * (run.time[rows] - flight.begin)
        x = run.x[rows].astype(float)
        if run.wrap < OPEN:
            x = centre[:, None] + (x - centre[:, None] + run.wrap / 2.0) % run.wrap - run.wrap / 2.0
        inside = np.abs(x - centre[:, None]) < flight.half
        sway = coloured(rows.size, sensor.sway, 4.0, 1.0 / sensor.rate, rng)
        for car in np.flatnonzero(inside.any(axis=0)):
            for b, e in pieces(inside[:, car], round(3.0 * sensor.rate)):
                at, n = rows[b:e], e - b
                seen = x[b:e, car] + sway[b:e] + sensor.white * rng.standard_normal(n)
                seen += coloured(n, sensor.slow, sensor.slow_time, 1.0 / sensor.rate, rng)
                place, speed = _speed_and_position(sensor, seen, run.v[at, car].astype(float), rng)
                side = run.lateral[at, car] + coloured(n, sensor.lateral, 0.5, 1.0 / sensor.rate, rng)
                track += 1
                vehicle_of[track] = int(car)
                frames = np.arange(b, e)
                parts.append(
                    pd.DataFrame(
                        {
                            "track_id": track,
                            "frame": frames,
                            "time": frames / sensor.rate,
                            "position": place,
                            "lateral": side.astype(float),
                            "lane": run.lane[at, car].astype(np.int64),
                            "speed": speed,
                            "length": round(float(run.fleet.length[car] + 0.12 * rng.standard_normal()), 2),
                            "width": round(float(run.fleet.width[car] + 0.05 * rng.standard_normal()), 2),
                            "vehicle_class": str(run.fleet.kind[car]),
                            "recording": number,
                        }
                    )
                )
    table = pd.concat(parts, ignore_index=True).sort_values(["recording", "frame", "track_id"], ignore_index=True)
    return table, vehicle_of
