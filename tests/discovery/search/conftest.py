"""Trials of candidates with given gains."""

import numpy as np
import pytest


@pytest.fixture
def trial(calibrated):
    """A trial with given gains."""
    from rearl_jax.discovery.observe.candidates import Candidate, Term
    from rearl_jax.discovery.observe.fit import Fit
    from rearl_jax.discovery.search.decision import Trial

    def make(name, fitted, checked, penalty=2.0, kind="driver", variable="speed", null_mean=0.0):
        candidate, fit = Candidate(Term(name), kind, (0,), (0,), (variable,)), Fit(None, *calibrated)
        return Trial(
            candidate, fit, np.asarray(fitted, float), np.asarray(checked, float), fit.state, penalty, null_mean
        )

    return make
