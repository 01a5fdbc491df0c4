"""The verdict's entry on the calibrated drivers' own parameters."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.observe.fit_state import replaced
from rearl_jax.discovery.report.population import population_block, population_section


@pytest.fixture
def drivers(solver, calibrated):
    """A calibrated state with its sums."""
    state = replaced(calibrated[0])
    solver.sums([state])
    return state


def test_the_middle_driver_and_the_spread_are_told(solver, drivers):
    found, prior = population_block(solver, drivers), solver.layout.prior
    assert tuple(found) == prior.names
    values = prior.values(drivers.z, drivers.truck)[:, prior.names.index("time_gap")]
    assert found["time_gap"]["value"] == pytest.approx(np.median(values), rel=1e-3)
    identified = {name: row["identified"] for name, row in found.items()}
    assert identified["time_gap"] > 0.8
    drivers.sums = replace(drivers.sums, gram=1e-3 * drivers.sums.gram)
    less = {name: row["identified"] for name, row in population_block(solver, drivers).items()}
    assert all(0 <= less[name] < identified[name] <= 1 for name in identified)
    assert all(row["at_bound"] == 0.0 for row in found.values())
    spread = dict(zip(prior.names, prior.spread * drivers.spread, strict=True))
    assert found["jam_gap"]["spread"] == pytest.approx(spread["jam_gap"])


def test_a_parameter_at_its_bound_is_said_to_be_there(solver, drivers):
    prior, stuck = solver.layout.prior, replaced(drivers)
    place = prior.names.index("max_accel")
    stuck.z[: len(stuck.z) // 2, place] = prior.bounds[1][0, place]
    solver.sums([stuck])
    found = population_block(solver, stuck)
    assert found["max_accel"]["at_bound"] == pytest.approx(0.5, abs=0.1)
    (note,) = [note for note in population_section({"population": found}).notes if "at its bound" in note]
    assert note.startswith("Max accel")


def test_a_parameter_that_data_do_not_tell_is_said_to_be_none_of_theirs():
    row = {"value": 2.0, "unit": "m/s^2", "spread": 0.3, "identified": 0.05, "at_bound": 0.0}
    section = population_section({"population": {"comfort_decel": row, "time_gap": row | {"identified": 0.9}}})
    assert [note.split(" is not identified")[0] for note in section.notes] == ["Comfort decel"]
    assert len(section.tables[0].rows) == 2
    assert not population_section({}).tables
