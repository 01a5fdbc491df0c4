"""Discrete Frechet distance of pairs of curves.

A coupling walks along both curves from point to point, never backwards. The distance is the largest distance of two
coupled points, in the coupling in which it is least. It follows from a table with a cell for every pair of points
(`frechet_distances`). The computation runs over the anti-diagonals of this table: all cells of an anti-diagonal are
independent, so every step is one pass over `[points, curves]` with the curves contiguous.
"""

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float, Int


def reversed_between_infinities(
    curves: Float[Array, "features points curves"], n_vertices: int
) -> Float[Array, "features padded curves"]:
    """The curves reversed, between points at infinity: every anti-diagonal is then one contiguous slice.

    Args:
        curves: Curves.
        n_vertices: Number of points of the partners, the curves that these curves are compared with.
    """
    outside = jnp.full((curves.shape[0], n_vertices - 1, curves.shape[2]), jnp.inf, curves.dtype)
    return jnp.concatenate([outside, curves[:, ::-1], outside], axis=1)


def frechet_distances(
    vertices: Float[Array, "features vertices #curves"], backwards: Float[Array, "features padded curves"]
) -> Float[Array, " curves"]:
    """Discrete Frechet distance of every curve to its partner, or to one partner common to all.

    With d[i, j] the distance of points i and j, the distance of the curves up to these points is
    y[i, j] = max(d[i, j], min(y[i-1, j], y[i, j-1], y[i-1, j-1])), along the anti-diagonals i + j = 0, 1, ...

    Args:
        vertices: Points of the partners.
        backwards: Result of `reversed_between_infinities` for as many vertices.

    Source: Eiter & Mannila, Computing discrete Frechet distance, TU Wien report CD-TR 94/64 (1994).
    """
    n_vertices = vertices.shape[1]
    last_diagonal = backwards.shape[1] - n_vertices
    n_curves = backwards.shape[2]

    def squared(diagonal: Int[Array, ""]) -> Float[Array, "vertices curves"]:
        difference = lax.dynamic_slice_in_dim(backwards, last_diagonal - diagonal, n_vertices, axis=1) - vertices
        total = difference[0] * difference[0]
        for feature in range(1, difference.shape[0]):
            total = total + difference[feature] * difference[feature]
        return total

    def step(diagonals, diagonal):
        last, second_last = diagonals  # the two before this one, below a row at infinity
        best = jnp.minimum(jnp.minimum(last[1:], last[:-1]), second_last[:-1])
        reached = jnp.maximum(squared(diagonal), best)
        return (lax.dynamic_update_slice(second_last, reached, (1, 0)), last), None

    outside = jnp.full((n_vertices + 1, n_curves), jnp.inf, backwards.dtype)
    first = outside.at[1:2].set(squared(jnp.asarray(0))[:1])
    (final, _), _ = lax.scan(step, (first, outside), jnp.arange(1, last_diagonal + 1))
    return jnp.sqrt(final[-1])
