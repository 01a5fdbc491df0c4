"""The screen: what counts as evidence for a candidate, and what does not."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.observe.candidates import LENS, Term
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.read.fused_errors import FusedErrors
from rearl_jax.discovery.search.screen import evidences, scores


@pytest.mark.parametrize("term", ["grade", "dependence.position", "speed_limit", "weather"])
def test_what_is_the_same_everywhere_is_no_evidence(solver, calibrated, term):
    """A constant acceleration, or another usual speed, is the drivers' own: their parameters and priors take it up."""
    (seen,) = scores(solver, [calibrated[0]])
    score = seen[Term.read(term)]
    n_curves = 2 if term == "weather" else 1  # one of desired speeds, one of time gaps
    constant = np.kron(np.eye(n_curves), np.ones(len(score.score) // n_curves))
    of_one = np.abs(np.diag(score.information)).max()
    assert of_one > 0.0
    np.testing.assert_allclose(constant @ score.score, 0.0, atol=1e-6 * np.sqrt(of_one))
    np.testing.assert_allclose(constant @ score.information @ constant.T, 0.0, atol=1e-9 * of_one)


def test_data_sets_with_and_without_a_camera_are_screened_in_one_process(solver, calibrated):
    """Their programs differ: positions that every vehicle measures itself have no camera distortion as a candidate."""
    state, _ = calibrated
    found = []
    for errors in (None, FusedErrors(0.1, 0.5, 20.0, 0.03, 0.0, 0.3)):
        own_solver = solver_of(replace(state.data, fused_errors=errors))
        (seen,) = scores(own_solver, [state])
        found.append(evidences(state, seen, own_solver.layout))
    with_camera, without = found
    assert with_camera.keys() - without.keys() == {LENS}
    for term, evidence in without.items():
        assert evidence == pytest.approx(with_camera[term], abs=1e-3)
