"""What is tabulated of the references."""

import numpy as np


def test_ranks_with_ties():
    import jax.numpy as jnp

    from rearl_jax.detection.table import relative_rank

    values = np.array([[3.0, 1.0, 3.0, 2.0], [1.0, 1.0, 1.0, 1.0]]).T
    ranks = np.asarray(relative_rank(jnp.asarray(values)))
    np.testing.assert_allclose(ranks[:, 0], [0.75, 0.125, 0.75, 0.375])
    np.testing.assert_allclose(ranks[:, 1], 0.5)


def test_snapshot_is_that_second_of_each_scenarios_reference(raw, table):
    import jax.numpy as jnp

    from rearl_jax.detection.table import snapshot

    picked = [2, 0, 1, 2]
    shown = snapshot(table, jnp.int32(7), jnp.asarray(picked, jnp.int32))
    for column, k in enumerate(picked):
        np.testing.assert_allclose(shown.speed[:, column], raw["speed"][k, 7])
        np.testing.assert_allclose(shown.spacing[:, column], raw["spacing"][k, 7])
        np.testing.assert_allclose(shown.mean_spacing[column], raw["mean_spacing"][k, 7])
        np.testing.assert_array_equal(shown.action[:, column], raw["action"][k, 7])
        order = np.argsort(np.argsort(raw["speed"][k, 7]))
        np.testing.assert_allclose(shown.speed_rank[:, column], (order + 0.5) / 10)


def test_window_counts_grow_to_the_length_of_the_window(table):
    totals = np.asarray(table.window_counts).sum(axis=1)
    assert totals[:, 0].tolist() == [10, 20, 30, 40, *[50] * 8]
    np.testing.assert_allclose((np.asarray(table.prefix_roots) ** 2).sum(axis=1), 1)
