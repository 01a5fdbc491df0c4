"""Searches that have added something, made without searching."""

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.fit_state import replaced
from rearl_jax.discovery.search.decision import Trial
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.search.outcome import Round, Search


def search_that_added(solver, calibrated, *added):
    """A search that has added candidates with some numbers, one after the other."""
    state, noise = calibrated
    rounds, fit = [], Fit(None, state, noise)
    gains = state.penalised() * 0.0 + 10.0
    for name, values in added:
        candidate = solver.layout.candidates[Term.read(name)]
        theta = fit.state.theta.copy()
        theta[list(candidate.free)] = values
        changed = replaced(state, theta=theta, active=(*fit.state.active, candidate.term))
        trial = Trial(candidate, Fit(candidate, changed, noise), gains, gains, changed, 0.0)
        rounds.append(Round(fit, {}, {}, {}, frozenset(), [trial], [trial]))
        fit = trial.fit
    rounds.append(Round(fit, {}, {}, {}, frozenset(), [], []))
    return Search(solver.layout, Null({}, {}, 1), {}, state.data, None, rounds)
