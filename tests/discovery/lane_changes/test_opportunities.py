"""The table of opportunities against a scene worked out by hand."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.data.records import Recording
from rearl_jax.discovery.lane_changes.incentives import KnownDrivers
from rearl_jax.discovery.lane_changes.motion import USUAL_LEAD
from rearl_jax.discovery.lane_changes.opportunities import REST, opportunities
from rearl_jax.discovery.observe.drivers import IDM_PRIOR
from rearl_jax.discovery.read.smoothing import thinned

PARAMETERS = np.array([30.0, 1.0, 2.0, 1.0, 2.0])
N = 9


def driven_by(n, values=PARAMETERS):
    """Everybody with the same known parameters."""
    return KnownDrivers(np.arange(1, n + 1), np.tile(values, (n, 1)), IDM_PRIOR.usual)


def idm(speed, gap, leader_speed):
    v0, T, s0, a, b = PARAMETERS
    wanted = s0 + max(0.0, speed * T + speed * (speed - leader_speed) / (2 * np.sqrt(a * b)))
    return a * (1 - (speed / v0) ** 4 - (wanted / gap) ** 2)


def scene(changes_at):
    """1 wants to leave the middle lane behind the truck 2; 3 is ahead and 4 behind on the left; 5 follows 1.

    All others are far away; 8 and 9 see nobody ahead.
    """
    return [
        (300.0, 20.0, lambda t: 0 if t >= changes_at else 1, "car"),
        (330.0, 18.0, 1, "truck"),
        (360.0, 25.0, 0, "car"),
        (250.0, 22.0, 0, "car"),
        (270.0, 20.0, 1, "car"),
        (0.0, 20.0, 0, "car"),
        (0.0, 20.0, 1, "car"),
        (800.0, 25.0, 0, "car"),
        (800.0, 25.0, 1, "car"),
    ]


@pytest.fixture(scope="module")
def table(recording):
    return opportunities([recording(scene(changes_at=8.05))], driven_by(N))[0]


@pytest.mark.parametrize("changes_at", [8.05, 8.25, 8.45, 8.65])
def test_every_change_counts_where_a_period_is_longer_than_half_a_second(recording, changes_at):
    drawn = recording([(start, speed / 1.5, *others) for start, speed, *others in scene(changes_at)])
    at_15_hz = Recording(replace(drawn.info, frame_rate=15.0), drawn.table)
    assert opportunities([at_15_hz], driven_by(N))[0].changes.sum() == 1


def test_vehicles_have_the_same_numbers_where_frame_rates_differ_a_little(recording):
    """Four frames at 30 Hz are one time step, as are three at 29.97 Hz: the last track of the first would be left."""
    slow = [(start, speed / 3, *others) for start, speed, *others in scene(changes_at=99.0)]
    drawn = recording(slow, seconds=36.0)
    last = drawn.table[(drawn.table["track_id"] == N) & (drawn.table["frame"] < 3)].assign(track_id=N + 1)
    first = Recording(replace(drawn.info, frame_rate=29.97), pd.concat([drawn.table, last], ignore_index=True))
    second = Recording(replace(drawn.info, frame_rate=30.0), drawn.table)
    alone = opportunities([second], driven_by(N))[0]
    both = opportunities([first, second], driven_by(2 * N + 1))[0]
    assert len(alone.vehicle) > 10
    n_before = thinned(first, 30.0)[0]["track_id"].max() + 1
    np.testing.assert_array_equal(both.vehicle[both.recording == 1], alone.vehicle + n_before)


def at(table, time, side, vehicle=1):
    """Row of a vehicle at a time: one of the constant speeds gives it away."""
    chosen = np.flatnonzero((table.vehicle == vehicle) & (table.side == side))
    return chosen[round(time / 0.5)]


def test_columns_are_those_of_the_scene(table):
    row = at(table, 2.0, -1)
    t = 2.0
    gap, side_gap, rear_gap = 30 - 2 * t - 8, 60 + 5 * t - 4, 50 - 2 * t - 4
    assert table.gap[row] == pytest.approx(gap, abs=1e-3)
    assert table.side_gap[row] == pytest.approx(side_gap, abs=1e-3)
    assert table.rear_gap[row] == pytest.approx(rear_gap, abs=1e-3)
    assert table.follower_gap[row] == pytest.approx(26.0, abs=1e-3)
    assert table.leader_is_truck[row]
    assert not table.side_leader_is_truck[row]
    assert not table.is_truck[row]
    assert table.incentive[row] == pytest.approx(idm(20, side_gap, 25) - idm(20, gap, 18), abs=2e-3)
    between = rear_gap + side_gap + 4
    assert table.rear_gain[row] == pytest.approx(idm(22, rear_gap, 20) - idm(22, between, 25), abs=2e-3)
    assert table.follower_gain[row] == pytest.approx(idm(20, 26 + gap + 4, 18) - idm(20, 26, 20), abs=2e-3)


def test_only_the_last_opportunity_before_the_usual_beginning_of_a_change_is_taken(table):
    own = table.vehicle == 1
    taken = np.flatnonzero(own & table.changes)
    assert len(taken) == 1
    assert table.side[taken] == -1
    assert table.gap[taken] == pytest.approx(22 - 2 * (8.0 - USUAL_LEAD), abs=1e-2)


@pytest.mark.parametrize(("begins_at", "lasts"), [(4.1, 6.0), (5.6, 5.0), (6.6, 2.5)])
def test_a_change_is_chosen_when_the_vehicle_begins_to_move_sideways(recording, begins_at, lasts):
    drawn = recording(scene(changes_at=begins_at + lasts / 2))
    is_own, time = drawn.table["track_id"] == 1, drawn.table["time"].to_numpy()
    share = np.clip((time - begins_at) / lasts, 0.0, 1.0)
    sideways = np.where(is_own, -3.5 * share**3 * (10 - 15 * share + 6 * share**2), 0.0)  # a path of minimum jerk
    wander = 0.1 * np.sin(2 * np.pi * time / 4.0) + np.random.default_rng(0).normal(0.0, 0.03, len(time))
    table = opportunities([Recording(drawn.info, drawn.table.assign(lateral=sideways + wander))], driven_by(N))[0]
    own = table.vehicle == 1
    taken = np.flatnonzero(own & table.changes)
    assert len(taken) == 1
    chosen_at = (22 - table.gap[taken]) / 2  # gaps shrink by 2 m/s from 22 m
    assert begins_at - 0.8 < chosen_at < begins_at + 0.8
    times = (22 - table.gap[own & (table.side == -1)]) / 2
    assert not np.any((times > chosen_at + 0.1) & (times < begins_at + lasts / 2 + REST))


def test_who_has_just_changed_has_no_opportunity(recording):
    table, _ = opportunities([recording(scene(changes_at=2.05))], driven_by(N))
    back = (table.vehicle == 1) & (table.side == 1)
    times = (table.side_gap[back] - 22) / -2
    assert np.all((times < 2.1) | (times > 2.05 + REST))


def test_no_opportunity_without_a_leader_in_sight_or_without_room(recording):
    table, _ = opportunities([recording(scene(changes_at=99.0))], driven_by(N))
    assert 1 in table.vehicle
    assert not set(table.vehicle) & {8, 9}
    tight = scene(changes_at=99.0)
    tight[3] = (296.0, 22.0, 0, "car")
    table, _ = opportunities([recording(tight, seconds=6.0)], driven_by(N))
    assert not np.any((table.vehicle == 1) & (table.side == -1))


def test_a_lane_along_part_of_the_road_is_left_out(recording):
    short = [*scene(99.0), (300.0, 1.0, 2, "car"), (400.0, 1.0, 2, "car")]
    table, _ = opportunities([recording(short)], driven_by(N + 2))
    assert not np.any((table.vehicle == 1) & (table.side == 1))


def test_words_say_why_there_is_nothing(recording):
    none, why = opportunities([recording(scene(8.05), lanes=False)], driven_by(N))
    assert (len(none.side), why) == (0, "the data have no lanes")
    one_lane = [(start, speed, 0, kind) for start, speed, _, kind in scene(8.05)]
    assert opportunities([recording(one_lane)], driven_by(N))[1] == "there is one lane per direction"


def test_vehicles_are_numbered_on_over_recordings(recording):
    scenes = [recording(scene(8.05)), recording(scene(8.05))]
    table, _ = opportunities(scenes, driven_by(2 * N + 1))
    assert set(table.vehicle[table.recording == 1] - N - 1) == set(table.vehicle[table.recording == 0])
