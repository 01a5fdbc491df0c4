"""Independent generator of measured motorway car-following data on a ring and at an on-ramp; see README.md."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pandas as pd

from .effects import EFFECTS, STRENGTH
from .models import BASE_MODELS, GAP_SCALE
from .sensors import Flight, Sensor, draw_flights, draw_sensor, observe
from .traffic import Road, Run, Scene

__all__ = ["EFFECTS", "make", "plan", "simulate"]
WARM_UP = {"ring": 70.0, "ramp": 90.0}  # s


def plan(seed: int) -> tuple[Scene, Sensor, list[Flight]]:
    """All that the seed fixes before any effect: site, base model, sensor and flights."""
    rng = np.random.default_rng([seed, 20251])
    site = "ramp" if rng.random() < 0.6 else "ring"
    model = str(rng.choice(BASE_MODELS))
    sag = float(rng.uniform(650.0, 900.0))
    sensor = draw_sensor(rng)
    flights = draw_flights(site, WARM_UP[site], rng)
    return Scene(site, model, sag, WARM_UP[site], flights[-1].end - WARM_UP[site]), sensor, flights


def simulate(effect: str, seed: int, scene: Scene | None = None) -> Run:
    """True traffic of a seed under an effect; `scene` replaces the drawn site, model and times."""
    return Road(scene or plan(seed)[0], effect, np.random.SeedSequence([seed, 77]).spawn(5)).run()


def _traffic_figures(run: Run, flights: list[Flight]) -> dict[str, float]:
    x = run.x % run.wrap
    spot = 2200.0 if run.scene.site == "ramp" else 1200.0  # m
    crossed = ((x[:-1] < spot) & (x[1:] >= spot) & (x[1:] - x[:-1] < 50.0)).sum(axis=1)
    minutes = [float(crossed[k : k + 1200].sum()) * 30.0 for k in range(0, crossed.size - 1199, 600)]
    used = run.time < flights[-1].end
    hours = float(used.sum()) * 0.05 / 3600.0
    km = 2.4
    within = [c for c in run.changes if c[0] >= run.time[0] and c[4] < 2400.0]
    return {
        "largest_minute_flow_per_lane_veh_h": max(minutes, default=0.0),
        "mean_flow_per_lane_veh_h": float(crossed.sum()) / hours / 2.0,
        "mean_speed_m_s": float(np.nanmean(run.v)),
        "share_slower_than_2_m_s": float(np.nanmean((run.v < 2.0)[~np.isnan(run.v)])),
        "lane_changes_per_km_h": len(within) / km / hours,
        "contacts": float(run.contacts),
    }


def make(effect: str, seed: int) -> tuple[pd.DataFrame, dict[str, object]]:
    """Measured table and truth of one data set.

    Columns: track_id, frame, time (s from the start of the recording), position (m, front), lateral (m, centre, to
    the right), lane (0 = leftmost), speed (m/s), length (m), width (m), vehicle_class, recording.
    """
    scene, sensor, flights = plan(seed)
    run = simulate(effect, seed, scene)
    table, vehicle_of = observe(run, sensor, flights, np.random.default_rng([seed, 4711]))
    fleet, median = run.fleet, STRENGTH.get(effect, (None, None))
    drivers = {
        str(track): {
            "vehicle": car,
            "desired_speed_m_s": float(fleet.v0[car]),
            "s0_m": float(fleet.s0[car]),
            "time_gap_s": float(fleet.gap_time[car] * GAP_SCALE[scene.model]),
            "a_max_m_s2": float(fleet.a_max[car]),
            "length_m": float(fleet.length[car]),
            "pace_vehicle": car in run.pace,
        }
        for track, car in vehicle_of.items()
    }
    return table, {
        "effect": effect,
        "seed": seed,
        "site": scene.site,
        "base_model": scene.model,
        "strength_median": median[0],
        "strength_log_sd": median[1],
        "sag_start_m": scene.sag_start if effect == "sag" else None,
        "ring_length_m": run.wrap if scene.site == "ring" else None,
        "sensor": asdict(sensor),
        "recordings": len(flights),
        "recorded_s": sum(f.end - f.begin for f in flights),
        "traffic": _traffic_figures(run, flights),
        "drivers": drivers,
    }
