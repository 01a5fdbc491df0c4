"""Shares of components in the reduction of an error: over all admissible orders, and in the stated order alone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from rearl_jax.study.budget.components import Row

Errors = Mapping[Row, Float[np.ndarray, " scenes"]]
"""Error of each row, scene by scene; NaN where there is none."""


@dataclass(frozen=True)
class Shares:
    """Share of each component in the reduction of an error from the first row to the row with all components.

    Attributes:
        components: The components, in the stated order.
        by_component: Shapley share of each component, scene by scene; NaN in scenes in which some row has no error.
        stated: Reduction by each component in the stated order, mean over these scenes.
        by_order: Reduction by each component in each order, mean over these scenes.
        whole: Reduction from the first row to the last, scene by scene.
    """

    components: tuple[str, ...]
    by_component: Float[np.ndarray, "components scenes"]
    stated: Float[np.ndarray, " components"]
    by_order: Float[np.ndarray, "orders components"]
    whole: Float[np.ndarray, " scenes"]

    @property
    def leading_share(self) -> Float[np.ndarray, " components"]:
        """Share of the orders in which each component has the largest reduction [-]."""
        return np.bincount(self.by_order.argmax(axis=1), minlength=len(self.components)) / len(self.by_order)


def shares_of(errors: Errors, orders: Sequence[tuple[str, ...]], first: Row = frozenset()) -> Shares:
    """Shapley shares of the components, which sum to the whole in every scene.

    phi_i = mean over orders of e(before i) - e(with i), with e the error of the row before and after i is added.

    Args:
        errors: Error of every row of the orders.
        orders: All possible orders of the components, the stated one first.
        first: Row to which components are added.

    Source: Shapley, in Contributions to the Theory of Games II (1953) 307; with constraints on the order Faigle & Kern,
    Int. J. Game Theory 21 (1992) 249.
    """
    components = orders[0]
    rows = [first | frozenset(order[:size]) for order in orders for size in range(len(components) + 1)]
    is_known = np.all([np.isfinite(errors[row]) for row in set(rows)], axis=0)
    by_order = np.stack([_reductions(errors, order, components, first) for order in orders])
    by_order = np.where(is_known, by_order, np.nan)
    whole = np.where(is_known, errors[first] - errors[first | frozenset(components)], np.nan)
    means = by_order[..., is_known].mean(axis=-1) if is_known.any() else np.full(by_order.shape[:2], np.nan)
    return Shares(components, by_order.mean(axis=0), means[0], means, whole)


def _reductions(
    errors: Errors, order: Sequence[str], components: Sequence[str], first: Row
) -> Float[np.ndarray, "components scenes"]:
    """Reduction of the error by each component, added in an order."""
    row, reductions = first, {}
    for name in order:
        reductions[name] = errors[row] - errors[row | {name}]
        row = row | {name}
    return np.stack([reductions[name] for name in components])
