"""Last test of added effects: they must not make simulations of the check drivers worse.

Their evidence comes from one-step predictions, in which noise that differs from the observer's assumptions can look
like an effect. A simulation accumulates the influence of an effect over time.
"""

from dataclasses import replace

from rearl_jax.discovery.observe.closed_loop import gap_errors
from rearl_jax.discovery.observe.fit import recalibrated
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.search.outcome import Search, is_free
from rearl_jax.discovery.search.simulation import share_worse
from rearl_jax.discovery.thresholds import THRESHOLDS


def confirmed(solver: Solver, outcome: Search, seed: int) -> Search:
    """The search without those additions that make the closed-loop gap error of the check drivers larger.

    Additions are removed from the last one backwards. A free curve (effect without a name) after the first addition may
    only fit the remainder of earlier additions, so it is removed if it increases the error in more than half of the
    resamples of drivers. Then any addition is removed as long as the error is significantly larger than with none.
    """
    if not outcome.added:
        return outcome
    fits = [outcome.first, *(trial.fit for trial in outcome.added)]
    errors = gap_errors(solver, [recalibrated(solver, outcome.checked, fit) for fit in fits])
    kept = len(outcome.added)
    while (
        kept > 1 and is_free(outcome.added[kept - 1]) and share_worse(errors[kept - 1], errors[kept], seed=seed) > 0.5
    ):
        kept -= 1
    while kept and share_worse(errors[0], errors[kept], THRESHOLDS.borne_growth, seed) >= THRESHOLDS.rejection_share:
        kept -= 1
    if kept == len(outcome.added):
        return outcome
    last = outcome.rounds[kept]
    rounds = [*outcome.rounds[:kept], replace(last, accepted=[], dropped=last.accepted)]
    return replace(outcome, rounds=rounds, rejected=[*outcome.rejected, *outcome.added[kept:]])
