"""Effects that were found under one car-following model, looked for under others: does it need that model?"""

from collections.abc import Mapping, Sequence

from rearl_jax.discovery.comparison.compared import calibrated_alike
from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.fit import Fit, on_others
from rearl_jax.discovery.observe.fit_state import copied
from rearl_jax.discovery.observe.noise import no_larger, noises, under_best_noise
from rearl_jax.discovery.observe.solver import Solver, solver_of
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.decision import Trial, trial_of
from rearl_jax.discovery.search.procedure import Search
from rearl_jax.discovery.search.refit import nested, rebased

MOST_OTHERS = 2
"""Other models under which effects are looked for at most."""


def dependent_effects(outcome: Search, priors: Sequence[Prior], fitted: Measured) -> dict[Term, tuple[str, ...]]:
    """Names of the other models under which an effect does not hold, by effect; only effects with a name.

    Args:
        outcome: What was found under the chosen model.
        priors: The other models, the most likely first.
        fitted: The fitted drivers as they were measured, which curves and sections are laid out for.
    """
    named = [trial for trial in outcome.added if trial.candidate.kind in ("driver", "road")]
    if not named:
        return {}
    without: dict[Term, list[str]] = {trial.candidate.term: [] for trial in named}
    for prior in priors[:MOST_OTHERS]:
        solver = solver_of(fitted, prior)
        for term, holds in _holding(solver, outcome).items():
            if term in without and not holds:
                without[term].append(prior.name)
    return {term: tuple(names) for term, names in without.items()}


def _holding(solver: Solver, outcome: Search) -> Mapping[Term, bool]:
    """Whether each addition holds under another model beside those before it."""
    fit = calibrated_alike(solver, outcome.first.state.data, outcome.first)
    found = {}
    for trial in outcome.added:
        term = trial.candidate.term
        fits = {term: _with(solver, fit, trial)}
        fit = rebased(solver, fit, fits)
        after = nested(solver, fit, fits)[term]
        before, other = on_others(solver, outcome.checked, [fit, after])
        found[term] = trial_of(solver, after, fit.state, other, before, outcome.null.null_mean(term)).holds
        fit = after
    return found


def _with(solver: Solver, fit: Fit, trial: Trial) -> Fit:
    """A model with the addition of another one, which begins at what was found there."""
    places, theta = list(trial.candidate.free), fit.state.theta.copy()
    theta[places] = trial.fit.state.theta[places]
    state = copied(fit.state, theta=theta, active=(*fit.state.active, trial.candidate.term))
    solver.solve([state], iterations=15, tolerance=0.3)
    return Fit(trial.candidate, *under_best_noise(solver, state, noises(fit.noise, no_larger(fit.noise))))
