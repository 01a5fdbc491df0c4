"""Effects named when many drivers are at a bound of their parameters: only what holds without bounds is stated."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.comparison import dependence
from rearl_jax.discovery.comparison.dependence import without_bounds
from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.drivers import IDM_PRIOR
from rearl_jax.discovery.observe.fit_state import replaced
from rearl_jax.discovery.observe.noise import calibrate
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.thresholds import THRESHOLDS
from tests.discovery.search.searches import search_that_added

DELAY = Term("reaction_delay")


def search_beside_bounds(solver, calibrated, share):
    """A search that has added a delay to drivers of whom a share is at the bound of the largest acceleration."""
    state, noise = replaced(calibrated[0]), calibrated[1]
    place = solver.layout.prior.names.index("max_accel")
    state.z[: int(np.ceil(share * len(state.z))), place] = solver.layout.prior.bounds[1][0, place]
    solver.sums([state])
    found = search_that_added(solver, (state, noise), (str(DELAY), [0.7, 0.0]))
    return replace(found, null=Null({DELAY: 0.0}, {}, 1))


def test_parameters_without_bounds_may_have_any_value():
    low, high = replace(IDM_PRIOR, is_bounded=False).bounds
    assert low.shape == high.shape == IDM_PRIOR.bounds[0].shape
    assert np.isneginf(low).all()
    assert np.isposinf(high).all()
    assert np.isfinite(IDM_PRIOR.bounds).all()


def test_nothing_is_fitted_where_few_drivers_are_at_a_bound(solver, calibrated, measured_of, monkeypatch):
    monkeypatch.setattr(dependence, "_found_again", None)  # would be called
    for found in (search_beside_bounds(solver, calibrated, 0.0), search_that_added(solver, calibrated)):
        assert without_bounds(solver, found, measured_of()) is found


@pytest.mark.slow
def test_a_delay_that_is_not_there_is_doubtful_beside_drivers_at_a_bound(solver, calibrated, measured_of):
    share = 2 * THRESHOLDS.most_at_bound
    found = search_beside_bounds(solver, calibrated, share)
    (trial,) = found.added
    assert not found.is_doubtful(trial)
    found = without_bounds(solver, found, measured_of())
    assert found.of_bounds == {DELAY}
    assert found.is_doubtful(trial)
    data = measured_of("reaction_delay")
    delayed = solver_of(data)
    found = search_beside_bounds(delayed, calibrate(delayed, data), share)
    assert without_bounds(delayed, found, data).of_bounds == frozenset()
