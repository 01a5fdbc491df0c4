"""The calibrated base model that all candidates (effects that may be missing) are compared with: drivers, population,
noise, and lane changes.

Every recording of several lanes shows that drivers respond to a new leader before the lane column changes, and accept
short gaps for a while afterwards. If the base model did not contain these two effects, they would dominate the
residuals and hide all others.
"""

from dataclasses import dataclass, replace

import numpy as np

from rearl_jax.discovery.observe.candidates import LANE_CHANGES, Term
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.fit_state import replaced, with_noise
from rearl_jax.discovery.observe.noise import calibrate, under_best_noise, with_growth_and_independence
from rearl_jax.discovery.observe.observer import is_near_change
from rearl_jax.discovery.observe.residuals import smoothed_acceleration
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.thresholds import THRESHOLDS

STARTS = {
    "early_leader": tuple(
        {f"early_leader.{who}": 0.5 for who in ("of_changer", "of_follower", "of_former")}
        | {"early_leader.lead_time": lead}
        for lead in (0.3, 2.0)
    ),
    "relaxation": ({"relaxation.gap_share": 0.3},),
}
"""Start values of the fit of each effect, by parameter: strengths away from their bounds (where the fit would be
stuck), and two lead times [s].
"""

LEAST_NEAR_CHANGES, MOST_NEAR_CHANGES = 1.1, 50.0
"""Ratio of the energy of the acceleration residual near changes of leader and elsewhere from which they have less
weight, and the largest that is used [-].
"""


@dataclass(frozen=True)
class Base:
    """A calibrated model.

    Attributes:
        bare: The driver model without effects of lane changes.
        extended: The model with the first of LANE_CHANGES, and the model with both; empty if too few leaders change.
        weighted: The last model again, with less weight near changes of leader; None if they are predicted as well as
            the rest.
    """

    bare: Fit
    extended: tuple[Fit, ...] = ()
    weighted: Fit | None = None

    @property
    def fit(self) -> Fit:
        """The model with all its effects of lane changes."""
        return self.weighted or (self.extended[-1] if self.extended else self.bare)


def leader_changes(data: Measured) -> int:
    """Number of changes of leader in the data."""
    return int((np.diff(data.surroundings.time_since_change, axis=0) < 0).sum())


def base_of(solver: Solver, data: Measured, *, lane_changes: bool = True) -> Base:
    """Calibrated drivers, with the effects of lane changes if these are requested and there are enough of them."""
    state, noise = calibrate(solver, data)
    bare = Fit(candidate=None, state=state, noise=noise)
    if not lane_changes or leader_changes(data) < THRESHOLDS.least_leader_changes:
        return Base(bare)
    extended, fit = [], bare
    for term in LANE_CHANGES:
        fit = _with_effect(solver, fit, term)
        extended.append(fit)
    return Base(bare, tuple(extended), weighted_near_changes(solver, fit))


def _with_effect(solver: Solver, fit: Fit, term: Term) -> Fit:
    """The model `fit` with one more effect of lane changes, fitted from the best of its start values."""
    active = (*fit.state.active, term)
    states = [
        replaced(fit.state, theta=solver.layout.with_values(fit.state.theta, start), active=active)
        for start in STARTS[term.effect]
    ]
    solver.solve(states, iterations=20, tolerance=0.1)
    best = min(states, key=lambda state: state.objective)
    state, noise = under_best_noise(solver, best, fit.noise)
    return Fit(solver.layout.candidates[term], state, noise)


def weighted_near_changes(solver: Solver, fit: Fit) -> Fit | None:
    """The model `fit` with noise that is larger near changes of leader, where its acceleration residual is larger; None
    if it is not larger.

    How a lane change is carried out differs from driver to driver. What the effects of lane changes leave unexplained
    would otherwise determine the drivers' parameters and give evidence for other effects.
    """
    state, noise = fit.state, fit.noise
    data = state.data
    (innovation,) = solver.innovations([state])
    residual = smoothed_acceleration(innovation, data.weight, noise, data.dt, data.stride)
    energy, near = residual**2 / state.variances[data.driver], is_near_change(data)
    of_near, elsewhere = (
        float((energy * data.weight)[part].sum() / max(data.weight[part].sum(), 1.0)) for part in (near, ~near)
    )
    ratio = min(of_near / max(elsewhere, 1e-12), MOST_NEAR_CHANGES)
    if ratio < LEAST_NEAR_CHANGES:
        return None
    noise = with_growth_and_independence(solver, state, replace(noise, near_changes=ratio - 1))
    state = with_noise(state, noise)
    solver.solve([state], iterations=20, tolerance=0.1)
    return Fit(fit.candidate, *under_best_noise(solver, state, noise))
