"""The detection against loops, and its switches."""

import functools
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.detection import Cues, ReferenceMode, Scope
from rearl_jax.config.metrics import HistConfig, MapeDefinition
from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.detection.detector import DetectionOptions, Thresholds, detect, initial_memory
from rearl_jax.detection.table import draw_references
from rearl_jax.metrics.histograms import cumulative_speed_counts, window_distances

N_REFS, N_SECONDS, N_SLOTS, N_SCENARIOS = 4, 12, 10, 6
EDGES = np.linspace(5, 32, 9)
LOW, HIGH = 0.25, 0.3


def rollout_keys(n_scenarios):
    return jax.random.split(jax.random.key(3), n_scenarios)


@functools.cache
def program(options):
    """The detection over all frames, compiled once for each choice of options."""

    @functools.partial(jax.jit, compiler_options=QUICKLY_COMPILED)
    def scan(frames, table, h, m):
        def step(memory, frame):
            return detect(memory, frame, table, Thresholds(h, m), options)

        return jax.lax.scan(step, initial_memory(table, rollout_keys(frames.x.shape[-1]), options), frames)[1]

    return scan


def run(frames, table, options, h=LOW, m=LOW):
    thresholds = (jnp.broadcast_to(jnp.asarray(value), frames.x.shape[-1:]) for value in (h, m))
    return jax.tree.map(np.asarray, program(options)(frames, table, *thresholds))


def make_options(**changes):
    return replace(DetectionOptions(), **changes)


def histogram(speeds):
    return np.histogram(np.clip(speeds, 5, 32), EDGES)[0]


def hellinger(a, b):
    p, q = histogram(a) / np.size(a), histogram(b) / np.size(b)
    return np.sqrt(((np.sqrt(p) - np.sqrt(q)) ** 2).sum() / 2)


def loop(frames, raw, definition="A", weights=(1.0, 0.0), drawn=None):
    """Reference (the nearest one unless drawn), Hellinger distance and error, one number at a time."""
    x, y, speed = (np.asarray(values) for values in (frames.x, frames.y, frames.speed))
    found = {name: np.zeros((N_SECONDS, N_SCENARIOS)) for name in ("reference", "hellinger", "mape")}
    for s in range(N_SCENARIOS):
        errors = np.zeros((N_SECONDS, N_REFS))
        for t in range(N_SECONDS):
            distance = np.hypot(x[t, :, None, s] - x[t, None, :, s], y[t, :, None, s] - y[t, None, :, s])
            mean = distance.sum() / (N_SLOTS * (N_SLOTS - 1))
            for k in range(N_REFS):
                real, each = raw["mean_spacing"][k, t], raw["spacing"][k, t]
                errors[t, k] = {
                    "A": abs(mean - real) / mean,
                    "B": abs(mean - real) / real,
                    "C": np.abs(each - mean).mean() / real,
                }[definition]
            score = weights[0] * errors[: t + 1].mean(axis=0)
            score = score + weights[1] * np.array(
                [hellinger(speed[: t + 1, :, s], raw["speed"][k, : t + 1]) for k in range(N_REFS)]
            )
            best = int(np.argmin(np.round(score, 12))) if drawn is None else drawn[s]
            found["reference"][t, s], found["mape"][t, s] = best, errors[t, best]
            if t >= 4:
                found["hellinger"][t, s] = hellinger(speed[t - 4 : t + 1, :, s], raw["speed"][best, t - 4 : t + 1])
    return found


@pytest.mark.parametrize("definition", ["A", "B", "C"])
@pytest.mark.parametrize("mode", ["spacing", "spacing_speed"])
def test_detection_is_that_of_a_loop_over_the_prefix(frames, raw, table, definition, mode):
    weights = (1.0, 2.0) if mode == "spacing_speed" else (1.0, 0.0)
    options = make_options(mode=ReferenceMode[mode], weights=weights, definition=MapeDefinition[definition])
    found = run(frames, table, options)
    wanted = loop(frames, raw, definition, weights)
    assert len(np.unique(wanted["reference"])) == 3
    assert not (wanted["reference"] == 3).any()  # a tie with reference 1, which comes first
    np.testing.assert_array_equal(found.reference, wanted["reference"])
    np.testing.assert_allclose(found.mape, wanted["mape"], atol=1e-12)
    np.testing.assert_allclose(found.hellinger, wanted["hellinger"], atol=1e-7)


@pytest.mark.parametrize("definition", ["A", "B", "C"])
def test_a_drawn_reference_is_kept_and_measured_against(frames, raw, table, definition):
    drawn = np.asarray(draw_references(table.share, rollout_keys(N_SCENARIOS)))
    options = make_options(mode=ReferenceMode.drawn, definition=MapeDefinition[definition])
    found = run(frames, table, options)
    wanted = loop(frames, raw, definition, drawn=drawn)
    assert len(np.unique(drawn)) > 1
    assert (drawn != loop(frames, raw, definition)["reference"][-1]).any()  # not the nearest ones by chance
    np.testing.assert_array_equal(found.reference, np.broadcast_to(drawn, (N_SECONDS, N_SCENARIOS)))
    np.testing.assert_allclose(found.mape, wanted["mape"], atol=1e-12)
    np.testing.assert_allclose(found.hellinger, wanted["hellinger"], atol=1e-7)
    assert 0 < found.triggered.sum() < found.triggered.size
    np.testing.assert_array_equal(found.triggered, (found.hellinger > LOW) | (found.mape > LOW))


@pytest.mark.parametrize("mode", ["spacing", "spacing_speed"])
def test_the_nearest_reference_does_not_depend_on_shares(frames, table, mode):
    """No share is looked at and nothing is drawn or carried."""

    def start(options):
        return jax.make_jaxpr(lambda keys: initial_memory(table, keys, options))(rollout_keys(2))

    options = make_options(mode=ReferenceMode[mode])
    usual = run(frames, table, options)
    without = run(frames, eqx.tree_at(lambda t: t.share, table, jnp.full_like(table.share, jnp.nan)), options)
    for a, b in zip(jax.tree.leaves(usual), jax.tree.leaves(without), strict=True):
        np.testing.assert_array_equal(a, b)
    assert "random" in str(start(make_options(mode=ReferenceMode.drawn)))
    assert "random" not in str(start(options))


def test_cues_and_thresholds(frames, table):
    found = {cues: run(frames, table, make_options(cues=cues), LOW, HIGH) for cues in Cues}
    both = found[Cues.both]
    speed, spacing = both.hellinger > LOW, both.mape > HIGH
    assert not speed[:4].any()  # no full window yet
    for mask in (speed, spacing, speed & spacing, ~speed & ~spacing):
        assert mask.any()
    np.testing.assert_array_equal(both.speed_exceeded, speed)
    np.testing.assert_array_equal(both.spacing_exceeded, spacing)
    np.testing.assert_array_equal(both.triggered, speed | spacing)
    np.testing.assert_array_equal(found[Cues.speed].triggered, speed)
    np.testing.assert_array_equal(found[Cues.spacing].triggered, spacing)
    assert found[Cues.always].triggered.all()
    assert not found[Cues.never].triggered.any()
    assert not found[Cues.never].mask.any()
    crashed = np.asarray(frames.crashed)
    np.testing.assert_array_equal(found[Cues.always].mask, ~crashed)
    np.testing.assert_array_equal(both.mask, both.triggered[:, None] & ~crashed)


def test_interval(frames, table):
    every = run(frames, table, make_options(cues=Cues.always, interval=5))
    assert np.flatnonzero(every.triggered[:, 0]).tolist() == [4, 9]
    each = run(frames, table, make_options(cues=Cues.both))
    fifth = run(frames, table, make_options(cues=Cues.both, interval=5))
    assert fifth.triggered.any()
    np.testing.assert_array_equal(fifth.triggered[4::5], each.triggered[4::5])
    np.testing.assert_array_equal(fifth.hellinger, each.hellinger)


def test_scope_vehicle_asks_those_who_contribute(frames, raw, table):
    found = run(frames, table, make_options(scope=Scope.vehicle))
    speed, crashed = np.asarray(frames.speed), np.asarray(frames.crashed)
    asked = 0
    for t in range(4, N_SECONDS):
        for s in range(N_SCENARIOS):
            k = found.reference[t, s]
            surplus = histogram(speed[t - 4 : t + 1, :, s]) > histogram(raw["speed"][k, t - 4 : t + 1])
            wanted = raw["mean_spacing"][k, t]
            for i in range(N_SLOTS):
                own_bin = np.clip(np.digitize(speed[t, i, s], EDGES) - 1, 0, 7)
                side = np.sign(found.spacing[t, i, s] - wanted) == np.sign(found.mean_spacing[t, s] - wanted)
                needs = (found.speed_exceeded[t, s] and surplus[own_bin]) or (found.spacing_exceeded[t, s] and side)
                assert found.mask[t, i, s] == (needs and not crashed[t, i, s])
                asked += needs
    assert 0 < asked < 8 * N_SCENARIOS * N_SLOTS


def test_thresholds_as_one_batch_axis_are_those_one_by_one(frames, table):
    pairs = [(h, m) for h in (0.1, 0.3, 0.5, 0.7) for m in (0.05, 0.1, 0.3, 0.6)]
    repeated = jax.tree.map(lambda leaf: jnp.tile(leaf, (1, 1, len(pairs))), frames)
    h, m = (np.repeat(values, N_SCENARIOS) for values in zip(*pairs, strict=True))
    together = run(repeated, table, make_options(), h, m)
    rates = set()
    for number, pair in enumerate(pairs):
        alone = run(frames, table, make_options(), *pair)
        at = slice(number * N_SCENARIOS, (number + 1) * N_SCENARIOS)
        for a, b in zip(jax.tree.leaves(together), jax.tree.leaves(alone), strict=True):
            np.testing.assert_array_equal(a[..., at], b)
        rates.add(float(alone.triggered.mean()))
    assert len(rates) > 5


def test_figures_are_those_of_the_evaluation(frames, raw, table):
    found = run(frames, jax.tree.map(lambda leaf: leaf[..., :1], table), make_options())

    @functools.partial(jax.jit, compiler_options=QUICKLY_COMPILED)
    def distances(*speeds):
        counts = (cumulative_speed_counts(speed, HistConfig()) for speed in speeds)
        return window_distances(*counts, HistConfig(), jnp.dtype(jnp.float64)).value

    wanted = distances(frames.speed, np.broadcast_to(raw["speed"][0][..., None], frames.speed.shape))
    np.testing.assert_allclose(found.hellinger[4:], wanted, atol=1e-12)
