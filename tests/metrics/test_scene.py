"""The one call that scores a scene: against the reference, in batches, on every degenerate case."""

from dataclasses import fields
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.metrics import HistConfig, MetricsConfig, OutOfBounds, RealismConfig, SpeedValues
from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.metrics import MEASURED, METRICS, Direction
from rearl_jax.metrics.further import KERNELS
from rearl_jax.metrics.measure import Measure
from rearl_jax.metrics.scene import (
    SceneMetrics,
    Trajectories,
    scene_metrics,
    scene_reference,
)
from tests.metrics import reference
from tests.metrics.conftest import DEGENERATE, cast, make_scene

KINDS = pytest.mark.parametrize("kind", ["random", *DEGENERATE])
CONFIG = MetricsConfig()
SCORE = jax.jit(scene_metrics, static_argnums=2, compiler_options=QUICKLY_COMPILED)
REFERENCE = jax.jit(scene_reference, static_argnums=3, compiler_options=QUICKLY_COMPILED)


def trajectories(scene) -> Trajectories:
    """The scene as the metrics take it; in a simulated one a slot always holds the same vehicle."""
    left_out = () if "direction" in scene else ("track_id",)
    return Trajectories(**{name: jnp.asarray(values) for name, values in scene.items() if name not in left_out})


def real_scene(seed, dtype):
    """A recorded scene, its reference for the metrics, and the same as plain arrays."""
    scene = make_scene(seed, recorded=True)
    mean, vehicle = reference.spacings(scene["x"], scene["y"])
    arrays = [jnp.asarray(values, dtype) for values in (scene["scaled_speed"], mean, vehicle)]
    return cast(scene, dtype), REFERENCE(*arrays, CONFIG.hist), (mean, vehicle)


def expected_values(scene, real, spacing, config):
    """The figures of the metric table from the plain-loop reference, 0 where there are no samples, and counts."""
    windows = reference.window_hellinger(scene["scaled_speed"], real["scaled_speed"], config.hist)
    mean, _ = reference.spacings(scene["x"], scene["y"])
    errors = [row for row in reference.spacing_errors(mean, *spacing) if row]
    a, b, c, ratio = np.mean(errors, axis=0) if errors else (0,) * 4
    kept, n_pairs = reference.headways(scene, config.thw)
    ttc, short, hard = reference.conflicts(scene, config.safety)
    changes, observed = reference.lane_changes(scene)
    jerk = np.array(reference.jerks(scene, config.frame_interval))
    closing = [value for value in ttc if np.isfinite(value)]
    crashed = scene["crashed"]
    values = {
        "h": np.mean(windows),
        "h_legacy": np.mean(windows) * 0.38490017945975,
        "spacing": np.mean(mean),
        "spacing_ratio": ratio,
        "mape_a": a,
        "mape_b": b,
        "mape_c": c,
        "thw": np.mean(kept) if kept else 0,
        "thw_median": np.median(kept) if kept else 0,
        "thw_excluded": 1 - len(kept) / n_pairs if n_pairs else 0,
        "lcr": changes / scene["x"].size,
        "lcr_observed": changes / max(observed, 1),
        "collisions": crashed[-1].mean(),
        "any_collision": float(crashed.any()),
        "jerk_rms": np.sqrt(np.mean(jerk**2)) if jerk.size else 0,
        "jerk_share": np.mean(np.abs(jerk) > config.safety.jerk) if jerk.size else 0,
        "ttc_min": min(closing, default=0),
        "ttc_share": np.mean(short) if short else 0,
        "drac_share": np.mean(hard) if hard else 0,
        "critical_share": np.mean(np.logical_or(short, hard)) if short else 0,
    }
    counts = dict.fromkeys(("thw", "thw_median"), len(kept)) | {"thw_excluded": n_pairs, "ttc_min": len(closing)}
    counts |= dict.fromkeys(("ttc_share", "drac_share", "critical_share"), len(ttc))
    counts |= dict.fromkeys(("lcr", "lcr_observed"), observed) | dict.fromkeys(("jerk_rms", "jerk_share"), jerk.size)
    return values, counts


@pytest.mark.parametrize(
    ("precision", "recorded", "rtol"),
    [("float64", False, 1e-9), ("float32", True, 3e-4)],
    ids=["simulated", "recorded"],
)
@KINDS
def test_scene_equals_the_reference(precision, kind, recorded, rtol):
    dtype = np.dtype(precision)
    scene = cast(make_scene(40, kind, recorded=recorded), dtype)
    real, ref, spacing = real_scene(41, dtype)
    metrics = SCORE(trajectories(scene), ref, CONFIG)
    values, counts = expected_values(scene, real, spacing, CONFIG)
    if kind == "random" and not recorded:
        assert all(values.values()), "the case must not be trivial"
    for name, value in values.items():
        measure = getattr(metrics, name)
        assert measure.value.dtype == dtype, name
        assert name not in counts or int(measure.count) == counts[name], name
        np.testing.assert_allclose(measure.value, value, rtol=rtol, atol=1e-6, err_msg=name)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(metrics))


@pytest.mark.parametrize(
    ("kind", "without_samples"),
    [
        ("one_vehicle", {"spacing_ratio", "mape_a", "mape_b", "mape_c", "thw", "thw_median", "ttc_min"}),
        ("own_lanes", {"thw", "thw_median", "thw_excluded", "ttc_min", "ttc_share", "critical_share"}),
        ("standing", {"thw", "thw_median", "ttc_min"}),
        ("all_crashed", {"thw", "lcr", "lcr_observed", "jerk_rms", "jerk_share", "ttc_share"}),
        ("one_place", {"mape_a", "mape_b", "mape_c", "thw", "ttc_min"}),
    ],
)
def test_what_has_no_samples_says_so(kind, without_samples):
    _, ref, _ = real_scene(41, np.dtype("float64"))
    found = SCORE(trajectories(make_scene(42, kind)), ref, CONFIG)
    for name in without_samples:
        assert int(getattr(found, name).count) == 0, name
        assert float(getattr(found, name).value) == 0, name
    assert int(found.h.count) == 8


def batch(dtype, n_scenarios=3):
    """Simulated scenes and references with the scenario axis last."""
    scenes = [trajectories(cast(make_scene(50 + s), dtype)) for s in range(n_scenarios)]
    references = [real_scene(60 + s, dtype)[1] for s in range(n_scenarios)]
    stack = partial(jax.tree.map, lambda *leaves: np.stack(leaves, axis=-1))
    return scenes, references, stack(*scenes), stack(*references)


def assert_equal(found, expected, rtol):
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(one, other, rtol=rtol, atol=rtol)


def test_batch_equals_loop():
    scenes, references, all_scenes, all_references = batch(np.dtype("float64"))
    loop = [SCORE(scene, ref, CONFIG) for scene, ref in zip(scenes, references, strict=True)]
    loop = jax.tree.map(lambda *leaves: np.stack(leaves, axis=-1), *loop)
    assert float(np.ptp(loop.h.value)) > 0
    assert_equal(SCORE(all_scenes, all_references, CONFIG), loop, 1e-12)


def test_order_of_vehicles_does_not_matter():
    _, ref, _ = real_scene(41, np.dtype("float64"))
    scene, order = make_scene(44), np.random.default_rng(0).permutation(10)
    shuffled = {name: values[:, order] for name, values in scene.items()}
    assert_equal(*(SCORE(trajectories(s), ref, CONFIG) for s in (scene, shuffled)), 1e-12)


def test_a_recording_scored_against_itself():
    real, ref, _ = real_scene(45, np.dtype("float32"))
    itself = SCORE(trajectories(real), ref, CONFIG)
    for name in ("h", "h_legacy", "mape_a", "mape_b"):
        assert float(getattr(itself, name).value) == pytest.approx(0, abs=1e-6)
    assert float(itself.mape_c.value) > 0.1
    assert float(itself.spacing_ratio.value) == pytest.approx(1)
    other = SCORE(trajectories(real_scene(46, np.dtype("float32"))[0]), ref, CONFIG)
    assert float(other.h.value) > 0.1


def test_series_average_to_the_measures():
    _, ref, _ = real_scene(41, np.dtype("float64"))
    found = SCORE(trajectories(make_scene(47)), ref, CONFIG)
    assert found.series.h.shape == (12 - 4,)
    assert found.series.mape_a.shape == found.series.spacing.shape == (12,)
    for name in ("h", "mape_a", "mape_b", "mape_c", "spacing"):
        assert float(getattr(found, name).value) == pytest.approx(float(getattr(found.series, name).mean()))


def test_switches_reach_the_kernels():
    dtype = np.dtype("float32")
    _, ref, _ = real_scene(41, dtype)
    scene, outside = (
        trajectories(cast(make_scene(48, kind, recorded=True), dtype)) for kind in ("random", "out_of_range")
    )
    changed = MetricsConfig(
        hist=HistConfig(oob=OutOfBounds.drop),
        realism=RealismConfig(speed_values=SpeedValues.raw),
        frame_interval=0.5,
    )
    default, other = SCORE(scene, ref, CONFIG), SCORE(scene, ref, changed)
    for metrics, speeds in ((default, scene.scaled_speed), (other, scene.speed)):
        expected = reference.feature_histogram(speeds, 0.0, 35.0, 10)
        assert metrics.realism.speed.tolist() == expected.tolist()
    assert default.realism.speed.tolist() != other.realism.speed.tolist()
    np.testing.assert_array_equal(default.realism.distance, other.realism.distance)
    assert float(other.jerk_rms.value) == pytest.approx(4 * float(default.jerk_rms.value), rel=1e-5)
    assert int(SCORE(outside, ref, changed).h.count) == 0
    assert int(SCORE(outside, ref, CONFIG).h.count) == 8


def test_metric_table_names_every_measure_and_nothing_else():
    measures = {field.name for field in fields(SceneMetrics)} - {"realism", "series", "further"} | set(KERNELS)
    assert set(MEASURED) == measures < set(METRICS)
    assert all(name == metric.name for name, metric in METRICS.items())
    for metric in METRICS.values():
        assert all((metric.title, metric.unit, metric.definition, metric.source)), metric.name
    for name in ("thw", "thw_median", "lcr", "lcr_observed"):
        assert METRICS[name].direction is Direction.none, "more of it is never better"
    _, ref, _ = real_scene(41, np.dtype("float64"))
    found = SCORE(trajectories(make_scene(40)), ref, CONFIG)
    assert all(isinstance(found.measure(name), Measure) for name in measures)
    assert eqx.is_array(found.realism.speed)


def test_a_further_metric_is_measured_beside_the_others(monkeypatch):
    _, ref, _ = real_scene(41, np.dtype("float64"))
    scene = trajectories(make_scene(40))
    alone = SCORE(scene, ref, CONFIG)

    def measure(scene, reference, config):
        return Measure(config.frame_interval * scene.speed[0, 0], reference.cumulative_counts[0, 0])

    monkeypatch.setitem(KERNELS, "mine", measure)
    beside = jax.jit(lambda *given: scene_metrics(*given, CONFIG), compiler_options=QUICKLY_COMPILED)(scene, ref)
    assert beside.further.keys() - alone.further.keys() == {"mine"}
    assert float(beside.measure("mine").value) == CONFIG.frame_interval * float(scene.speed[0, 0])
    for name in MEASURED:
        assert float(beside.measure(name).value) == pytest.approx(float(alone.measure(name).value), rel=1e-12)


@partial(jax.jit, compiler_options=QUICKLY_COMPILED)
@jax.grad
def slope_of_all(moving, fixed, ref):
    found = scene_metrics(eqx.combine(moving, fixed), ref, CONFIG)
    return jnp.stack([found.measure(name).value for name in MEASURED]).sum()


@KINDS
def test_gradients_are_finite(kind):
    _, ref, _ = real_scene(41, np.dtype("float64"))
    scene = trajectories(make_scene(49, kind))

    moving, fixed = eqx.partition(scene, eqx.is_inexact_array)
    gradients = jax.tree.leaves(slope_of_all(moving, fixed, ref))
    assert len(gradients) == 7
    assert all(np.isfinite(g).all() for g in gradients)
