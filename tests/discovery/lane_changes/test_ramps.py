"""Ramp lanes, and changes that lead to them."""

import numpy as np

from rearl_jax.discovery.lane_changes import KnownDrivers
from rearl_jax.discovery.lane_changes.opportunities import opportunities
from rearl_jax.discovery.lane_changes.ramps import count_ramp_changes, side_of_ramp, whole_lanes


def test_a_lane_on_part_of_the_road_is_a_ramp():
    lane = np.array([0, 0, 1, 1, 2, 2])
    position = np.array([0.0, 500.0, 20.0, 480.0, 150.0, 300.0])
    assert whole_lanes(np.ones(6, int), lane, position) == {(1, 0), (1, 1)}


def test_the_side_of_the_ramp_is_that_of_the_lane_reached_later():
    vehicle, lane = np.array([1, 1, 1, 1, 2, 2, 3, 3]), np.array([0, 1, 2, 1, 2, 1, 0, 1])
    side = side_of_ramp(vehicle, np.ones(8, int), lane, {(1, 0), (1, 1)})
    assert side.tolist() == [1, 1, 0, 0, 0, 0, 0, 0]
    assert side_of_ramp(np.empty(0, int), np.empty(0, int), np.empty(0, int), set()).tolist() == []


def test_changes_towards_a_ramp_that_is_reached_later_are_mandatory(recording):
    """1 goes to the middle lane and leaves by lane 2; lanes 0 and 1 run the whole road."""

    def leaves(t):
        return 0 if t < 8.05 else 1 if t < 10.05 else 2

    others = [(start, 20.0, lane, "car") for lane in (0, 1) for start in (0.0, 130.0, 420.0, 800.0)]
    scene = recording([(300.0, 20.0, leaves, "car"), *others])
    table, _ = opportunities([scene], KnownDrivers.of([]))
    own = table.vehicle == 1
    assert own.any()
    assert table.is_mandatory[own & (table.side > 0)].all()
    assert not table.is_mandatory[~own].any()
    assert table.changes[own].sum() == 1
    assert count_ramp_changes([scene]) == 1
