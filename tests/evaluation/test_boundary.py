"""Scenes among recorded vehicles: keys that contradict it, distances from the recording, the replay's vehicles."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import InitConfig, InitialSource
from rearl_jax.config.decision import DecisionConfig, PolicyName
from rearl_jax.config.evaluation import EvaluationConfig, Method, SeedScope
from rearl_jax.config.scenes import BoundarySource, ScenesConfig, SpeedConfig, SpeedNorm
from rearl_jax.core.replayed import NOT_RECORDED
from rearl_jax.core.rollout import Frames
from rearl_jax.data.scenes import boundary_cache
from rearl_jax.data.scenes.boundary import SceneBoundary
from rearl_jax.evaluation import figures
from rearl_jax.evaluation.boundaries import check_boundary, recorded_boundary
from rearl_jax.evaluation.positions import overlaps, position_extra, position_figures, positions_of
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row
from rearl_jax.evaluation.runner import Evaluation, Sample
from rearl_jax.evaluation.scores import Scores
from rearl_jax.evaluation.simulators import Simulated
from rearl_jax.replay.embedding import positions, replay_data
from rearl_jax.replay.scenes import Decision, Replay, ReplayedScene
from rearl_jax.workflows import cut_scenes
from tests.refusal import refused

MEASURED = EvaluateTask(scenes=ScenesConfig(boundary=BoundarySource.measured))


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"init": InitConfig(InitialSource.seed)}, "init.source"),
        ({"speed": SpeedConfig(SpeedNorm.minmax)}, "speed.norm"),
        ({"eval": EvaluationConfig(seed_scope=SeedScope.run)}, "eval.seed_scope"),
        ({"method": Method.ppo}, "method"),
        ({"method": Method.critical}, "method"),
        ({"method": Method.rearl, "decision": DecisionConfig(PolicyName.llm)}, "decision.policy"),
    ],
)
def test_keys_that_contradict_a_boundary_are_refused(scenes, changes, key):
    check_boundary(MEASURED)
    config = replace(MEASURED, **changes)
    for refuse in (check_boundary, lambda config: Rollouts([Row(config)], scenes, np.arange(6))):
        with refused("out-of-range", key=key):
            refuse(config)
    check_boundary(replace(config, scenes=ScenesConfig()))


def test_given_scenes_have_no_surroundings():
    with refused("recordings-needed", key="scenes.boundary"):
        check_boundary(MEASURED, has_given_scenes=True)
    check_boundary(replace(MEASURED, scenes=ScenesConfig()), has_given_scenes=True)


def test_surroundings_are_read_once(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    scenes, subset = cut_scenes(), np.array([2, 5])
    first = recorded_boundary(MEASURED, scenes, subset)
    monkeypatch.setattr(boundary_cache, "cut_boundary", None)
    again = recorded_boundary(MEASURED, scenes, subset)
    for name, values in vars(first).items():
        np.testing.assert_array_equal(values, getattr(again, name), err_msg=name)
    np.testing.assert_array_equal(np.sort(first.track_id), np.sort(scenes.track_id[subset]))
    assert recorded_boundary(replace(MEASURED, scenes=ScenesConfig()), scenes, subset) is None


def boundary_of(scenes):
    """Vehicle 3 of the small scenes is replayed in the place of nobody, and enters place 0 in second 6."""
    n_scenes, n_frames, n_slots = scenes.speed.shape
    shape, places = (n_scenes, n_frames, n_slots), (n_scenes, n_frames, 1)
    is_new = np.zeros(shape, bool)
    is_new[:, 6, 0] = True
    steps = (n_scenes, n_frames, 2, 1)
    lane = np.full(steps, NOT_RECORDED, np.int16)
    lane[:, :6] = 1
    x = np.zeros(steps, np.float32) + np.arange(n_frames, dtype=np.float32)[:, None, None]
    return SceneBoundary(
        track_id=np.where(np.arange(n_frames)[:, None] < 6, scenes.track_id, scenes.track_id + 10),
        is_new=is_new,
        x=scenes.position - scenes.position.min(axis=(1, 2), keepdims=True),
        speed=scenes.speed,
        lane=scenes.lane.astype(np.int64),
        highest_speed=scenes.speed,
        replayed_id=np.full(places, 77),
        replayed_number=np.full(places, n_slots),
        replayed_length=np.full(places, 5, np.float32),
        replayed_is_truck=np.zeros(places, bool),
        replayed_x=x,
        replayed_speed=x,
        replayed_acceleration=x,
        replayed_lane=lane,
    )


def frames_at(x, lane):
    """Frames of vehicles at positions `[scenarios, frames, vehicles]`."""
    x = jnp.asarray(np.moveaxis(x, 0, -1))
    still, lane = jnp.zeros_like(x), jnp.asarray(np.moveaxis(lane, 0, -1), jnp.int32)
    return Frames(x, still, still, still, still, lane, jnp.zeros(x.shape, bool))


class Listed(Rollouts):
    """Rollouts of one run in the order of the scenes, which are simulated elsewhere."""

    def __init__(self, config, boundary, n_scenes):
        self.config, self.boundary = config, boundary
        self._served, self._n_runs, self._numbers = np.arange(n_scenes), 1, range(n_scenes)


def test_distances_count_from_the_second_after_a_vehicle_has_entered(scenes):
    boundary, n_scenes = boundary_of(scenes), len(scenes)
    ahead = boundary.x + 3.0
    ahead[:, 0] += 50.0
    ahead[:, 6, 0] += 50.0  # it has just entered
    simulated = Simulated(frames_at(ahead, boundary.lane), np.full((4, n_scenes), 5.0))
    listed = Listed(MEASURED, boundary, n_scenes)
    found = positions_of(simulated, listed, scenes)
    np.testing.assert_allclose(found.error, 3.0)
    np.testing.assert_allclose(found.first_error, 3.0)
    ahead[:, 7:, 0] += 9.0
    entered = positions_of(replace(simulated, frames=frames_at(ahead, boundary.lane)), listed, scenes)
    assert (entered.error > 3.0).all()
    np.testing.assert_allclose(entered.first_error, 3.0)
    assert position_figures(found)["position_error"] == pytest.approx(3.0)
    table = position_extra(scenes.scene_id, {"base": found}).tables["positions"]
    assert list(table.columns) == ["method", "scene_id", "run", "position_error", "overlap_share"]
    drawn = EvaluateTask(init=InitConfig(InitialSource.seed))
    assert positions_of(simulated, Listed(drawn, None, n_scenes), scenes) is None


def test_free_scenes_are_compared_with_the_vehicles_they_began_with(scenes):
    config = replace(MEASURED, scenes=ScenesConfig())
    track = scenes.track_id.copy()
    track[:, 4:, 1] = 99  # another vehicle is picked
    scenes = replace(scenes, track_id=track)
    place = scenes.position - scenes.position[:, :1].min(axis=2, keepdims=True)
    x = np.concatenate([place[:, 1:], place[:, -1:]], axis=1) - 2.0  # a frame is at the end of its second
    x[:, 3:, 1] += 1e3
    simulated = Simulated(frames_at(x, scenes.lane), np.full((4, len(scenes)), 5.0))
    listed = Listed(config, None, len(scenes))
    np.testing.assert_allclose(positions_of(simulated, listed, scenes).error, 2.0)
    track[:, 6:, 1] = track[:, 0, 1, None]  # picked again, as with scenes.pick=total_duration
    again = positions_of(simulated, listed, scenes)
    assert (again.error > 3.0).all()
    np.testing.assert_allclose(again.first_error, 2.0)


def test_vehicles_inside_replayed_ones_are_counted(scenes):
    boundary = boundary_of(scenes)
    x, lane = np.full(scenes.speed.shape, 500.0), np.ones(scenes.speed.shape)
    x[0, :, 2] = 2.0  # the replayed one passes it in the first six seconds, at 0 to 5 m
    lane[0, 3, 2] = 0
    simulated = Simulated(frames_at(x, lane), np.full((4, len(scenes)), 4.0))
    inside = overlaps(simulated, boundary, np.arange(len(scenes)))
    np.testing.assert_array_equal(np.argwhere(inside), [[0, second, 2] for second in (0, 1, 2, 4, 5)])


def test_the_space_time_diagram_joins_no_two_vehicles(scenes, monkeypatch):
    boundary, drawn = boundary_of(scenes).select(np.array([2])), []
    boundary.track_id[:, :6, 1:], boundary.track_id[:, 6:, 1:] = 1000 + np.arange(3), 1000 + np.arange(3)
    frames = frames_at(boundary.x, boundary.lane)
    crashed = np.zeros(frames.crashed.shape, bool)
    crashed[4:6, 0] = crashed[9:, 0] = True  # both vehicles in place 0
    shown = jax.tree.map(lambda values: np.asarray(values[..., 0]), replace(frames, crashed=jnp.asarray(crashed)))
    sample = Sample(2, shown, np.full(4, 5.0), boundary, np.zeros(32, np.int64))
    row = Scores("base", np.array([2]), np.zeros(1, int), {}, {})
    monkeypatch.setattr(figures.drawing, "png", lambda figure: drawn.append(figure) or b"")
    figures.space_time(MEASURED, Evaluation(MEASURED, scenes, np.array([2]), [row], sample, "base"))
    _, panel, *_ = drawn[0].axes
    (lines,) = panel.collections
    assert len(lines.get_segments()) == 4 * (scenes.seconds - 1) - 1
    (crosses,) = (line for line in panel.lines if line.get_marker() == "x")
    assert crosses.get_xdata().tolist() == [4, 9]


def test_the_replay_tells_replayed_and_entered_vehicles(scenes, small):
    boundary = boundary_of(scenes)
    frames = frames_at(boundary.x, boundary.lane)
    frames = replace(frames, crashed=frames.crashed.at[8:, 0].set(True))
    first = jax.tree.map(lambda values: values[..., 0], frames)
    told = (Decision(0, 2, 0, 3), Decision(0, 7, 0, 4))
    shown = ReplayedScene(0, 0, first, np.full(4, 5.0), 0.5, told, boundary.select(np.array([0])))
    (scene,) = replay_data(Replay(small, scenes, (shown,), "", has_decisions=True))["scenes"]
    simulated = [piece for piece in scene["sim"]["vehicles"] if "r" not in piece]
    (replayed,) = (piece for piece in scene["sim"]["vehicles"] if "r" in piece)
    assert [(piece["t"], len(piece["x"])) for piece in simulated[:3]] == [(0, 6), (6, 6), (0, 12)]
    np.testing.assert_allclose(positions(replayed["x"]), np.arange(6))
    assert (scene["sim"]["places"], len(simulated)) == (4, 5)
    assert scene["sim"]["crash"] == [-1, 8, -1, -1, -1]
    assert scene["sim"]["asked"] == [[2, 0, 3], [7, 1, 4]]
