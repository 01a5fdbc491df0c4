"""Full fits of candidates: the model with each candidate, from several start values, with re-estimated noise."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rearl_jax.discovery.observe.candidates import CANDIDATE_EFFECTS, Candidate, Layout, Term
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.fit_state import FitState, replaced, with_noise
from rearl_jax.discovery.observe.noise import levels_up_to, under_best_noise
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.search.screen import Score

DELAYS = ((0.25, 0.25), (0.8, 0.8), (0.5, 0.0))
"""Reaction delays to the vehicle ahead and to the own speed that the search starts from [s]."""

LIMITS = (0.6, 0.75, 0.88)
"""Speed limits the search starts from, as shares of the mean desired speed [-]."""

SECTIONS = 2
"""Number of road sections, or times, from which the search for an edge starts."""

LONGEST_SECTION = 8
"""Largest number of knots that a section spans at the start."""


def starts(candidate: Candidate, score: Score, state: FitState, layout: Layout) -> list[np.ndarray]:
    """Start values of theta for the fit of a candidate."""
    theta = state.theta
    effect = candidate.term.effect if candidate.term.is_effect else ""
    if effect == "reaction_delay":
        names = ("reaction_delay.delay", "reaction_delay.own_delay")
        return [layout.with_values(theta, dict(zip(names, delays, strict=True))) for delays in DELAYS]
    if effect in ("grade", "speed_limit"):
        return _sections(effect, score, state, layout)
    if effect == "weather":
        return _onsets(score, theta, layout)
    start = theta.copy()
    if set(candidate.directions) <= set(candidate.free):
        # Half of the linear fit has the right sign and stays within the valid range of the model.
        fitted = np.clip(score.fitted() / 2, -1, 1) * np.minimum(1.0, layout.scale[list(candidate.directions)])
        start[list(candidate.directions)] += np.nan_to_num(fitted)
    return [np.clip(start, layout.low, layout.high)]


def _sections(name: str, score: Score, state: FitState, layout: Layout) -> list[np.ndarray]:
    """Start values with the road sections that explain most of the score of the curve along the road, as a constant on
    the section.
    """
    knots, n = layout.knots.position, len(layout.knots.position)
    step = knots[1] - knots[0]
    sections = []
    for first in range(n):
        for last in range(first, min(first + LONGEST_SECTION, n)):
            indicator = np.zeros(n)
            indicator[first : last + 1] = 1.0
            width = indicator @ score.information @ indicator
            if width > 0:
                gain = indicator @ score.score
                sections.append((gain**2 / width, first, last, gain / width))
    sections.sort(reverse=True)
    chosen: list[tuple] = []
    for section in sections:
        # A second start only if it is a different place.
        if all(section[2] < other[1] or section[1] > other[2] for other in chosen):
            chosen.append(section)
        if len(chosen) == SECTIONS:
            break
    result = []
    for _, first, last, size in chosen:
        edges = {f"{name}.start": knots[first] - step / 2, f"{name}.end": knots[last] + step / 2}
        if name == "grade":
            result.append(layout.with_values(state.theta, {"grade.push": float(np.clip(size, -1, 1)), **edges}))
        else:
            mean_driver = layout.prior.values(state.mean[:1], np.zeros(1, int))[0]
            desired_speed = float(mean_driver[layout.prior.names.index("desired_speed")])
            result += [
                layout.with_values(state.theta, {"speed_limit.limit": desired_speed * share, **edges})
                for share in LIMITS
            ]
    # Drivers who never approach their desired speed carry no information on a limit: start without a limit.
    return result or [state.theta.copy()]


def _onsets(score: Score, theta: np.ndarray, layout: Layout) -> list[np.ndarray]:
    """Start values with the times from which a constant change explains most of the score of the curves over time."""
    knots = layout.knots.time
    n = len(knots)
    onsets = []
    for first in range(1, n):
        after = np.zeros((2, 2 * n))
        after[0, first:n], after[1, n + first :] = 1.0, 1.0
        information = after @ score.information @ after.T + 1e-9 * np.eye(2)
        size = np.linalg.solve(information, after @ score.score)
        onsets.append((float(size @ (after @ score.score)), first, size))
    onsets.sort(key=lambda item: -item[0])
    result = []
    for _, first, size in onsets[:SECTIONS]:
        slower, wider = np.clip([-size[0], size[1]], -0.5, 0.5).tolist()
        onset = (knots[first - 1] + knots[first]) / 2
        start = {"weather.slower": slower, "weather.wider": wider, "weather.onset": onset}
        result.append(layout.with_values(theta, start))
    return result


def refit(
    solver: Solver,
    base: Fit,
    candidates: Sequence[Candidate],
    seen: dict[Term, Score],
    progress: Callable[[int, int], None] | None = None,
) -> dict[Term, Fit]:
    """Fits of the model with each candidate separately, starting at values from its score.

    `progress` is called with the finished and the total number of candidates.
    """
    fits = {}
    for number, candidate in enumerate(candidates):
        active = (*base.state.active, candidate.term)
        states = [
            replaced(base.state, theta=theta, active=active)
            for theta in starts(candidate, seen[candidate.term], base.state, solver.layout)
        ]
        solver.solve(states, iterations=15, tolerance=0.3)
        best = min(states, key=lambda state: state.objective)
        again, noise = under_best_noise(solver, best, base.noise, levels_up_to(base.noise))
        # The new noise level need not be better: growth and share of the noise are still those at the old level.
        alternatives = (Fit(candidate, best, base.noise), Fit(candidate, again, noise))
        fits[candidate.term] = min(alternatives, key=lambda fit: fit.state.objective)
        if progress is not None:
            progress(number + 1, len(candidates))
    return fits


def nested(solver: Solver, base: Fit, fits: dict[Term, Fit]) -> dict[Term, Fit]:
    """The fits; a fit that is worse than the model without its candidate is repeated from that model.

    That model is nested in each fit, so a worse fit shows that the search stopped too early.
    """
    repeated = {}
    for term, fit in fits.items():
        if fit.state.objective > base.state.objective:
            again = replaced(base.state, active=fit.state.active, theta=_switched_off(solver.layout, base.state, fit))
            solver.solve([again], iterations=20, tolerance=0.05)
            fit = min(fit, replace(fit, state=again, noise=base.noise), key=lambda candidate: candidate.state.objective)
        repeated[term] = fit
    return repeated


def _switched_off(layout: Layout, base: FitState, fit: Fit) -> np.ndarray:
    """Parameters of the base model, and the places, times and ranges of the fitted candidate, whose strengths are off:
    from there the search can find its strength.
    """
    assert fit.candidate is not None
    theta, term = base.theta.copy(), fit.candidate.term
    if term.is_effect:
        of_effect = CANDIDATE_EFFECTS[term.effect].parameters
        kept = [layout.places[f"{term.effect}.{each.name}"][0] for each in of_effect if not each.is_strength]
        theta[kept] = fit.state.theta[kept]
    return theta


def rebased(solver: Solver, base: Fit, fits: dict[Term, Fit]) -> Fit:
    """The base model fitted again from the driver parameters and noise of each candidate's fit, because a base model in
    a local optimum would give every candidate the same false gain.
    """
    places, base_places = np.arange(solver.layout.size), solver.free(base.state)
    starts, noises = [], []
    for fit in fits.values():
        theta = np.where(np.isin(places, base_places), fit.state.theta, solver.layout.reference)
        for noise in dict.fromkeys((base.noise, fit.noise)):
            start = with_noise(base.state, noise)
            start.theta, start.z, start.mean = theta, fit.state.z.copy(), fit.state.mean.copy()
            starts.append(start)
            noises.append(noise)
    if starts:
        solver.solve(starts, iterations=15, tolerance=0.05)
    best, noise = min(
        zip([base.state, *starts], [base.noise, *noises], strict=True), key=lambda pair: pair[0].objective
    )
    return replace(base, state=best, noise=noise)
