"""Fitted, checked and reported drivers."""

import numpy as np

from rearl_jax.discovery.lane_changes.incentives import KnownDrivers
from rearl_jax.discovery.lane_changes.opportunities import opportunities
from rearl_jax.discovery.lane_changes.selection import part_of_rows


def scene(n):
    return [(100.0 + 40.0 * k, 20.0 + 0.1 * (k % 3), k % 3, "car") for k in range(n)]


def table_of(recording, n_recordings):
    return opportunities([recording(scene(45), seconds=4.0)] * n_recordings, KnownDrivers.of([]))[0]


def test_whole_recordings_without_a_split(recording):
    table = table_of(recording, 3)
    part = part_of_rows(table, None, 0)
    assert len(table.side) > 100
    assert {(int(r), int(p)) for r, p in zip(table.recording, part, strict=True)} == {(0, 0), (1, 1), (2, 2)}


def test_no_driver_is_in_two_parts_and_a_split_is_kept(recording):
    table = table_of(recording, 1)
    drivers = np.unique(table.vehicle)
    split = [drivers[:5], drivers[5:10], drivers[10:15]]
    part = part_of_rows(table, split, 0)
    for driver in drivers:
        assert len(set(part[table.vehicle == driver])) == 1
    for number, members in enumerate(split):
        assert set(part[np.isin(table.vehicle, members)]) == {number}
    assert set(part[np.isin(table.vehicle, drivers[15:])]) == {0, 1, 2}


def test_the_rest_of_a_recording_goes_where_its_drivers_are(recording):
    table = table_of(recording, 3)
    split = [table.vehicle[table.recording == r][:1] for r in (2, 0, 1)]
    part = part_of_rows(table, split, 0)
    assert [set(part[table.recording == r]) for r in range(3)] == [{1}, {2}, {0}]
