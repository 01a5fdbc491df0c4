import dataclasses

import numpy as np
import pytest

from rearl_jax.validation.causes import Cause, Facts, measure, name_cause, unstable_below
from rearl_jax.validation.comparison import compare
from rearl_jax.validation.records import stack

FACTS = Facts(
    tick=40,
    vehicle=1,
    difference=1e-6,
    growth=2.0,
    speed=20.0,
    slowest=18.0,
    unstable_below=0.7,
    is_crashed=False,
    has_flipped=False,
    contact_tick=181,
)


@pytest.mark.parametrize(
    ("changed", "cause"),
    [
        ({}, Cause.unexplained),
        ({"contact_tick": 41}, Cause.unexplained),
        ({"contact_tick": 40}, Cause.follows_contact),
        ({"has_flipped": True}, Cause.decision),
        ({"slowest": 0.1, "has_flipped": True}, Cause.standstill),
        ({"is_crashed": True, "contact_tick": 3}, Cause.push),
        ({"is_crashed": True, "contact_tick": 3, "growth": 1e6}, Cause.push_tie),
    ],
)
def test_facts_and_their_cause(changed, cause):
    assert name_cause(dataclasses.replace(FACTS, **changed)) is cause


def test_below_the_unstable_speed_a_lateral_offset_changes_sign_and_grows():
    def growth(speed, length=5.0):
        return 1 - length / 2 / 15 / (speed * 0.2 * 0.6)

    assert unstable_below(5.0) == pytest.approx(0.694, abs=1e-3)
    assert growth(unstable_below(5.0)) == pytest.approx(-1.0)
    assert growth(0.9 * unstable_below(16.0), 16.0) < -1 < growth(1.1 * unstable_below(16.0), 16.0) < 0


@pytest.fixture
def stressed(recorded, jobs):
    """The first scene of stress10, whose vehicles crash, and its motion."""
    return stack([recorded[jobs["stress10"][0]]])


def test_the_first_vehicle_to_differ_is_described(stressed, planted):
    tracks = stressed.tracks
    assert not tracks.crashed[60, 3, 0]
    other = planted(tracks, "x", (slice(60, None), 3, 0), 3e-6)
    other = planted(other, "x", (slice(60, None), 5, 0), 1e-6)
    other = planted(other, "x", (slice(70, None), 7, 0), 1.0)
    facts = measure(compare(tracks, other), stressed, 0, 60, 1e-9)
    assert (facts.tick, facts.vehicle) == (60, 3)
    assert facts.difference == pytest.approx(3e-6, rel=1e-4)
    assert facts.growth > 1e9
    assert facts.speed == tracks.speed[60, 3, 0]
    assert facts.slowest == np.abs(tracks.speed[30:61, 3, 0]).min()
    assert facts.contact_tick == np.flatnonzero(tracks.crashed.any((1, 2)))[0] < 60
    assert not facts.is_crashed
    assert not facts.has_flipped


def test_a_difference_in_the_first_tick_has_grown_from_nothing(stressed, planted):
    other = planted(stressed.tracks, "x", (slice(0, None), 3, 0), 3e-6)
    assert measure(compare(stressed.tracks, other), stressed, 0, 0, 1e-9).growth > 1e9


def test_a_flipped_decision_is_the_vehicles_whose_target_differs(stressed, planted):
    other = planted(stressed.tracks, "target_lane", (slice(44, None), 6, 0), 1)
    facts = measure(compare(stressed.tracks, other), stressed, 0, 44, 1e-9)
    assert (facts.vehicle, facts.has_flipped, facts.difference) == (6, True, 0.0)


def test_another_crash_flag_is_that_vehicles(stressed, planted):
    crashed = np.flatnonzero(stressed.tracks.crashed[-1, :, 0])
    assert 0 < len(crashed) < 10
    other = planted(stressed.tracks, "crashed", (slice(100, None), crashed[-1], 0), False)
    facts = measure(compare(stressed.tracks, other), stressed, 0, 100, 1e-9)
    assert (facts.vehicle, facts.is_crashed) == (crashed[-1], True)
