"""The generator's parts: car following, bottleneck, smoothing tracker."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.generator import GeneratorConfig
from rearl_jax.data.generator import generate
from rearl_jax.data.generator.camera import derivatives, smoothed
from rearl_jax.data.generator.car_following import chosen_acceleration, free_speed, safe_speed
from rearl_jax.data.generator.files import recording_files
from rearl_jax.data.generator.fleet import Drivers, Fleet, Situation, SpeedRestriction, draw_drivers
from rearl_jax.data.generator.plan import plan_recording


def _drivers(n: int, **values: float) -> Drivers:
    rng = np.random.default_rng(0)
    drivers = draw_drivers(np.arange(n) % 4 == 0, rng.standard_normal(n), GeneratorConfig(), None, rng)
    return dataclasses.replace(drivers, **{name: np.full(n, value) for name, value in values.items()})


def test_gipps_speeds_are_stationary_where_they_should_be():
    drivers = _drivers(500)
    speed = np.linspace(1.0, 35.0, 500)
    gap = drivers.jam_gap + drivers.time_gap * speed
    assert np.allclose(safe_speed(speed, gap, speed, drivers), speed)
    assert np.all(safe_speed(speed, gap + 1.0, speed, drivers) > speed)
    assert np.all(safe_speed(speed, gap, speed - 1.0, drivers) < speed)
    assert np.allclose(free_speed(drivers.desired_speed, drivers.desired_speed, drivers), drivers.desired_speed)


# Share of the own time gap at the start: less than half is what a cut-in may leave.
@pytest.mark.parametrize(("braking", "share"), [(2.0, 0.45), (4.0, 0.45), (6.0, 0.45), (2.0, 1.0), (8.0, 1.0)])
def test_nobody_runs_into_a_braking_leader(braking, share):
    drivers = _drivers(400)
    n, dt = 400, 0.08
    speed = np.minimum(drivers.desired_speed, np.linspace(8.0, 36.0, n))
    leader_speed, gap = speed.copy(), drivers.jam_gap + share * drivers.time_gap * speed
    closest = np.inf
    for _ in range(600):
        leader_acceleration = np.where(leader_speed > 0.0, -braking, 0.0)
        own = chosen_acceleration(speed, drivers.desired_speed, gap, leader_speed, leader_acceleration, drivers)
        next_speed = np.maximum(speed + dt * own, 0.0)
        next_leader = np.maximum(leader_speed + dt * leader_acceleration, 0.0)
        gap = gap + 0.5 * dt * (leader_speed + next_leader - speed - next_speed)
        speed, leader_speed = next_speed, next_leader
        closest = min(closest, float(gap.min()))
    assert np.all(leader_speed == 0.0)
    assert np.all(speed < 0.5)
    assert closest > 0.0


def test_stop_and_go_reaches_the_view(tmp_path):
    base = GeneratorConfig(n_recordings=1, workers=1, duration_scale=0.25)
    plans = [plan_recording(base, number) for number in range(1, 61)]
    plan = next(plan for plan in plans if plan.congestion is not None)
    assert plan.congestion is not None
    (path,) = generate(dataclasses.replace(base, first_id=plan.id), tmp_path)
    data = pd.read_csv(path, usecols=["id", "xVelocity", "backSightDistance"])
    meta = pd.read_csv(recording_files(tmp_path, plan.id)[1]).set_index("id")
    data["direction"] = meta["drivingDirection"].reindex(data["id"]).to_numpy()
    late = data[data["backSightDistance"] > 300.0]
    slowest = late["xVelocity"].abs().groupby(late["direction"]).quantile(0.05)
    assert slowest[plan.congestion.direction] < 12.0
    assert slowest[3 - plan.congestion.direction] > 18.0


def test_a_speed_restriction_holds_only_there_and_then():
    bottleneck = SpeedRestriction(1, 100.0, 200.0, (10.0, 20.0), (5.0, np.inf))
    drivers = _drivers(3)
    fleet = Fleet.empty(drivers)
    place = {"direction": np.array([1, 1, 2]), "position": np.array([50.0, 150.0, 150.0])}
    fleet.enter(drivers, vehicle=np.arange(3), **place)
    wanted = np.full(3, 30.0)
    for time, expected in ((0.0, 30.0), (10.0, 5.0), (25.0, 30.0)):
        situation = Situation(time, fleet, np.full(3, np.inf), fleet.speed, np.zeros(3))
        assert bottleneck.limited(wanted, situation).tolist() == [30.0, expected, 30.0]


def test_smoother_solves_each_track_on_its_own():
    rng = np.random.default_rng(1)
    begin = np.array([0, 40, 44])
    values = rng.standard_normal((100, 2)).cumsum(axis=0)
    cutoff = 1.0
    stiffness = (2.0 * np.sin(np.pi * cutoff * 0.04)) ** -6
    expected = []
    for part in np.split(values, begin[1:]):
        third = np.diff(np.eye(len(part)), n=3, axis=0)
        expected.append(np.linalg.solve(np.eye(len(part)) + stiffness * third.T @ third, part))
    assert np.allclose(smoothed(values, begin, cutoff), np.concatenate(expected), atol=1e-7)


def test_smoother_halves_the_cutoff_and_keeps_constant_acceleration():
    time = 0.04 * np.arange(2001)
    wave = np.sin(2.0 * np.pi * 1.0 * time)
    smooth = smoothed(wave[:, None], np.array([0]), 1.0)[:, 0]
    assert np.allclose(smooth[500:1500], 0.5 * wave[500:1500], atol=1e-3)
    parabola = 3.0 + 20.0 * time - 0.7 * time**2
    kept = smoothed(parabola[:, None], np.array([0]), 1.0)
    assert np.allclose(kept[:, 0], parabola, atol=1e-5)
    first, second = derivatives(kept, np.array([0]))
    assert np.allclose(first[1:-1, 0], 20.0 - 1.4 * time[1:-1], atol=1e-4)
    assert np.allclose(second[5:-5, 0], -1.4, atol=1e-3)
