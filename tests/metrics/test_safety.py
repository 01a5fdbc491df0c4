"""Leaders, time headway, time to collision, deceleration to avoid a crash; what `test_scene` does not compare."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.metrics import Gap, SafetyConfig, ThwConfig
from rearl_jax.metrics.following import find_leaders
from rearl_jax.metrics.safety import conflicts, time_headways, time_to_collision
from tests.metrics import reference
from tests.metrics.conftest import make_scene

LEADERS = jax.jit(find_leaders)
HEADWAYS = jax.jit(time_headways, static_argnums=3)
CONFLICTS = jax.jit(conflicts, static_argnums=2)
TIMES = jax.jit(time_to_collision, static_argnames="cap")


def leaders(scene):
    names = ("position", "speed", "lane", "length", "crashed")
    direction = None if scene.get("direction") is None else jnp.asarray(scene["direction"])
    return LEADERS(*(jnp.asarray(scene[name]) for name in names), direction)


def one_frame(dtype, position, speed, lane=None, crashed=None):
    """A frame of vehicles 5 m long, all in one lane unless said otherwise."""
    n = len(position)
    return {
        "position": np.array([position], dtype),
        "speed": np.array([speed], dtype),
        "lane": np.array([lane or [0] * n]),
        "crashed": np.array([crashed or [False] * n]),
        "length": np.full((1, n), 5, dtype),
    }


def scored(scene, thw=None):
    speed, crashed = jnp.asarray(scene["speed"]), jnp.asarray(scene["crashed"])
    return HEADWAYS(leaders(scene), speed, crashed, thw or ThwConfig())


@pytest.mark.parametrize("recorded", [False, True], ids=["simulated", "recorded"])
@pytest.mark.parametrize("kind", ["random", "one_place"])
def test_leaders_equal_the_reference(kind, recorded):
    scene = make_scene(10, kind, recorded=recorded)
    followers, rows = leaders(scene), reference.pairs(scene)
    assert int(followers.has_leader.sum()) == len(rows)
    assert len(rows) == 0 if kind == "one_place" else len(rows) > 20
    for row in rows:
        slot = row["slot"]
        assert float(followers.centre_distance[slot]) == pytest.approx(row["distance"], rel=1e-12)
        assert float(followers.gap[slot]) == pytest.approx(row["gap"], abs=1e-9)
        assert float(followers.dv[slot]) == pytest.approx(row["dv"], abs=1e-9)
    alone = ~np.asarray(followers.has_leader)
    assert np.isposinf(followers.gap)[alone].all()
    assert (np.asarray(followers.dv)[alone] == 0).all()


def test_headway_has_no_distance_cap_and_needs_a_moving_follower(dtype):
    far = scored(one_frame(dtype, [0, 5005], [5, 30]))
    assert float(far.mean.value) == 1000
    slow = scored(one_frame(dtype, [0, 105, 305], [0.999, 1.0, 20]))
    assert (float(slow.mean.value), int(slow.mean.count)) == (195, 1)
    assert float(slow.excluded.value) == 0.5
    standing = scored(one_frame(dtype, [0, 105], [0, 0]))
    assert (float(standing.mean.value), int(standing.mean.count), float(standing.excluded.value)) == (0, 0, 1)


def test_headway_leaves_out_crashed_and_overlapping_pairs(dtype):
    for crashed in ([True, False], [False, True]):
        pair = scored(one_frame(dtype, [0, 50], [20, 20], crashed=crashed))
        assert (int(pair.mean.count), float(pair.excluded.value)) == (0, 1)
    assert int(scored(one_frame(dtype, [0, 5], [20, 20])).mean.count) == 0
    touching = scored(one_frame(dtype, [0, 5], [20, 20]), ThwConfig(gap=Gap.centre))
    assert float(touching.mean.value) == 0.25
    behind = scored(one_frame(dtype, [0, 30, 60], [20, 20, 20], crashed=[False, True, False]))
    assert int(behind.mean.count) == 0, "a crashed leader hides the vehicle ahead of it"


def test_carriageways_do_not_follow_each_other(dtype):
    scene = one_frame(dtype, [0, 50, 100], [20, 20, 20]) | {"direction": np.array([[1, 2, 1]])}
    assert leaders(scene).has_leader.tolist() == [[True, False, False]]
    assert float(leaders(scene).centre_distance[0, 0]) == 100


def test_conflict_hand_values(dtype):
    scene = one_frame(dtype, [0, 25], [30, 20])  # gap 20 m, closing at 10 m/s: 2 s, 2.5 m/s^2
    followers, crashed = leaders(scene), jnp.asarray(scene["crashed"])
    assert TIMES(followers, cap=5.0).tolist() == [[2, 5]]
    assert TIMES(followers, cap=1.0).tolist() == [[1, 1]]
    calm = CONFLICTS(followers, crashed, SafetyConfig())
    assert (float(calm.ttc_min.value), float(calm.critical_share.value)) == (2, 0)
    short = CONFLICTS(followers, crashed, SafetyConfig(ttc=2.1))
    assert (float(short.ttc_share.value), float(short.drac_share.value)) == (1, 0)
    hard = CONFLICTS(followers, crashed, SafetyConfig(drac=2.4))
    assert (float(hard.ttc_share.value), float(hard.drac_share.value)) == (0, 1)
    overlapping = leaders(one_frame(dtype, [0, 4], [30, 20]))
    assert TIMES(overlapping, cap=5.0).tolist() == [[5, 5]]
    assert int(CONFLICTS(overlapping, crashed, SafetyConfig()).ttc_share.count) == 0


def test_gradients_are_those_of_finite_differences():
    scene = make_scene(13)

    @jax.jit
    def total(position, speed):
        moved = scene | {"position": position, "speed": speed}
        pairs = conflicts(leaders(moved), jnp.asarray(scene["crashed"]), SafetyConfig())
        return scored(moved).mean.value + pairs.ttc_min.value + time_to_collision(leaders(moved), cap=5.0).sum()

    at = jnp.asarray(scene["position"]), jnp.asarray(scene["speed"])
    along = [np.random.default_rng(s).normal(size=at[0].shape) for s in (0, 1)]
    gradients = jax.jit(jax.grad(total, argnums=(0, 1)))(*at)
    slope = sum(float((np.asarray(g) * d).sum()) for g, d in zip(gradients, along, strict=True))
    ahead, behind = (total(*(np.asarray(a) + h * d for a, d in zip(at, along, strict=True))) for h in (1e-6, -1e-6))
    assert abs(slope) > 0.1
    assert slope == pytest.approx(float(ahead - behind) / 2e-6, rel=1e-4)
