"""The screen: what counts as evidence for a candidate, and what does not."""

import numpy as np
import pytest

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.search.screen import scores


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
