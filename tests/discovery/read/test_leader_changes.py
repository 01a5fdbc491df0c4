"""The next leader, and the change of leader in a smoothed recording."""

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.driver import record_of
from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.discovery.observe.drivers import prior_of
from rearl_jax.discovery.observe.early_leader import EarlyLeader, RecordedStimulus
from rearl_jax.discovery.read.kernels import UNSMOOTHED, Kernel
from rearl_jax.discovery.read.leader_changes import handed_over, handovers

DT, N = 0.1, 100


@pytest.fixture
def cut_in():
    """Vehicle 2 follows 0 until vehicle 1 comes in between in frame 50."""
    frame = np.tile(np.arange(N), 3)
    track = np.repeat([0, 1, 2], N)
    lane = np.where((track == 1) & (frame < 50), 1, 0)
    table = pd.DataFrame({"track_id": track, "frame": frame, "lane": lane, "lateral": 0.0})
    leader = np.where(track == 2, np.where(frame < 50, 0, 1), np.where((track == 1) & (frame >= 50), 0, NO_VEHICLE))
    bounds = np.arange(3) * N, (np.arange(3) + 1) * N
    return table, bounds, leader


def test_the_next_leader_is_known_before_it_is_one(cut_in):
    near = handovers(*cut_in, DT, 2.0)
    follower = slice(2 * N, 3 * N)
    time_to, following = near.time_to[follower], near.following[follower]
    assert np.flatnonzero(np.isfinite(time_to)).tolist() == list(range(30, 50))
    np.testing.assert_allclose(time_to[30:50], (50 - np.arange(30, 50)) * DT)
    np.testing.assert_array_equal(following[30:50], N + np.arange(30, 50))  # rows of vehicle 1 in the same frames
    np.testing.assert_array_equal(near.preceding[follower][50:70], np.arange(50, 70))  # rows of vehicle 0
    assert not near.by_own[follower].any()


def test_the_lane_change_begins_with_the_motion_sideways(cut_in):
    """Vehicle 1 moves sideways from frame 25 on, and its lane column changes halfway in frame 50."""
    table, *others = cut_in
    share = np.clip((table["frame"] - 25) / 50, 0.0, 1.0)
    sideways = -3.5 * share**3 * (10 - 15 * share + 6 * share**2)  # a path of minimum jerk
    moved = table.assign(lateral=np.where(table["track_id"] == 1, sideways, 0.0))
    follower = slice(2 * N, 3 * N)
    near, unknown = handovers(moved, *others, DT, 2.0), handovers(table, *others, DT, 2.0)
    lead = near.lead[follower]
    assert lead[30:50] == pytest.approx(2.5, abs=0.2)
    assert len(set(lead[30:50])) == 1
    assert np.flatnonzero(np.isfinite(near.time_to[follower]))[0] == pytest.approx(50 - 10 * (lead[49] + 2.0), abs=1)
    assert not unknown.lead.any()
    assert not near.lead[: 2 * N].any(), "the two others keep their leaders, or have none before"


def test_a_smoothed_driver_has_answered_to_a_smoothed_step(cut_in):
    near = handovers(*cut_in, DT, 3.0)
    gap = np.where(cut_in[0]["track_id"] == 1, 10.0, 30.0)  # of vehicle 1, and of vehicle 0
    present = np.where(cut_in[2] == NO_VEHICLE, 0.0, gap[np.maximum(cut_in[2], 0) * N])
    np.testing.assert_array_equal(handed_over(present, gap, near, UNSMOOTHED, DT), present)
    smooth = handed_over(present, gap, near, Kernel("gaussian", 0.5), DT)[2 * N :]
    assert smooth[0] == 30.0
    assert smooth[-1] == 10.0
    assert (np.diff(smooth) <= 1e-12).all()
    assert 19.0 < smooth[49:51].mean() < 21.0  # half of it in the middle
    assert np.ptp(smooth[45:55]) > 10.0


def driver_at(**seen):
    """One driver of usual parameters, its effects with all weights 1, and its stimulus."""
    driver = prior_of(record_of("idm")()).model(*(jnp.full(1, value) for value in (30.0, 1.2, 2.0, 1.4, 2.0)))
    far = {"next_gap": 500.0, "former_gap": 500.0, "time_to_next": 1e9, "time_since_change": 1e9}
    values = dict.fromkeys(RecordedStimulus.__dataclass_fields__, 0.0) | {"speed": 20.0} | far | seen
    return driver, RecordedStimulus(**{name: jnp.full(1, value) for name, value in values.items()})


def changed(share, before, **seen):
    """Change of the deceleration because of leaders [m/s^2], with all weights equal to a share."""
    driver, stimulus = driver_at(**seen)
    weights = dict.fromkeys(("of_changer", "of_follower", "of_left", "of_former"), jnp.full(1, share))
    times = {"lead_time": jnp.full(1, 2.0), "release_time": jnp.ones(1), "scatter": jnp.full(1, 0.4)}
    effect = EarlyLeader(**weights, **times, braking_limit=jnp.full(1, 2.0))
    value = jnp.full(1, before)
    return float((effect.leaders(value, stimulus, None, driver) - value)[0])


@pytest.mark.parametrize(("time_to", "answers"), [(0.1, True), (1.0, True), (4.0, False), (1e9, False)])
def test_drivers_answer_early_and_not_long_before(time_to, answers):
    seen = {"next_gap": 15.0, "next_speed": 20.0, "time_to_next": time_to, "next_is_nearer": 1.0}
    change = changed(1.0, 0.1, **seen)
    assert (change > 0.3) == answers
    assert abs(change) < 0.05 or answers
    assert changed(0.0, 0.1, **seen) == 0.0


@pytest.mark.parametrize(("since", "answers"), [(0.1, True), (0.5, True), (3.0, False), (1e9, False)])
def test_drivers_avoid_the_leader_that_they_had_until_it_has_left(since, answers):
    seen = {"former_gap": 15.0, "former_speed": 20.0, "time_since_change": since}
    change = changed(1.0, 0.1, **seen)
    assert (change > 0.3) == answers
    assert 0.0 <= change < 0.05 or answers
    assert changed(0.0, 0.1, **seen) == 0.0
    assert changed(1.0, 3.0, **(seen | {"former_gap": 200.0})) == 0.0, "nobody follows more loosely because of it"
