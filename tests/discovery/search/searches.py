"""Searches, their rounds and trials, made without searching."""

from dataclasses import replace

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.fit_state import replaced
from rearl_jax.discovery.search.adequacy import Adequacy
from rearl_jax.discovery.search.decision import Trial
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.search.outcome import Round, Search

ADEQUATE = Adequacy(
    kurtosis=0.0,
    kurtosis_deviation=0.02,
    kurtosis_before=0.0,
    autocorrelation=0.0,
    autocorrelation_by_noise=0.0,
    unequal_noise={},
    misjudgement=-4.0,
    staleness=-1.0,
    remaining=(Term("grade"), 1.0),
    driver_minutes=70.0,
)
"""Nothing but noise is left."""


def round_of(calibrated, trials=(), accepted=(), exceeding=(), **changes):
    """A round from the calibrated model, with trials; `exceeding` are names of candidates."""
    terms = frozenset(map(Term, exceeding))
    return Round(Fit(None, *calibrated), {}, {}, {}, terms, list(trials), list(accepted), **changes)


def search_of(solver, calibrated, *rounds, **changes):
    """A search of these rounds."""
    return Search(solver.layout, Null({}, {}, 1), {}, calibrated[0].data, rounds=list(rounds), **changes)


def fitted_at(trial, values):
    """The trial with these values of its candidate's elements of theta."""
    theta = trial.fit.state.theta.copy()
    theta[list(trial.candidate.free)] = values
    return replace(trial, fit=replace(trial.fit, state=replace(trial.fit.state, theta=theta)))


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
        rounds.append(replace(round_of(calibrated, [trial], [trial]), base=fit))
        fit = trial.fit
    return search_of(solver, calibrated, *rounds, replace(round_of(calibrated), base=fit))
