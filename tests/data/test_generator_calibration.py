"""The generator's configuration, its totals beside those of highD, its independence of the core."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

from rearl_jax.config.generator import GeneratorConfig
from rearl_jax.data.generator import generate, summarise, totals
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


def test_the_generator_needs_neither_jax_nor_the_simulation_core():
    code = (
        "import sys, rearl_jax.data.generator\n"
        "print([m for m in sys.modules if m == 'jax' or m.startswith('rearl_jax.core')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


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


def test_a_small_sample_is_near_the_plan(tmp_path):
    config = GeneratorConfig(n_recordings=4, workers=1, duration_scale=0.12)
    generate(config, tmp_path)
    summary = summarise(tmp_path)
    assert summary.index.tolist() == [1, 2, 3, 4]
    planned = [plan_recording(config, number).n_vehicles for number in summary.index]
    assert np.allclose(summary["n_vehicles"], planned, rtol=0.25)
    figures = totals(summary)
    assert figures["n_vehicles"] == pytest.approx(sum(planned), rel=0.08)
    assert 11.0 < figures["crossing_time"] < 14.5  # short recordings cut more crossings
    assert 31.5 < figures["car_speed"] < 36.0
    assert 22.5 < figures["truck_speed"] < 25.5
    assert 0.0015 < figures["lane_change_rate"] < 0.008
    assert 0 < figures["n_scenes"] <= figures["n_windows"]


@pytest.mark.slow
def test_sixty_recordings_have_the_totals_of_highd(tmp_path):
    generate(GeneratorConfig(), tmp_path)
    figures = totals(summarise(tmp_path))
    assert figures["n_recordings"] == 60
    assert figures["hours"] == pytest.approx(16.5, rel=0.02)
    assert figures["n_vehicles"] == pytest.approx(110_516, rel=0.02)
    assert figures["in_view_mean"] == pytest.approx(24.6, rel=0.04)
    assert figures["in_view_max"] < 50.0
    assert figures["truck_share_mean"] == pytest.approx(0.19, abs=0.01)
    assert figures["car_speed"] == pytest.approx(33.0, abs=1.0)
    assert figures["truck_speed"] == pytest.approx(24.0, abs=0.7)
    assert figures["lane_changes"] == pytest.approx(5600, rel=0.1)
    assert 700 <= figures["n_scenes"] <= 820
