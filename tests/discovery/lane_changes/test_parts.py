"""Fitted, checked and reported drivers."""

from types import SimpleNamespace

import numpy as np

from rearl_jax.discovery.claims import Estimate
from rearl_jax.discovery.lane_changes import selection
from rearl_jax.discovery.lane_changes.incentives import KnownDrivers
from rearl_jax.discovery.lane_changes.opportunities import opportunities
from rearl_jax.discovery.lane_changes.selection import part_of_rows
from rearl_jax.discovery.lane_changes.trials import NAMEABLE, CandidateColumns, Trial
from tests.discovery.lane_changes.made import by_mobil


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


def test_a_loss_that_is_the_same_at_every_opportunity_has_no_interval(monkeypatch):
    table = by_mobil(1, n=6000, drivers=300)
    table = table.take(np.flatnonzero(np.arange(6000) % 20 <= table.vehicle % 17))  # drivers with 1 to 17 opportunities
    columns = CandidateColumns(table, table.vehicle % 3, 0)

    def fitted(effects, *_):
        return SimpleNamespace(log_likelihood=lambda data, _: np.full(len(data.gain), -0.1 + 0.02 * effects.shape[1]))

    monkeypatch.setattr(columns, "fitted", fitted)
    added = [Trial(NAMEABLE[0], NAMEABLE[0].forms[0], 5.0, 9.0, 9.0, True)]
    loss = selection._loss(columns, added, 0.9)
    assert np.allclose((loss.before, loss.after), (0.1, 0.08))
    assert isinstance(loss.change, Estimate)
    assert np.allclose((loss.change.value, loss.change.low, loss.change.high), -0.02)
