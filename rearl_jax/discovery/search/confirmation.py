"""The last word of the drivers that were checked: what is added must not make their simulation worse.

Evidence is gathered from one time step to the next, where noise that is not as the observer takes it may look like an
effect; a simulation adds up what an effect does.
"""

from dataclasses import replace

from rearl_jax.discovery.observe.candidates import LENS
from rearl_jax.discovery.observe.closed_loop import gap_errors
from rearl_jax.discovery.observe.fit import on_others
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.procedure import Search, is_free
from rearl_jax.discovery.search.simulation import share_worse
from rearl_jax.discovery.thresholds import THRESHOLDS


def confirmed(solver: Solver, outcome: Search, seed: int) -> Search:
    """The search, without additions with which the closed-loop gap error of the checked drivers is larger.

    They go from the last one on: free curves that were added later, which fit what the form of the earlier additions
    has left, where they more likely make it larger than smaller; then all as long as it surely is larger than before.
    """
    if not outcome.added:
        return outcome
    fits = [outcome.first, *(trial.fit for trial in outcome.added)]
    errors = gap_errors(solver, on_others(solver, outcome.checked, fits))
    kept = len(outcome.added)
    while (
        kept > 1 and is_free(outcome.added[kept - 1]) and share_worse(errors[kept - 1], errors[kept], seed=seed) > 0.5
    ):
        kept -= 1
    while kept and share_worse(errors[0], errors[kept], THRESHOLDS.borne_growth, seed) >= THRESHOLDS.rejection_share:
        kept -= 1
    if kept == len(outcome.added):
        return outcome
    rounds = [*outcome.rounds[:kept], replace(outcome.rounds[kept], accepted=[])]
    return replace(outcome, rounds=rounds, rejected=outcome.added[kept:])


def clocks_confirmed(solver: Solver, outcome: Search, checked: Measured, seed: int) -> bool:
    """True if the closed-loop gap error of the checked drivers is more likely smaller than larger with their clocks put
    right, those of `checked` as they were measured. The search takes other irregularities for clocks too, a simulation
    does not.
    """
    if outcome.clocks is None:
        return True
    states = [
        *on_others(solver, checked, [outcome.before]),
        *on_others(solver, outcome.checked, [outcome.first]),
    ]
    before, after = gap_errors(solver, states)
    return share_worse(before, after, seed=seed) < 0.5


def lens_confirmed(solver: Solver, outcome: Search, seed: int) -> bool:
    """True if the closed-loop gap error of the checked drivers is more likely smaller than larger with the camera's
    distortion, which takes other irregularities in as well.
    """
    for turn in outcome.rounds:
        if turn.chosen is not None and turn.chosen.candidate.term == LENS:
            states = on_others(solver, outcome.checked, [turn.base, turn.chosen.fit])
            before, after = gap_errors(solver, states)
            return share_worse(before, after, seed=seed) < 0.5
    return True
