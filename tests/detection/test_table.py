"""The table of the references."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from rearl_jax.detection.table import draw_references, relative_rank, snapshot

N_ROLLOUTS = 20_000
DRAWN = jax.jit(draw_references)


@jax.jit
def rollout_keys():
    """Keys as the evaluation makes them, folded from numbers of runs and scenes."""

    def key(run, scene):
        return jax.random.fold_in(jax.random.fold_in(jax.random.key(0), run), scene)

    run, scene = jnp.divmod(jnp.arange(N_ROLLOUTS, dtype=jnp.int32), jnp.int32(200))
    return jax.vmap(key)(run, scene)


def agreement(found, share):
    """Difference between the frequencies and the shares, in standard errors of the former."""
    frequency = np.bincount(found, minlength=len(share)) / len(found)
    return np.abs(frequency - share) / np.sqrt(np.maximum(share * (1 - share), 1e-9) / len(found))


def test_references_are_drawn_by_their_shares(raw):
    keys = rollout_keys()
    for share in (raw["share"], np.array([0.02, 0.0, 0.98, 0.0]), np.full(15, 1 / 15)):
        found = np.asarray(DRAWN(jnp.asarray(share), keys))
        assert (agreement(found, share) < 4).all()
    # A test that could not tell these shares from others would prove nothing.
    assert agreement(found, np.full(15, 1 / 14)).max() > 3
    np.testing.assert_array_equal(DRAWN(jnp.asarray(7 * share), keys), found)


def test_draws_are_those_of_any_other_batch_and_precision(raw):
    keys, share = rollout_keys(), jnp.asarray(raw["share"])
    found = np.asarray(DRAWN(share, keys))
    assert set(np.unique(found)) == {0, 2, 3}
    for at in (np.array([7]), np.arange(100, 350), np.arange(N_ROLLOUTS)[::-1]):
        np.testing.assert_array_equal(DRAWN(share, keys[at]), found[at])
    np.testing.assert_array_equal(DRAWN(share.astype(jnp.float32), keys), found)


def test_draws_know_nothing_of_the_seconds_of_the_same_rollouts():
    """Draws of a policy from its key of a second agree with the reference as often as by chance."""
    keys, n_references = rollout_keys(), 4
    found = np.asarray(DRAWN(jnp.full(n_references, 0.25), keys))

    @jax.jit
    @partial(jax.vmap, in_axes=(0, None))
    def draws(key, second):
        own_key = jax.random.fold_in(key, second)
        uniform = jax.random.uniform(own_key, (), jnp.float32)
        return jax.random.randint(own_key, (), 0, n_references, jnp.int32), jnp.floor(n_references * uniform)

    for second in (0, 1, 59):
        for other in draws(keys, second):
            same = np.mean(found == np.asarray(other))
            assert abs(same - 0.25) < 4 * np.sqrt(0.25 * 0.75 / N_ROLLOUTS)


def test_ranks_with_ties():
    values = np.array([[3.0, 1.0, 3.0, 2.0], [1.0, 1.0, 1.0, 1.0]]).T
    ranks = np.asarray(jax.jit(relative_rank)(jnp.asarray(values)))
    np.testing.assert_allclose(ranks[:, 0], [0.75, 0.125, 0.75, 0.375])
    np.testing.assert_allclose(ranks[:, 1], 0.5)


def test_snapshot_is_that_second_of_each_scenarios_reference(raw, table):
    picked = [2, 0, 1, 2]
    shown = jax.jit(snapshot)(table, jnp.int32(7), jnp.asarray(picked, jnp.int32))
    shown = jax.tree.map(np.asarray, shown)
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
