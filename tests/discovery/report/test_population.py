"""The verdict's entry on the calibrated drivers' own parameters."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.fit_state import replaced
from rearl_jax.discovery.report.population import population_block, population_section
from rearl_jax.discovery.report.repaired import population


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


def test_drivers_of_a_model_differ_as_much_as_those_it_was_fitted_to_however_little_is_known_of_each(
    solver, drivers, calibrated
):
    # Each driver's data leave half of the variance between drivers, so the estimates scatter with the other half.
    n, n_own = drivers.z.shape
    drivers.spread = np.ones(n_own)
    drivers.sums = replace(drivers.sums, gram=np.broadcast_to(np.eye(n_own), (n, n_own, n_own)).copy())
    drivers.sums.gram[:] *= drivers.variances[:, None, None]
    away = np.sqrt(0.5) * np.where(np.arange(n) % 2, 1.0, -1.0)[:, None]
    drivers.z = drivers.mean[drivers.truck] + away
    found = population(Fit(None, drivers, calibrated[1]), drivers.data, solver.layout.prior)
    for members in found.values():
        np.testing.assert_allclose(np.diag(members.log_covariance), solver.layout.prior.spread**2, rtol=1e-3)
