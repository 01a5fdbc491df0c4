"""Simulated drives without missing effects, measured again."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.observe.fit_state import new_state
from rearl_jax.discovery.read.fused_errors import FusedErrors
from rearl_jax.discovery.read.lasting import lasting
from rearl_jax.discovery.search.simulated_drives import (
    FOLLOWER_GAINS,
    follower_gains,
    matched_noise,
    measured_again,
    response_of_follower,
    simulate_again,
)

DT = 0.1


def test_a_follower_ends_as_far_ahead_as_its_leader_and_later():
    displacement = np.zeros((1200, 2))
    displacement[100:, 0] = 3.0
    response = response_of_follower(displacement, DT)
    assert response[-1] == pytest.approx([3.0, 0.0], abs=0.01)
    assert (response[:100] == 0).all()
    assert 0.2 < response[120, 0] < 2.5, "within two seconds it has begun to respond"


def test_the_response_of_the_vehicles_behind_is_measured(calibrated):
    data = calibrated[0].data
    gains, rng = np.array([0.15, 0.7, 0.1, 0.4]), np.random.default_rng(0)
    own_speed = 20 + lasting(2.0, 5.0, data.y.shape, data.dt, rng)
    own = np.cumsum(own_speed, axis=0) * data.dt
    steady = 20 * data.dt * np.arange(len(own))[:, None]
    behind = steady - 25.0 + response_of_follower(own - steady, data.dt, gains)
    seen = replace(
        data.surroundings,
        has_follower=np.ones_like(own),
        follower_front=behind - data.length / 2,
        follower_speed=np.gradient(behind, data.dt, axis=0),
    )
    data = replace(
        data, smooth=own, smooth_speed=np.gradient(own, data.dt, axis=0), weight=np.ones_like(own), surroundings=seen
    )
    assert follower_gains(data) == pytest.approx(gains, abs=0.1)
    nobody = replace(seen, has_follower=np.zeros_like(own))
    assert follower_gains(replace(data, surroundings=nobody)) == pytest.approx(FOLLOWER_GAINS)


def test_without_another_drive_nothing_is_measured_otherwise(calibrated):
    data, noise = calibrated[0].data, calibrated[1]
    again = measured_again(data, data.smooth, noise, np.random.default_rng(0))
    for name in ("leader_rear", "second_rear", "follower_front", "follower_speed"):
        np.testing.assert_array_equal(getattr(again.surroundings, name), getattr(data.surroundings, name))
    np.testing.assert_array_equal(again.y, data.smooth)


def test_the_vehicle_behind_follows_the_simulated_drive(solver, calibrated):
    state, noise = calibrated
    data = state.data
    again = simulate_again(solver, state, noise, np.random.default_rng(1))
    farther = again.data.smooth - data.smooth
    moved = again.data.surroundings.follower_front - data.surroundings.follower_front
    followed = (data.surroundings.has_follower > 0) & (data.weight > 0)
    assert followed.sum() > 500
    assert np.abs(farther[followed]).max() > 0.5, "the simulated drive is another one"
    assert np.corrcoef(farther[followed], moved[followed])[0, 1] > 0.7
    assert (moved[data.surroundings.has_follower == 0] == 0).all()


def test_fused_positions_of_all_vehicles_have_errors_of_their_own(solver, calibrated):
    state, _ = calibrated
    data = replace(state.data, fused_errors=FusedErrors(0.1, 0.5, 20.0, 0.03, 0.0, 0.3))
    again = measured_again(data, data.smooth, calibrated[1], np.random.default_rng(0))
    led = data.surroundings.has_leader > 0
    own, leader = again.y - data.smooth, again.surroundings.leader_rear - data.surroundings.leader_rear
    assert own[led].std() == pytest.approx(0.5, rel=0.35)
    assert leader[led].std() == pytest.approx(0.5, rel=0.35)
    assert abs(np.corrcoef(own[led], leader[led])[0, 1]) < 0.4
    np.testing.assert_allclose(again.surroundings.leader_centre - data.surroundings.leader_centre, leader, atol=1e-9)
    assert (leader[~led] == 0).all()
    simulated = simulate_again(
        solver, new_state(data, solver.layout, calibrated[1]), calibrated[1], np.random.default_rng(2)
    )
    assert not np.allclose(simulated.pieces.seen.leader_rear, state.pieces.seen.leader_rear)


def test_errors_that_are_drawn_separately_do_not_count_as_drivers_noise(solver, calibrated):
    state, noise = calibrated
    assert matched_noise(solver, state, noise, np.random.default_rng(0)) == noise
    data = replace(state.data, fused_errors=FusedErrors(0.0, 0.3, 10.0, 0.01, 0.5, 0.3))
    fused = replace(state, data=data)
    less = matched_noise(solver, fused, noise, np.random.default_rng(0))
    assert replace(less, acceleration=noise.acceleration) == noise
    assert 0 < less.acceleration < 0.95 * noise.acceleration
    again = simulate_again(solver, fused, less, np.random.default_rng(3))
    measured, simulated, unmatched = solver.innovations(
        [fused, again, simulate_again(solver, fused, noise, np.random.default_rng(3))]
    )
    counts = data.weight > 0
    assert simulated[counts].std() == pytest.approx(measured[counts].std(), rel=0.1)
    assert unmatched[counts].std() > simulated[counts].std()
