"""Reference rows: partners, noise floor, realism, and what recordings cannot tell."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.evaluation import EvaluationConfig
from rearl_jax.config.metrics import HistConfig, MetricsConfig, OutOfBounds, RealismConfig
from rearl_jax.config.scenes import SpeedNorm
from rearl_jax.core.rollout import Frames
from rearl_jax.data.scenes.scene_set import recorded_lane_change_rate
from rearl_jax.evaluation.scores import (
    COMPARING,
    REAL,
    noise_floor_scores,
    of_recordings,
    partners,
    scores_of,
    with_realism,
)
from rearl_jax.evaluation.scoring import Scorer
from rearl_jax.evaluation.simulators import Simulated
from rearl_jax.evaluation.tables import HEADINGS
from rearl_jax.metrics import METRICS
from rearl_jax.metrics.realism import realism_scores
from tests.refusal import refused


def test_headings_have_the_units_of_the_metrics():
    for name, heading in HEADINGS.items():
        unit = heading.partition("[")[2].rstrip("]") or "1"
        assert unit == METRICS[name].unit, name


def test_partners_share_no_second_of_traffic(scenes):
    # Windows of twelve seconds every four: neighbours overlap.
    overlapping = replace(scenes, start_time=scenes.start_time / 3)
    for scene_set, n_expected in ((scenes, 5), (overlapping, 3)):
        partner, scene, run = partners(scene_set, np.arange(6), EvaluationConfig(n_runs=10))
        apart = np.abs(scene_set.start_time[partner] - scene_set.start_time[scene])
        same = scene_set.recording[partner] == scene_set.recording[scene]
        assert same.any() or n_expected == 3
        assert (~same | (apart >= scene_set.seconds)).all()
        assert np.bincount(scene).tolist() == [n_expected] * 6
        for index in range(6):
            assert len(set(partner[scene == index])) == n_expected
            assert sorted(run[scene == index]) == list(range(n_expected))


def test_partners_depend_on_seed_and_scene_alone(scenes):
    config = EvaluationConfig(n_runs=3)
    everything, scene, _ = partners(scenes, np.arange(6), config)
    few, scene_of_few, _ = partners(scenes, np.array([1, 4]), config)
    for index in (1, 4):
        np.testing.assert_array_equal(everything[scene == index], few[scene_of_few == index])
    other, *_ = partners(scenes, np.arange(6), replace(config, seed=1))
    assert (other != everything).any()


def test_noise_floor_is_the_distance_of_two_samples(scenes):
    hist = HistConfig(window=5)
    row = noise_floor_scores(scenes, np.array([0, 3]), hist, EvaluationConfig(noise_draws=4000))
    rng = np.random.default_rng(0)
    for position, index in enumerate((0, 3)):
        counts, _ = np.histogram(scenes.scaled_speed[index], np.linspace(5.0, 32.0, 9))
        samples = rng.multinomial(20, counts / counts.sum(), (4000, 2)) / 20  # 5 s of 4 vehicles
        expected = np.sqrt(((np.sqrt(samples[:, 0]) - np.sqrt(samples[:, 1])) ** 2).sum(axis=1) / 2).mean()
        assert expected > 0.05
        assert row.values["h"][position] == pytest.approx(expected, rel=0.03)
    np.testing.assert_allclose(row.values["h_legacy"], row.values["h"] * np.sqrt(0.5 / 3.375), rtol=1e-6)
    alone = noise_floor_scores(scenes, np.array([3]), hist, EvaluationConfig(noise_draws=4000))
    assert alone.values["h"][0] == row.values["h"][1]


def test_speeds_that_are_all_left_out_have_no_noise_floor(scenes):
    slow = replace(
        scenes, speed=np.where(np.arange(6)[:, None, None] == 0, 1.0, scenes.speed), speed_norm=SpeedNorm.none
    )
    hist = HistConfig(window=5, oob=OutOfBounds.drop)
    row = noise_floor_scores(slow, np.array([0, 3]), hist, EvaluationConfig(noise_draws=100))
    assert np.isnan(row.values["h"]).tolist() == [True, False]
    assert row.counts["h"].tolist() == [0, 100]


def scored(scenes, candidate, index, row="real_vs_real"):
    scorer = Scorer(scenes, MetricsConfig(), per_device=6, dtype=np.dtype(np.float32))
    metrics = scorer.recorded(candidate, index)
    run = np.arange(len(index)) // 2
    return scores_of(row, index, run, metrics, partner=candidate, seconds=1.0)


def test_a_scene_against_itself_is_no_comparison(scenes):
    index = np.arange(6)
    raw = scored(scenes, index, index, REAL)
    assert raw.values["h"].max() == 0.0
    own = of_recordings(raw, scenes)
    assert not set(COMPARING) & set(own.values)
    np.testing.assert_array_equal(own.values["lcr"], recorded_lane_change_rate(scenes))
    assert own.values["lcr"].min() > 0
    with refused("row-simulated"):
        of_recordings(replace(raw, partner=None), scenes)


def test_without_lanes_nothing_is_said_about_lanes(scenes):
    blind = replace(scenes, lane=np.full_like(scenes.lane, -1))
    index = np.arange(6)
    row = of_recordings(scored(blind, np.roll(index, 1), index), blind)
    assert not {"thw", "lcr", "ttc_min", "critical_share", "realism"} & set(row.values)
    assert row.realism is None
    assert np.isfinite(row.values["h"]).all()


def test_realism_of_a_row_pools_its_runs(scenes):
    held_out = np.array([1, 4])
    real = scored(scenes, held_out, held_out, REAL)
    row = scored(scenes, np.array([0, 0, 2, 3]), np.array([4, 1, 1, 4]))
    done, same = with_realism([row, real], real, RealismConfig())
    assert same is real

    score = jax.jit(partial(realism_scores, realism=RealismConfig(), dtype=row.values["h"].dtype))

    def likelihood(pairs, scene):
        pooled = jax.tree.map(lambda leaf: jnp.asarray(leaf[..., pairs].sum(axis=-1, dtype="i4")), row.realism)
        reference = jax.tree.map(lambda leaf: jnp.asarray(leaf[..., scene]), real.realism)
        return float(score(pooled, reference).meta.value)

    expected = [likelihood([1, 2], 0), likelihood([0, 3], 1)]
    assert 0.1 < expected[0] < 1
    np.testing.assert_allclose(done.pooled["realism"], expected, rtol=1e-5)
    single = [likelihood([pair], scene) for pair, scene in enumerate((1, 0, 0, 1))]
    np.testing.assert_allclose(done.values["realism"], single, rtol=1e-5)
    assert len(set(np.round(single, 6))) > 2


def test_vehicles_that_collided_and_left_count_among_all_that_were_simulated(scenes):
    """Place 0 holds three vehicles, of whom the first collides in the second in which it leaves."""
    n_seconds, n_vehicles = scenes.speed.shape[1:]
    shape, second = (n_seconds, n_vehicles, 1), np.arange(n_seconds)
    same = jnp.broadcast_to(40.0 * jnp.arange(n_vehicles, dtype=jnp.float32)[None, :, None], shape)
    crashed, left, track = np.zeros(shape, bool), np.zeros(shape, np.int32), np.zeros((1, *shape[:2]), int)
    track[0] = np.arange(n_vehicles)
    track[0, 4:, 0], track[0, 8:, 0], left[4:, 0] = 20, 30, 1
    frames = Frames(same, same * 0, same * 0, same, same * 0, jnp.zeros(shape, jnp.int32), jnp.asarray(crashed))
    scorer = Scorer(scenes, MetricsConfig(), per_device=6, dtype=np.dtype(np.float32))

    def figures(frames, *track):
        simulated = Simulated(frames, np.full(shape[1:], 5.0, np.float32))
        metrics = scorer.simulated(simulated, np.zeros(1, int), np.array([2]), *track)
        return [float(metrics.measure(name).value[0]) for name in ("collisions", "any_collision")]

    entered = replace(frames, n_crashed_replaced=jnp.asarray(left))
    assert figures(entered, track) == [pytest.approx(1 / (n_vehicles + 2)), 1.0]
    crashed[6:8, 0] = crashed[8:, 1] = True  # the second vehicle of place 0, and one that stays
    left[second >= 8, 0] = 2
    both = replace(entered, crashed=jnp.asarray(crashed), n_crashed_replaced=jnp.asarray(left))
    assert figures(both, track) == [pytest.approx(3 / (n_vehicles + 2)), 1.0]
    assert figures(frames) == [0.0, 0.0]
    assert figures(replace(frames, crashed=jnp.asarray(crashed))) == [pytest.approx(1 / n_vehicles), 1.0]


def test_headways_are_those_of_the_vehicles_own_lengths(scenes):
    """Two vehicles 40 m apart at 20 m/s: the leader's length is no headway."""
    n_seconds, n_vehicles = scenes.speed.shape[1:]
    shape = (n_seconds, n_vehicles, 1)
    moved = 20.0 * np.arange(n_seconds)[:, None, None] + 40.0 * np.arange(n_vehicles)[None, :, None]
    same, nobody = jnp.zeros(shape, jnp.float32), jnp.zeros(shape, bool)
    frames = Frames(jnp.float32(moved), same, same, same + 20, same, jnp.zeros(shape, jnp.int32), nobody)
    scorer = Scorer(scenes, MetricsConfig(), per_device=6, dtype=np.dtype(np.float32))
    headway = {}
    for length in (5.0, 15.0):
        simulated = Simulated(frames, np.full(shape[1:], length, np.float32))
        metrics = scorer.simulated(simulated, np.zeros(1, int), np.array([2]))
        headway[length] = float(metrics.thw.value[0])
    assert headway[5.0] == pytest.approx(35 / 20, rel=1e-5)
    assert headway[15.0] == pytest.approx(25 / 20, rel=1e-5)
