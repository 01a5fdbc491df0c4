"""Simplification against all choices of vertices, and shortcut errors against the continuous Frechet distance."""

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


def test_shortcut_over_a_step_back_needs_more_than_the_distance_to_the_segment():
    back = np.array([[0.0, 3.0, 1.0, 4.0], [0.0] * 4, [0.0] * 4])[:, :, None]
    assert shortcut_errors(back)[0, 0, 3] == pytest.approx(1.0)


@pytest.mark.parametrize("n_vertices", [2, 3, 4, 5])
def test_simplification_is_the_best_of_all_choices(n_vertices):
    curves = random_curves(12, 8, seed=6)
    errors = shortcut_errors(curves)
    found = simplify(errors, n_vertices)
    for curve in range(12):
        worst = [
            max(errors[curve, a, b] for a, b in zip((0, *inner), (*inner, 7), strict=True))
            for n_inner in range(n_vertices - 1)  # fewer can be better: an edge may pass over a step back
            for inner in combinations(range(1, 7), n_inner)
        ]
        at = found[curve]
        assert (at[0], at[-1]) == (0, 7)
        assert max(errors[curve, a, b] for a, b in zip(at, at[1:], strict=False) if a != b) == min(worst)
    np.testing.assert_array_equal(simplified(curves, errors, n_vertices)[3], curves[:, found[3], 3])


def test_more_vertices_than_points_repeat_some():
    curves = random_curves(2, 4)
    found = simplified(curves, shortcut_errors(curves), 7)
    assert found.shape == (2, 3, 7)
    np.testing.assert_array_equal(np.unique(found[0], axis=1), np.unique(curves[:, :, 0], axis=1))
