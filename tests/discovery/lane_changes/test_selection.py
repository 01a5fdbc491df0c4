"""Whether there is anything to name: changes for a gain, and changes into whatever gap is long enough."""

import numpy as np

from rearl_jax.discovery.lane_changes.selection import why_nothing_is_named
from rearl_jax.discovery.lane_changes.trials import CandidateColumns
from tests.discovery.lane_changes.made import by_mobil, made


def reason(table):
    columns = CandidateColumns(table, np.unique(table.vehicle, return_inverse=True)[1] % 3, 0)
    return why_nothing_is_named(columns, int(table.changes.sum()))


def test_a_gain_is_a_reason():
    table = by_mobil(3)
    assert table.changes.sum() > 500
    assert reason(table) == ""


def test_an_accepted_gap_is_none():
    rng, n, drivers = np.random.default_rng(3), 60_000, 600
    rear_gap = rng.uniform(5.0, 60.0, n)
    gain = 0.02 * (rear_gap - 30.0) + rng.normal(0.0, 0.5, n)  # where gaps are long, there is more to gain
    changes = rng.random(n) < 0.02 * np.exp((rear_gap - 60.0) / 30.0)
    vehicle = np.repeat(np.arange(drivers), n // drivers)
    table = made(n, vehicle=vehicle, incentive=gain, rear_gap=rear_gap, changes=changes)
    assert table.changes.sum() > 500
    assert table.incentive[table.changes].mean() > table.incentive.mean() + 0.1
    assert "do not depend on the gain" in reason(table)
