"""Differences planted into one of two equal runs are found where they were planted, and nowhere else."""

import numpy as np
import pytest

from rearl_jax.validation.comparison import aborts, compare, first_disagreement, rows

BOUNDS = {"tolerance": 1e-9, "only_before_contact": False}


def disagreement(reference, other, **bounds):
    """{scene: first tick} of the scenes that disagree."""
    differs, first = first_disagreement(compare(reference, other), **(BOUNDS | bounds))
    return {int(scene): int(first[scene]) for scene in np.flatnonzero(differs)}


def test_equal_runs_agree(drive):
    found = compare(drive, drive)
    assert found.changed.sum() == found.changed_alike.sum() == found.changed_either.sum() == 3
    assert np.argwhere(found.changed).tolist() == [[11, 1, scene] for scene in range(3)]
    assert disagreement(drive, drive) == {}
    assert all(not values.any() for values in found.errors.values())


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_micrometre_is_found(drive, planted, axis, sign):
    other = planted(drive, axis, (slice(17, None), 2, 1), sign * 1e-6)
    assert disagreement(drive, other) == {1: 17}
    found = compare(drive, other)
    assert np.unravel_index(found.position.argmax(), found.position.shape) == (17, 2, 1)
    assert found.errors["position"][17, 1] == pytest.approx(1e-6, rel=1e-6)
    assert found.errors["position"][:17].max() == 0
    assert found.errors["position"][:, [0, 2]].max() == 0
    assert found.errors["speed"].max() == 0
    assert disagreement(drive, other, tolerance=1.1e-6) == {}


def test_a_difference_of_one_tick_is_found(drive, planted):
    assert disagreement(drive, planted(drive, "x", (30, 0, 2), 1e-6)) == {2: 30}
    assert disagreement(drive, planted(drive, "x", (0, 0, 0), 1e-6)) == {0: 0}


@pytest.mark.parametrize(("name", "quantity"), [("speed", "speed"), ("heading", "heading")])
def test_speed_and_heading_are_measured(drive, planted, name, quantity):
    found = compare(drive, planted(drive, name, (9, 3, 0), -0.25))
    assert np.argwhere(found.errors[quantity]).tolist() == [[9, 0]]
    assert found.errors[quantity].max() == 0.25


@pytest.mark.parametrize(("shift", "tick"), [(1, 12), (-1, 11)])
def test_a_lane_change_one_tick_later_or_earlier_is_found(drive, planted, shift, tick):
    where = (slice(12, 12 + shift), 1, 0) if shift > 0 else (slice(12 + shift, 12), 1, 0)
    other = planted(drive, "lane", where, -shift)
    assert np.flatnonzero(np.diff(other.lane[:, 1, 0])).tolist() == [11 + shift]
    assert disagreement(drive, other) == {0: tick}
    found = compare(drive, other)
    assert found.changed_alike.sum() == 2
    assert found.changed_either.sum() == 4
    assert not found.changed_alike[:, :, 0].any()


def test_a_change_into_another_lane_is_no_agreement(drive, planted):
    found = compare(drive, planted(drive, "lane", (slice(12, None), 1, 2), 1))
    assert (found.changed_alike.sum(), found.changed_either.sum()) == (2, 3)


def test_another_target_lane_is_found(drive, planted):
    other = planted(drive, "target_lane", (slice(20, 23), 3, 1), -1)
    assert disagreement(drive, other) == {1: 20}
    assert np.argwhere(compare(drive, other).flipped).tolist() == [[tick, 3, 1] for tick in (20, 21, 22)]


def test_another_crash_flag_is_found_on_its_tick(drive, planted):
    reference = planted(drive, "crashed", (slice(20, None), slice(0, 2), 1), True)
    other = planted(reference, "crashed", (20, 0, 1), False)
    assert disagreement(reference, other) == {1: 20}
    assert np.argwhere(compare(reference, other).crash_differs).tolist() == [[20, 0, 1]]
    assert disagreement(drive, reference) == {1: 20}


def test_before_contact_ends_with_the_first_crash_of_the_reference(drive, planted):
    reference = planted(drive, "crashed", (slice(20, None), 0, 1), True)
    reference = planted(reference, "crashed", (slice(25, None), 2, 1), True)
    assert compare(reference, drive).contact.tolist() == [31, 20, 31]
    assert compare(reference, drive).before_contact.sum(0).tolist() == [31, 20, 31]
    after = planted(reference, "x", (slice(20, None), 3, slice(None)), 1e-6)
    assert disagreement(reference, after) == {0: 20, 1: 20, 2: 20}
    assert disagreement(reference, after, only_before_contact=True) == {0: 20, 2: 20}
    before = planted(reference, "x", (slice(19, None), 3, slice(None)), 1e-6)
    assert disagreement(reference, before, only_before_contact=True) == {0: 19, 1: 19, 2: 19}


def test_a_crash_that_only_the_other_run_has_is_no_contact(drive, planted):
    other = planted(drive, "crashed", (slice(20, None), 0, 1), True)
    assert compare(drive, other).contact.tolist() == [31, 31, 31]
    assert disagreement(drive, other, only_before_contact=True) == {1: 20}


def test_single_precision_is_compared_in_double(drive, planted):
    far = planted(drive, "x", slice(None), 9_000.0)
    narrow = planted(far, "x", slice(None), 0.0)
    object.__setattr__(narrow, "x", far.x.astype(np.float32))
    error = compare(far, narrow).errors["position"].max()
    assert error == np.abs(far.x - far.x.astype(np.float32).astype(np.float64)).max() > 1e-5


def test_aborts_are_target_lanes_changed_under_way(drive, planted):
    nobody = np.zeros((4, 3), bool)
    assert aborts(drive, nobody).tolist() == [0, 0, 0]
    given_up = planted(drive, "target_lane", (slice(9, None), 1, 2), -1)
    assert aborts(given_up, nobody).tolist() == [0, 0, 1]
    is_meta = nobody.copy()
    is_meta[1, 2] = True
    assert aborts(given_up, is_meta).tolist() == [0, 0, 0]


def test_rows_count_what_happened_and_keep_contact_apart(drive, planted):
    reference = planted(drive, "crashed", (slice(20, None), slice(0, 2), 1), True)
    other = planted(reference, "x", (25, 0, 1), 0.5)
    other = planted(other, "x", (10, 0, 1), 1e-6)
    other = planted(other, "target_lane", (25, 2, 1), 1)
    quiet, crash, _ = rows(compare(reference, other), reference, np.zeros((4, 3), bool))
    assert (quiet["crashes"], quiet["max_position"], quiet["flips"]) == (0, 0.0, 0)
    assert (crash["crashes"], crash["lane_changes"], crash["lane_changes_alike"]) == (2, 1, 1)
    assert crash["max_position"] == 0.5
    assert crash["max_position_before_contact"] == pytest.approx(1e-6, rel=1e-6)
    assert (crash["flips"], crash["flips_before_contact"]) == (1, 0)
    assert crash["crash_flags_equal"]
