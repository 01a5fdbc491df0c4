"""Realism: the five likelihoods and their weighted mean."""

import math
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.metrics import FeatureConfig, MetricsConfig, RealismConfig, SpeedValues
from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.metrics.following import find_leaders
from rearl_jax.metrics.motion import rate_of_change
from rearl_jax.metrics.realism import (
    RealismCounts,
    distance_to_nearest,
    feature_counts,
    likelihood,
    realism_counts,
    realism_scores,
)
from tests.metrics import reference
from tests.metrics.conftest import DEGENERATE, cast, make_scene

KINDS = pytest.mark.parametrize("kind", ["random", *DEGENERATE])
F32 = np.dtype("float32")
FEATURES = ("speed", "acceleration", "distance", "ttc", "headway", "collision")
#: Narrow bins, so that the scenes of a test fill most of them.
CONFIG = RealismConfig(
    headway=FeatureConfig(low=0.0, high=3.0, n_bins=6, weight=0.0),
    acceleration=FeatureConfig(low=-20.0, high=20.0, n_bins=9, weight=0.2),
    distance=FeatureConfig(low=-4.0, high=30.0, n_bins=8, weight=0.1),
)
METRICS = MetricsConfig(realism=CONFIG)

SCORES = jax.jit(realism_scores, static_argnums=(2, 3), compiler_options=QUICKLY_COMPILED)
DISTANCE = jax.jit(distance_to_nearest)


@partial(jax.jit, compiler_options=QUICKLY_COMPILED)
def counted(scene):
    acceleration = rate_of_change(scene["speed"], scene["track_id"], 1.0)
    distance = distance_to_nearest(scene["x"], scene["y"], scene["length"], scene["width"])
    names = ("position", "speed", "lane", "length", "crashed")
    followers = find_leaders(*(scene[name] for name in names), scene.get("direction"))
    args = (scene["speed"], scene["scaled_speed"], acceleration, distance, followers, scene["crashed"])
    return realism_counts(*args, METRICS)


def counts_of(scene) -> RealismCounts:
    return counted(scene)


def added(counts):
    return jax.tree.map(lambda *runs: sum(map(np.asarray, runs)), *counts)


@KINDS
def test_counts_equal_the_reference(kind):
    scene = cast(make_scene(30, kind, recorded=kind == "random"), F32)
    found, values = counts_of(scene), reference.realism_values(scene, METRICS)
    for name in FEATURES[:-1]:
        f = getattr(CONFIG, name)
        expected = reference.feature_histogram(values[name], f.low, f.high, f.n_bins)
        assert getattr(found, name).tolist() == expected.tolist()
        assert kind != "random" or np.count_nonzero(expected) >= 4
    assert found.collision.tolist() == [values["collision"].count(0.0), values["collision"].count(1.0)]


@pytest.mark.parametrize("kind", ["random", "one_lane", "all_crashed"])
def test_scores_equal_the_reference(kind):
    runs = [cast(make_scene(seed, kind), F32) for seed in (31, 32, 33)]
    real = cast(make_scene(34, recorded=True), F32)
    expected = reference.realism(runs, real, METRICS)
    found = SCORES(added([counts_of(run) for run in runs]), counts_of(real), CONFIG, F32)
    assert found.meta.value.dtype == F32
    assert int(found.meta.count) == 5
    assert int(found.speed.count) == real["x"].size
    for name in (*FEATURES, "meta"):
        assert float(getattr(found, name).value) == pytest.approx(expected[name], rel=1e-5)
    assert 0.0 < expected["meta"] < 0.9


def test_a_recording_scored_as_simulated_is_closer_to_itself_than_to_another():
    one, other = (counts_of(cast(make_scene(seed, recorded=True), F32)) for seed in (35, 36))
    itself, apart = SCORES(one, one, CONFIG, F32), SCORES(other, one, CONFIG, F32)
    for name in ("speed", "acceleration", "distance", "ttc", "headway", "meta"):
        assert float(getattr(itself, name).value) > float(getattr(apart, name).value)
    assert float(itself.collision.value) == pytest.approx(1.0, abs=1e-3)


def test_hand_value(dtype):
    score = jax.jit(likelihood, static_argnums=(2, 3))(np.asarray([3, 1, 0]), np.asarray([2, 0, 1]), 0.5, dtype)
    p = [3.5 / 5.5, 1.5 / 5.5, 0.5 / 5.5]
    assert float(score.value) == pytest.approx(math.exp((2 * math.log(p[0]) + math.log(p[2])) / 3), rel=1e-6)
    assert int(score.count) == 3


def test_default_weights_are_those_of_the_subset():
    config = RealismConfig()
    weights = [config.speed.weight, config.acceleration.weight, config.distance.weight, config.ttc.weight]
    assert [*weights, config.collision_weight] == [0.05, 0.05, 0.1, 0.1, 0.25]
    assert config.speed_values is SpeedValues.scaled
    features = (config.speed, config.acceleration, config.distance, config.ttc, config.headway)
    bins = [jnp.asarray(np.ones(f.n_bins, np.int32)) for f in features]
    simulated = RealismCounts(*bins, collision=jnp.asarray([10, 0]))
    scores = SCORES(simulated, simulated, config, jnp.dtype("float64"))
    mean = (0.05 / 10 + 0.05 / 11 + 0.1 / 10 + 0.1 / 10 + 0.25 * (10.001 / 10.002)) / 0.55
    assert float(scores.meta.value) == pytest.approx(mean)


def test_a_feature_without_values_is_left_out_of_the_mean():
    real = counts_of(cast(make_scene(37, recorded=True), F32))
    empty = jnp.asarray(np.zeros_like(real.acceleration))
    without = replace(real, acceleration=empty)
    for simulated, truth in ((real, without), (without, real)):
        scores = SCORES(simulated, truth, CONFIG, jnp.dtype("float64"))
        assert (int(scores.acceleration.count), float(scores.acceleration.value)) == (0, 0)
        assert int(scores.meta.count) == 4
        unweighted = replace(CONFIG, acceleration=replace(CONFIG.acceleration, weight=0.0))
        expected = SCORES(real, real, unweighted, jnp.dtype("float64"))
        assert float(scores.meta.value) == pytest.approx(float(expected.meta.value), rel=1e-12)
    nothing = jax.tree.map(np.zeros_like, real)
    scores = SCORES(nothing, real, CONFIG, jnp.dtype("float64"))
    assert (float(scores.meta.value), int(scores.meta.count)) == (0, 0)


def test_distance_equals_the_reference():
    scene = make_scene(38, recorded=True)
    distance = DISTANCE(*(scene[k] for k in ("x", "y", "length", "width")))
    expected = [reference.nearest(scene, *slot) for slot in np.ndindex(scene["x"].shape)]
    np.testing.assert_allclose(np.asarray(distance).ravel(), expected, atol=1e-9)
    assert min(expected) < 0 < max(expected)


def test_distance_hand_values():
    x, y, sizes = [[0.0, 8.0, 3.0, 100.0]], [[0.0, 6.0, 0.5, 0.0]], np.ones((1, 4))
    x, *others = (jnp.asarray(values) for values in (x, y, 5.0 * sizes, 2.0 * sizes))
    found = np.asarray(DISTANCE(x, *others))
    assert found[0, 0] == found[0, 2] == -1.5, "overlap of 2 m along and 1.5 m across: the short way out"
    assert float(found[0, 1]) == pytest.approx(3.5), "side by side with the third: 5.5 - 2 across"
    assert float(found[0, 3]) == pytest.approx(math.hypot(100 - 8 - 5, 6 - 2))
    gradient = jax.jit(jax.grad(lambda x: distance_to_nearest(x, *others).sum()))(x)
    assert np.isfinite(gradient).all()


def test_values_outside_the_range_fall_into_the_outer_bins():
    values = np.asarray([[-9.0, 0.0, 9.0, np.inf]])
    feature = FeatureConfig(low=-1.0, high=1.0, n_bins=4, weight=1.0)
    count = jax.jit(feature_counts, static_argnums=1)
    assert count(values, feature).tolist() == [1, 0, 1, 2]
    assert count(values, feature, values < 5.0).tolist() == [1, 0, 1, 0]
