"""Kinds of drivers in measured drives: told apart where there are two, one where there is one."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.groups import kinds
from rearl_jax.discovery.observe.base import base_of
from rearl_jax.discovery.observe.fit_state import replaced
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.search.simulated_drives import simulate_again

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def calibrated_many(measured_of):
    """Drivers of one recording without anything missing, calibrated."""
    data = measured_of(None, 1.0, n_vehicles=48, duration=60.0)
    solver = solver_of(data)
    return solver, base_of(solver, data, lane_changes=False).fit


def test_drivers_of_one_kind_are_one_kind(calibrated_many):
    solver, fit = calibrated_many
    assert fit.state.data.n_drivers == 45
    assert kinds.kinds_of(kinds.driver_likelihoods(solver, fit), 0).n == 1


def test_controllers_are_told_from_people(calibrated_many):
    """A third drives with twice the time gap and a quarter of the noise."""
    solver, fit = calibrated_many
    is_machine = np.arange(45) % 3 == 0
    place = solver.layout.prior.names.index("time_gap")
    state = replaced(fit.state, z=fit.state.z.copy())
    state.z[is_machine, place] += np.log(2.0) / solver.layout.prior.spread[place]
    solver.sums([state])
    machines = replaced(state, data=state.data)
    quiet = replace(fit.noise, acceleration=fit.noise.acceleration / 4)
    drives = [
        simulate_again(solver, one, noise, np.random.default_rng(k))
        for k, (one, noise) in enumerate([(state, fit.noise), (machines, quiet)])
    ]
    chosen = is_machine[state.data.driver]
    whole, smooth, speed = (
        np.where(chosen, *(getattr(drive.data, name) for drive in reversed(drives)))
        for name in ("y", "smooth", "smooth_speed")
    )
    data = replace(state.data, y=whole, smooth=smooth, smooth_speed=speed)
    again = base_of(solver, data, lane_changes=False).fit
    found = kinds.kinds_of(kinds.driver_likelihoods(solver, again), 0)
    assert found.n == 2
    labels = ["machine" if one else "person" for one in is_machine]
    share = kinds.purity(found.of_driver, labels, 0)
    assert share is not None
    assert share["value"] > 0.9 > share["by_chance"] + 0.1
