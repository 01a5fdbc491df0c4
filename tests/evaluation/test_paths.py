"""Trajectories of rollouts and recordings: pairs of vehicles, seconds, and the figures of a row against plain loops."""

from dataclasses import replace
from itertools import combinations

import jax
import numpy as np
import pytest

from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import InitConfig, InitialSource
from rearl_jax.config.scenes import ScenesConfig
from rearl_jax.core.batch import join_scenarios
from rearl_jax.evaluation.paths import recorded_paths, simulated_paths, with_paths
from rearl_jax.evaluation.scores import Scores
from rearl_jax.evaluation.simulators import Simulated
from tests.evaluation.test_boundary import MEASURED, Listed, boundary_of, frames_at

CONFIG = EvaluateTask()
DRAWN = replace(CONFIG, init=InitConfig(InitialSource.seed))
ALL = np.array(True)
FREE = replace(MEASURED, scenes=ScenesConfig())
EVERY = np.arange(6)


def simulated_at(x, lane):
    return Simulated(frames_at(x, lane), np.full((x.shape[2], len(x)), 5.0))


def since_start(scenes):
    """Recorded positions from the most upstream place of the first snapshot [m]."""
    return scenes.position - scenes.position[:, :1].min(axis=2, keepdims=True)


def with_leaver(scenes):
    """The scenes with another vehicle in slot 1 from the fourth snapshot on."""
    track = scenes.track_id.copy()
    track[:, 4:, 1] = 99
    return replace(scenes, track_id=track)


def test_recorded_vehicles_are_followed_in_the_order_of_their_first_places(scenes):
    found = recorded_paths(with_leaver(scenes), np.array([2, 0]), CONFIG)
    for column, scene in enumerate((2, 0)):
        for place, slot in enumerate(np.argsort(scenes.position[scene, 0])):
            until = 3 if slot == 1 else 11
            assert found.known[:, place, column].tolist() == [second < until for second in range(11)]
            along = since_start(scenes)[scene, 1 : until + 1, slot]
            np.testing.assert_allclose(found.along[:until, place, column], along, rtol=1e-5)
            # carriageway 2 lies beside the two lanes of carriageway 1
            lanes = scenes.lane[scene, 1 : until + 1, slot] + 2 * (scenes.direction[scene, 0, slot] == 2)
            np.testing.assert_array_equal(found.across[:until, place, column], 4.0 * lanes)


def test_without_its_lane_it_is_not_known_where_a_vehicle_is(scenes):
    lane = scenes.lane.copy()
    lane[0, 5, 2] = -1
    place = int(np.flatnonzero(np.argsort(scenes.position[0, 0]) == 2)[0])
    known = recorded_paths(replace(scenes, lane=lane), EVERY, CONFIG).known
    assert np.argwhere(~known).tolist() == [[4, place, 0]]


@pytest.mark.parametrize("kind", ["free", "measured", "drawn"])
def test_a_rollout_that_drives_as_recorded_is_where_the_recording_is(scenes, kind):
    scenes = with_leaver(scenes)
    place = since_start(scenes)
    if kind == "free":  # a frame is at the end of its second
        listed, later = Listed(FREE, None, 6), [*range(1, 12), 11]
        simulated = simulated_at(place[:, later], scenes.lane[:, later])
    elif kind == "measured":  # vehicles enter behind the first ones
        boundary = boundary_of(scenes)
        boundary = replace(boundary, x=boundary.x + 50.0)
        origin = boundary.x[:, :1].min(axis=2, keepdims=True)
        listed, simulated = Listed(MEASURED, boundary, 6), simulated_at(place + origin, scenes.lane)
    else:
        listed, simulated = Listed(DRAWN, None, 6), simulated_at(place + 7.0, scenes.lane)
    one_road = replace(scenes, direction=np.ones_like(scenes.direction))
    observed, found = recorded_paths(one_road, EVERY, CONFIG), simulated_paths(simulated, listed, scenes)
    both = observed.known & found.known
    assert both.sum() > both.size / 2
    for name in ("along", "across"):
        np.testing.assert_allclose(getattr(found, name)[both], getattr(observed, name)[both], atol=1e-3)
    assert found.known.all() == (kind != "measured")
    if kind == "measured":  # of the vehicle in place 0 another one took over after six seconds
        assert (~found.known).sum(axis=(0, 1)).tolist() == [6] * 6


def row_of(scene, run):
    return Scores("base", np.asarray(scene), np.asarray(run), {}, {})


def apart(one, other, column, at, known=ALL):
    """Mean distance of two scenes, vehicle by vehicle and second by second."""
    both = one.known[..., column] & other.known[..., at] & known
    distances = [
        np.hypot(
            one.along[t, v, column] - other.along[t, v, at],
            one.across[t, v, column] - other.across[t, v, at],
        )
        for t, v in np.argwhere(both)
    ]
    return np.mean(distances), len(distances)


def test_figures_of_a_row_are_those_of_its_runs(scenes):
    scenes, held_out = with_leaver(scenes), np.array([1, 4])
    observed = recorded_paths(scenes, held_out, CONFIG)
    rng = np.random.default_rng(3)
    noise = rng.normal(0, 9, (3, *observed.along.shape)).astype(np.float32)
    paths = join_scenarios([replace(observed, along=observed.along + shift) for shift in noise])
    scene, run = np.tile(held_out, 3)[:-1], np.repeat(np.arange(3), 2)[:-1]  # the last scene has two runs
    found = with_paths(row_of(scene, run), paths, np.arange(5), observed, held_out)
    for pair in range(5):
        mean, count = apart(paths, observed, pair, pair % 2)
        assert found.values["displacement"][pair] == pytest.approx(mean, rel=1e-5)
        assert found.counts["displacement"][pair] == count == 4 * 11 - 8
        assert found.values["frechet"][pair] > 0
        assert found.counts["frechet"][pair] == 4
    for place, own in enumerate(([0, 2, 4], [1, 3])):
        away = np.mean([apart(paths, observed, pair, place)[0] for pair in own])
        known = np.asarray(observed.known[..., place])
        spread = np.mean([apart(paths, paths, i, j, known)[0] for i, j in combinations(own, 2)])
        assert found.pooled["energy_score"][place] == pytest.approx(away - spread / 2, rel=1e-5)


def test_a_single_run_has_no_energy_score_and_no_pair_no_figure(scenes):
    held_out = np.array([0, 3])
    observed = recorded_paths(scenes, held_out, CONFIG)
    found = with_paths(row_of(held_out, [0, 0]), observed, np.arange(2), observed, held_out)
    assert found.values["displacement"].tolist() == found.values["frechet"].tolist() == [0.0, 0.0]
    assert np.isnan(found.pooled["energy_score"]).all()
    nobody = row_of(np.empty(0, int), np.empty(0, int))
    assert with_paths(nobody, observed, np.empty(0, int), observed, held_out) is nobody
    blind = replace(observed, known=np.zeros_like(observed.known))
    unknown = with_paths(row_of(held_out, [0, 0]), observed, np.arange(2), blind, held_out)
    assert np.isnan(unknown.values["frechet"]).all()


def test_scenes_with_other_numbers_of_vehicles_share_the_most_upstream_ones(scenes):
    held_out = np.array([0, 3])
    observed = recorded_paths(scenes, held_out, CONFIG)
    more = jax.tree.map(lambda leaf: np.concatenate([leaf, leaf[:, :1]], axis=1), observed)
    found = with_paths(row_of(held_out, [0, 0]), more, np.arange(2), observed, held_out)
    assert found.values["displacement"].tolist() == [0.0, 0.0]
    assert found.counts["frechet"].tolist() == [4, 4]
