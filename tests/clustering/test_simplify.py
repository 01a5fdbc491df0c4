"""Simplified curves: compared with the best of all choices of vertices.

A shortcut replaces the piece of a curve between two of its points by a straight segment. Its error is the continuous
Frechet distance between segment and piece.
"""

from itertools import combinations

import numpy as np
import pytest

from rearl_jax.clustering.continuous import continuous_distances
from rearl_jax.clustering.simplify import shortcut_errors, simplified, simplify
from tests.clustering.curves import random_curves


def test_shortcut_errors_are_frechet_distances():
    curves = random_curves(2, 7)
    errors = shortcut_errors(curves)
    for curve in range(2):
        for i, j in combinations(range(7), 2):
            piece = curves[:, i : j + 1, curve : curve + 1].astype(np.float64)
            segment = piece[:, [0, -1], 0][None]
            assert errors[curve, i, j] == pytest.approx(continuous_distances(piece, segment)[0, 0], abs=1e-7)
    assert np.isinf(errors[:, 5, 3]).all()


def test_the_error_of_a_shortcut_over_a_step_back_is_above_zero_although_all_points_lie_on_it():
    # The curve goes from 0 to 3, back to 1 and on to 4. A point that moves along the segment may not step back, so it
    # waits at 2 while the curve is at 3 and at 1.
    curve_with_step_back = np.array([[0.0, 3.0, 1.0, 4.0], [0.0] * 4, [0.0] * 4])[:, :, None]
    assert shortcut_errors(curve_with_step_back)[0, 0, 3] == pytest.approx(1.0)


@pytest.mark.parametrize("n_vertices", [2, 3, 4, 5])
def test_simplification_is_the_best_of_all_choices(n_vertices):
    curves = random_curves(12, 8, seed=6)
    errors = shortcut_errors(curves)
    vertices = simplify(errors, n_vertices)
    for curve in range(12):
        largest_errors = [
            max(errors[curve, a, b] for a, b in zip((0, *inner), (*inner, 7), strict=True))
            # Fewer vertices can be better, if a shortcut over a step back has a smaller error than its parts.
            for n_inner in range(n_vertices - 1)
            for inner in combinations(range(1, 7), n_inner)
        ]
        own = vertices[curve]
        assert (own[0], own[-1]) == (0, 7)
        # An edge between equal vertices has no length.
        assert max(errors[curve, a, b] for a, b in zip(own, own[1:], strict=False) if a != b) == min(largest_errors)
    np.testing.assert_array_equal(simplified(curves, errors, n_vertices)[3], curves[:, vertices[3], 3])


def test_more_vertices_than_points_repeat_some():
    curves = random_curves(2, 4)
    polylines = simplified(curves, shortcut_errors(curves), 7)
    assert polylines.shape == (2, 3, 7)
    np.testing.assert_array_equal(np.unique(polylines[0], axis=1), np.unique(curves[:, :, 0], axis=1))
