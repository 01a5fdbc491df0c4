"""Drives in a part to find drivers' own parameters on and a part to test them on."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.read.training import MOST_FOLDS, UNKNOWN, halves, has_enough_data, left_out_runs


@pytest.fixture(scope="module")
def data(measured_of):
    return measured_of()


def seconds(data):
    return data.driver_minutes * 60


def in_two_pieces(data):
    """The same drives, each as two pieces of one driver, the later piece first."""
    middle = len(data.y) // 2
    late = (np.arange(len(data.y)) >= middle)[:, None]
    second = data.surroundings.time[middle]
    later = replace(
        data, weight=data.weight * late, surroundings=replace(data.surroundings, time=data.surroundings.time + second)
    )
    return later.with_drivers(replace(data, weight=data.weight * ~late)), data.n_drivers


def test_a_half_is_tested_from_where_it_begins_and_nothing_counts_twice(data):
    split = halves(data)
    trained, tested = seconds(split.training), seconds(split.test)
    assert (trained > 10).all()
    np.testing.assert_allclose(trained + tested, seconds(data), atol=1e-9)
    assert np.abs(trained - tested).max() <= data.dt * data.stride + 1e-9
    for piece in range(len(data.driver)):
        first = np.flatnonzero((data.weight - split.training.weight)[:, piece] > 0)[0]
        assert first > 0
        assert split.test.weight[0, piece] == 1
        for name in ("y", "smooth", "smooth_speed", "leader"):
            values = getattr(data, name)[first:, piece]
            np.testing.assert_array_equal(getattr(split.test, name)[: len(values), piece], values)
        values = data.surroundings.leader_rear[first:, piece]
        np.testing.assert_array_equal(split.test.surroundings.leader_rear[: len(values), piece], values)
        assert not split.test.weight[len(values) :, piece].any()


def test_the_half_of_a_driver_is_that_of_its_time_not_of_its_pieces(data):
    pieces, n = in_two_pieces(data)
    pieces = replace(pieces, driver=pieces.driver % n)
    split = halves(pieces)
    np.testing.assert_allclose(seconds(split.training), seconds(halves(data).training), atol=data.dt * data.stride)
    early, late = pieces.weight[:, n:].sum(axis=0), pieces.weight[:, :n].sum(axis=0)
    assert (early > 0).all()
    is_late_trained = (split.training.weight[:, :n] > 0).any(axis=0)
    np.testing.assert_array_equal(is_late_trained, early < late - 1)
    unmoved = ~is_late_trained
    np.testing.assert_array_equal(split.test.y[:, :n][:, unmoved], pieces.y[:, :n][:, unmoved])


def test_drivers_who_are_seen_too_shortly_are_left_out(data):
    short = data.weight.copy()
    short[round(15 / data.dt) :, 3] = 0
    split = halves(replace(data, weight=short))
    assert list(np.flatnonzero(~has_enough_data([split]))) == [3]


def test_every_run_is_left_out_once_and_only_the_others_train_for_it(data):
    same = np.arange(data.n_drivers) // 3
    same[:3] = UNKNOWN
    same[3] = 100  # one run alone
    splits = left_out_runs(replace(data, identity=same[data.driver]))
    chosen = np.flatnonzero((same > 0) & (same < 100))
    pieces = np.flatnonzero(np.isin(data.driver, chosen))
    weight, total = data.weight[:, pieces], np.zeros_like(data.weight[:, pieces])
    assert splits[0].test.n_drivers == len(np.unique(same[chosen]))
    for split in splits:
        assert not ((split.training.weight > 0) & (split.test.weight > 0)).any()
        for driver in range(split.test.n_drivers):
            own = split.test.driver == driver
            runs = (split.test.weight[:, own] > 0).any(axis=0)
            assert runs.sum() <= 1
        total += split.test.weight
    np.testing.assert_array_equal(total, weight)


def test_many_runs_are_left_out_in_a_few_parts_in_order_of_time(data):
    splits = left_out_runs(replace(data, identity=np.zeros(len(data.driver), int)))
    assert data.n_drivers > 2 * MOST_FOLDS
    assert len(splits) == MOST_FOLDS
    parts = [np.flatnonzero((split.test.weight > 0).any(axis=0)) for split in splits]
    assert np.concatenate(parts).tolist() == list(range(len(data.driver)))


def test_there_is_nothing_to_leave_out_where_nobody_has_two_runs(data):
    for identity in (data.driver, np.full(len(data.driver), UNKNOWN)):
        assert left_out_runs(replace(data, identity=identity)) == []
