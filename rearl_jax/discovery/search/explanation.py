"""Check if a search explains the drivers, and if a search beside another model names what the first left unnamed."""

from rearl_jax.discovery.observe.closed_loop import gap_errors
from rearl_jax.discovery.observe.fit import on_others
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.search.adequacy import adequacy
from rearl_jax.discovery.search.decision import bounded_gains
from rearl_jax.discovery.search.procedure import Search, is_free
from rearl_jax.discovery.search.simulation import share_worse, simulated_gains
from rearl_jax.discovery.thresholds import THRESHOLDS


def is_explained(solver: Solver, outcome: Search, seed: int) -> bool:
    """True if every effect found has a name without a doubt, and only noise is left; also if no effect was found."""
    if outcome.rejected or outcome.is_contradicted or outcome.leaves_shifts:
        return False
    if not outcome.added and outcome.leaves_more:
        return False
    if any(is_free(trial) or outcome.is_doubtful(trial) for trial in outcome.added):
        return False
    return adequacy(solver, outcome, seed).is_enough


def names_more(solver: Solver, outcome: Search, other: Solver, named: Search, seed: int) -> bool:
    """True if a search beside another model accounts for the drivers by names, and predicts other drivers better than
    the one that does not.
    """
    if not named.added or not is_explained(other, named, seed):
        return False
    return predicts_better(solver, outcome, other, named, seed)


def predicts_better(solver: Solver, outcome: Search, other: Solver, named: Search, seed: int) -> bool:
    """True if a search beside another model predicts the check drivers better: one time step ahead and in simulations
    together, and these are not significantly worse.
    """
    (before,) = on_others(solver, outcome.checked, [outcome.last])
    (after,) = on_others(other, named.checked, [named.last])
    gains = bounded_gains(after.marginal() - before.marginal(), named.checked)
    (error,), (error_after,) = gap_errors(solver, [before]), gap_errors(other, [after])
    of_simulations = simulated_gains(error, error_after, named.checked)
    is_worse = share_worse(error, error_after, THRESHOLDS.borne_growth, seed) >= THRESHOLDS.rejection_share
    return float(gains.sum() + of_simulations.sum()) > 0 and not is_worse
