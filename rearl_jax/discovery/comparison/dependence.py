"""Tests of the effects found under one car-following model: whether they hold in other models and without the bounds of
drivers' parameters, and whether another model fits better once they are added.

In a comparison of models without effects, a missing effect favours models that imitate it. So the models are compared
again with the effects found.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.comparison.choice import is_beaten
from rearl_jax.discovery.comparison.compared import calibrated_alike
from rearl_jax.discovery.observe.candidates import NAMED_KINDS, Term
from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.fit import Fit, recalibrated
from rearl_jax.discovery.observe.fit_state import FitState, replaced
from rearl_jax.discovery.observe.noise import levels_up_to, under_best_noise
from rearl_jax.discovery.observe.solver import Solver, solver_of
from rearl_jax.discovery.observe.uncertainty import shares_at_bound
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.decision import Trial, bounded_gains, trial_of
from rearl_jax.discovery.search.outcome import Search
from rearl_jax.discovery.search.refit import nested, rebased
from rearl_jax.discovery.thresholds import THRESHOLDS

MOST_OTHERS = 2
"""Largest number of other models in which the effects are tested."""


@dataclass(frozen=True)
class ModelTest:
    """The effects found, tested in another car-following model.

    Attributes:
        prior: Prior of the other model.
        holds: Whether each effect holds in that model if the effects before it that hold are part of the model.
        gains: Log-likelihood of each checked driver, with the effects that hold in that model, minus that under the
            chosen model with all effects found [nats]; own parameters are integrated out, and gains are bounded as in
            `bounded_gains`.
    """

    prior: Prior
    holds: Mapping[Term, bool]
    gains: Float[np.ndarray, " drivers"]


def effects_in_other_models(
    solver: Solver, outcome: Search, priors: Sequence[Prior], fitted: Measured
) -> list[ModelTest]:
    """Tests of the effects found in other models (`priors`, the most likely first); empty if no named effect was found.
    The knots of curves and the road sections follow from the fitted drivers as measured.
    """
    if not _named(outcome):
        return []
    chosen = recalibrated(solver, outcome.checked, outcome.last)
    tests = []
    for prior in priors[:MOST_OTHERS]:
        holds, other = _found_again(solver_of(fitted, prior), outcome)
        gains = bounded_gains(other.marginal() - chosen.marginal(), outcome.checked)
        tests.append(ModelTest(prior, holds, gains))
    return tests


def dependent_effects(outcome: Search, others: Sequence[ModelTest]) -> dict[Term, tuple[str, ...]]:
    """Names of the other models in which a named effect does not hold, by effect."""
    return {term: tuple(test.prior.name for test in others if not test.holds[term]) for term in _named(outcome)}


def with_doubts(outcome: Search, others: Sequence[ModelTest], seed: int) -> Search:
    """The search with `of_model`, the named effects that another model does without: they do not hold in it, and with
    the effects that do it is not significantly less likely than the chosen model with all of them.
    """
    alike = [test for test in others if not is_beaten(test.gains, [np.zeros_like(test.gains)], seed)]
    doubtful = frozenset(term for term in _named(outcome) if not all(test.holds[term] for test in alike))
    return replace(outcome, of_model=doubtful)


def without_bounds(solver: Solver, outcome: Search, fitted: Measured) -> Search:
    """The search with `of_bounds`, the named effects that do not hold if drivers' parameters may leave their bounds.
    The model cannot describe a driver at a bound well, and an effect may imitate the difference.

    Nothing is fitted if few drivers are at a bound, or if no named effect was found.
    """
    prior, named = solver.layout.prior, _named(outcome)
    states = (outcome.first.state, outcome.last.state)
    if not named or max(shares_at_bound(solver, state).max() for state in states) <= THRESHOLDS.most_at_bound:
        return outcome
    holds, _ = _found_again(solver_of(fitted, replace(prior, is_bounded=False)), outcome)
    return replace(outcome, of_bounds=frozenset(term for term in named if not holds[term]))


def better_model(others: Sequence[ModelTest], seed: int) -> Prior | None:
    """The most likely other model, with the effects found that hold in it, if the chosen one with all of them is
    significantly less likely, or if it is less likely and the other does without one of the effects; else None.
    """
    if not others:
        return None
    best = max(others, key=lambda test: float(test.gains.sum()))
    does_without = not all(best.holds.values()) and best.gains.sum() > 0
    return best.prior if does_without or is_beaten(np.zeros_like(best.gains), [best.gains], seed) else None


def _named(outcome: Search) -> list[Term]:
    """Terms of the added effects that have a name."""
    return [trial.candidate.term for trial in outcome.added if trial.candidate.kind in NAMED_KINDS]


def _found_again(solver: Solver, outcome: Search) -> tuple[dict[Term, bool], FitState]:
    """By added effect, whether it holds in another model that contains the effects before it that hold; and the state
    of the check drivers with all effects that hold.
    """
    fit = calibrated_alike(solver, outcome.first.state.data, outcome.first)
    holds, checked = {}, None
    for trial in outcome.added:
        term = trial.candidate.term
        fits = {term: _with_effect(solver, fit, trial)}
        fit = rebased(solver, fit, fits)
        after = nested(solver, fit, fits)[term]
        without, with_effect = (recalibrated(solver, outcome.checked, each) for each in (fit, after))
        holds[term] = trial_of(solver, after, fit.state, with_effect, without, outcome.null.null_mean(term)).holds
        fit, checked = (after, with_effect) if holds[term] else (fit, without)
    assert checked is not None
    return holds, checked


def _with_effect(solver: Solver, fit: Fit, trial: Trial) -> Fit:
    """The model with the effect of a trial under another model, fitted from the parameters found there."""
    places, theta = list(trial.candidate.free), fit.state.theta.copy()
    theta[places] = trial.fit.state.theta[places]
    state = replaced(fit.state, theta=theta, active=(*fit.state.active, trial.candidate.term))
    solver.solve([state], iterations=15, tolerance=0.3)
    state, noise = under_best_noise(solver, state, fit.noise, levels_up_to(fit.noise))
    return Fit(trial.candidate, state, noise)
