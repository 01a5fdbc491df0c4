"""The generator's configuration, its totals compared with those of highD, its independence of the core."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.generator import GeneratorConfig
from rearl_jax.data.generator import generate
from rearl_jax.data.generator.plan import plan_recording
from tests.refusal import refused


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("n_recordings", 0),
        ("first_id", 0),
        ("first_id", 990),
        ("workers", -1),
        ("duration_scale", 0.0),
        ("duration_mean", 5000.0),
        ("in_view_max", 80.0),
        ("truck_share_mean", 0.5),
        ("congested_share", 0.9),
        ("car_time_gap", 0.2),
        ("position_noise", float("nan")),
        ("frames_per_step", 9),
        ("vehicles_min", 5000),
    ],
)
def test_values_out_of_range_are_refused_by_name(key, value):
    with refused("out-of-range", key=key):
        dataclasses.replace(GeneratorConfig(), **{key: value}).check()


@pytest.mark.parametrize("seed", [0, 1])
def test_sixty_plans_have_the_totals_of_highd(seed):
    plans = [plan_recording(GeneratorConfig(seed=seed), number) for number in range(1, 61)]
    assert sum(plan.n_vehicles for plan in plans) == pytest.approx(110_516, rel=0.015)
    assert sum(plan.duration for plan in plans) / 3600.0 == pytest.approx(16.5, rel=0.015)
    counts = [plan.n_vehicles for plan in plans]
    assert min(counts) < 750
    assert max(counts) == pytest.approx(2949, rel=0.01)
    shares = [plan.truck_share for plan in plans]
    assert np.mean(shares) == pytest.approx(0.19, abs=0.005)
    assert 0.08 <= min(shares) < 0.1
    assert 0.26 < max(shares) <= 0.29
    assert {plan.section.n_lanes for plan in plans} == {2, 3}
    assert sum(plan.congestion is not None for plan in plans) == 4


def totals(root):
    """Figures of a folder of recordings, from their meta files: what is published of highD."""
    frames = 25 * 60 * np.arange(30)[:, None] + 1 + 25 * np.arange(60)  # snapshots of the first 30 minutes
    vehicles, seconds, scenes, in_view_first = [], [], 0, 0
    for path in sorted(root.glob("*_tracksMeta.csv")):
        vehicles.append(pd.read_csv(path))
        info = pd.read_csv(path.with_name(path.name.replace("tracksMeta", "recordingMeta"))).iloc[0]
        seconds.append(float(info["duration"]))
        entered, left = (vehicles[-1][name].to_numpy()[:, None, None] for name in ("initialFrame", "finalFrame"))
        in_view_first += int((entered == frames[0, 0]).sum())
        snapshots = frames[: int(seconds[-1] // 60)]
        scenes += int((((entered <= snapshots) & (left >= snapshots)).sum(axis=0).min(axis=1) >= 10).sum())
    whole = pd.concat(vehicles)
    speed = whole.groupby("class")["meanXVelocity"].mean()
    in_view = [part["numFrames"].sum() / 25 / duration for part, duration in zip(vehicles, seconds, strict=True)]
    return {
        "n_vehicles": [len(part) for part in vehicles],
        "n_entered": sum(map(len, vehicles)) - in_view_first,
        "hours": sum(seconds) / 3600.0,
        "whole_minutes": sum(int(duration // 60) for duration in seconds),
        "in_view_mean": float(np.mean(in_view)),
        "in_view_max": max(in_view),
        "truck_share_mean": float(np.mean([(part["class"] == "Truck").mean() for part in vehicles])),
        "car_speed": speed["Car"],
        "truck_speed": speed["Truck"],
        "crossing_time": whole["numFrames"].mean() / 25,
        "lane_changes": int(whole["numLaneChanges"].sum()),
        "lane_change_rate": whole["numLaneChanges"].sum() / whole["numFrames"].sum() * 25,
        "n_scenes": scenes,
    }


def test_a_small_sample_is_near_the_plan(tmp_path):
    config = GeneratorConfig(n_recordings=2, workers=1, duration_scale=0.12)
    generate(config, tmp_path)
    figures = totals(tmp_path)
    planned = [plan_recording(config, number).n_vehicles for number in (1, 2)]
    assert np.allclose(figures["n_vehicles"], planned, rtol=0.25)
    assert sum(figures["n_vehicles"]) == pytest.approx(sum(planned), rel=0.08)
    assert 11.0 < figures["crossing_time"] < 14.5  # short recordings cut more crossings
    assert 31.5 < figures["car_speed"] < 36.0
    assert 22.5 < figures["truck_speed"] < 25.5
    assert 0.0015 < figures["lane_change_rate"] < 0.008


@pytest.mark.slow
def test_sixty_short_recordings_have_the_rates_of_highd(tmp_path):
    """A fifth of each recording. What is published are the totals of 60 recordings of 16.5 hours."""
    generate(GeneratorConfig(duration_scale=0.2), tmp_path)
    figures = totals(tmp_path)
    hours = figures["hours"]
    assert len(figures["n_vehicles"]) == 60
    assert hours == pytest.approx(0.2 * 16.5, rel=0.02)
    assert figures["n_entered"] / hours == pytest.approx((110_516 - 60 * 24.6) / 16.5, rel=0.02)
    assert figures["in_view_mean"] == pytest.approx(24.6, rel=0.04)
    assert figures["in_view_max"] < 50.0
    assert figures["truck_share_mean"] == pytest.approx(0.19, abs=0.01)
    assert figures["car_speed"] == pytest.approx(33.0, abs=1.0)
    assert figures["truck_speed"] == pytest.approx(24.0, abs=0.7)
    assert figures["lane_changes"] / hours == pytest.approx(5600 / 16.5, rel=0.1)
    # 760 scenes in the 960 whole minutes of the 60 recordings.
    assert figures["n_scenes"] / figures["whole_minutes"] == pytest.approx(760 / 960, rel=0.08)
