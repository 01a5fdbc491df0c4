"""Free lane changes: nobody crashes, those change who gain by it, and what is hidden shows in who changes."""

from functools import cache

import numpy as np
import pytest

from rearl_jax.blind.traffic import Planted, Scenario, write_dataset
from rearl_jax.blind.traffic.catalogue import HIDDEN, LANE_CHOICE
from rearl_jax.blind.traffic.scenario import FREE_CHANGES
from rearl_jax.blind.traffic.simulation import simulate
from tests.blind.driving_facts import facts
from tests.refusal import refused

SCENARIO = {**FREE_CHANGES, "n_recordings": 1, "n_vehicles": 150, "duration": 90.0}
MARKS = dict.fromkeys({*LANE_CHOICE} - {"keep_right", "politeness"}, pytest.mark.thorough)


@pytest.fixture(scope="module")
def free():
    @cache
    def run(name):
        return simulate(Scenario(9, () if name is None else (Planted(name),), **SCENARIO))

    return run


def changes(events):
    """Steps before a change, vehicles, and sides."""
    step, vehicle = np.nonzero(np.diff(events.lane, axis=0))
    return step, vehicle, events.lane[step + 1, vehicle] - events.lane[step, vehicle]


@pytest.mark.parametrize("name", [None, *(pytest.param(name, marks=MARKS.get(name, ())) for name in LANE_CHOICE)])
def test_nobody_crashes_and_all_changes_are_to_the_next_lane(free, name):
    events = free(name)
    gap = facts(events).gap[events.leader < events.position.shape[1]]
    assert gap.min() > 0.5
    _, vehicle, side = changes(events)
    assert len(side) > 40
    assert set(np.abs(side)) == {1}
    assert (events.fleet.rank[vehicle] > 0).all()


def test_everybody_stays_a_while_after_a_change(free):
    step, vehicle, _ = changes(free(None))
    for driver in np.unique(vehicle):
        assert np.all(np.diff(step[vehicle == driver]) * 0.02 >= 5.0 - 1e-9)


def test_most_changes_pay(free):
    events = free(None)
    step, vehicle, _ = changes(events)
    plain = facts(events).plain
    assert np.median(plain[step + 1, vehicle] - plain[step, vehicle]) > 0.1


def gain_by_side(events):
    """Median acceleration gained by changes to the right, less that of those to the left."""
    step, vehicle, side = changes(events)
    plain = facts(events).plain
    gain = plain[step + 1, vehicle] - plain[step, vehicle]
    return np.median(gain[side > 0]) - np.median(gain[side < 0])


def test_drivers_keep_right_where_that_is_hidden(free):
    # The right lane fills up, so there are hardly more changes to it; they pay less by twice the bias of 0.35 m/s^2.
    assert abs(gain_by_side(free(None))) < 0.25
    assert gain_by_side(free("keep_right")) < -0.45


def test_polite_drivers_change_less(free):
    assert len(changes(free("politeness"))[2]) < 0.75 * len(changes(free(None))[2])


def test_effects_need_free_changes(tmp_path):
    assert not set(LANE_CHOICE) & set(HIDDEN)
    with refused("out-of-range", key="free_changes"):
        write_dataset(tmp_path, Scenario(1, (Planted("keep_right"),)))
