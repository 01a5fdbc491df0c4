"""Initial states: common random numbers, measured states, and the size of a batch that must not matter."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.core import InitConfig, InitialSource, InitialSpeed
from rearl_jax.config.driver import record_of
from rearl_jax.config.evaluation import EvaluationConfig, SeedScope
from rearl_jax.core.effects.stimulus import OUT_OF_SIGHT
from rearl_jax.core.model import traffic_model
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row
from rearl_jax.evaluation.runner import evaluate
from rearl_jax.evaluation.simulators import begin
from rearl_jax.evaluation.tables import frame_table, run_table
from tests.refusal import refused

HELD_OUT = np.arange(6)


def frames_of(config, scenes, held_out=HELD_OUT, mixture=None, **keys):
    rollouts = Rollouts([Row(config, mixture=mixture)], scenes, held_out, **keys)
    parts = [part.frames for part in rollouts.chunks()]
    return rollouts, jax.tree.map(lambda *leaves: np.concatenate(leaves, axis=-1), *parts)


@pytest.mark.usefixtures("drifting")
def test_a_rollout_depends_on_seed_run_and_scene_alone(scenes, small):
    everything, frames = frames_of(small, scenes)
    assert len(everything) == 18
    assert len(np.unique(frames.x[0, 0])) == 18  # no two start alike
    few, other = frames_of(replace(small, eval=replace(small.eval, n_runs=2)), scenes, np.array([2, 4, 5]))
    for column, (run, scene) in enumerate(zip(few.run, few.scene, strict=True)):
        twin = np.flatnonzero((everything.run == run) & (everything.scene == scene))
        np.testing.assert_array_equal(other.x[..., column], frames.x[..., twin[0]])
        np.testing.assert_array_equal(other.lane[..., column], frames.lane[..., twin[0]])
    _, reseeded = frames_of(replace(small, eval=replace(small.eval, seed=1)), scenes)
    assert not np.isin(reseeded.x[0, 0], frames.x[0, 0]).any()


def test_any_number_of_rollouts_is_counted_not_listed(scenes, small):
    row = Row(replace(small, eval=replace(small.eval, n_runs=10**9)))
    many = Rollouts([row], scenes, np.array([2, 5]))
    assert len(many) == 2 * 10**9
    last = many[len(many) - 3 :]
    assert last.run.tolist() == [10**9 - 2, 10**9 - 1, 10**9 - 1]
    assert last.scene.tolist() == [5, 2, 5]
    assert last.row.tolist() == [0, 0, 0]


@pytest.mark.usefixtures("drifting")
def test_parts_are_what_the_whole_is(scenes, small):
    for source in InitialSource:
        config = replace(small, init=InitConfig(source=source))
        rollouts, frames = frames_of(config, scenes, np.array([1, 3, 4]))
        part = rollouts[2:8]
        np.testing.assert_array_equal(part.scene, rollouts.scene[2:8])
        np.testing.assert_array_equal(part.run, rollouts.run[2:8])
        (simulated,) = part.chunks()
        np.testing.assert_array_equal(simulated.frames.x, frames.x[..., 2:8])


@pytest.mark.usefixtures("drifting")
def test_common_random_numbers_of_different_models(scenes, small):
    # A method that drives differently starts from the same vehicles.
    _, frames = frames_of(small, scenes)
    changed = replace(small.core, lane_changes=False, ticks_per_second=30, speed_limit=30.0)
    _, other = frames_of(replace(small, core=changed), scenes)
    np.testing.assert_array_equal(frames.x, other.x)


@pytest.mark.usefixtures("drifting")
def test_one_rollout_per_run_serves_every_scene(scenes, small):
    shared = replace(small, eval=replace(small.eval, n_runs=6, seed_scope=SeedScope.run))
    rollouts, frames = frames_of(shared, scenes, np.array([2, 5]))
    assert len(rollouts) == 6
    _, other = frames_of(shared, scenes, np.array([1, 3, 4]))
    np.testing.assert_array_equal(frames.x, other.x)
    assert len(np.unique(frames.x[0, 0])) == 6


@pytest.mark.usefixtures("drifting")
def test_fixed_initial_speed(scenes, small):
    _, drawn = frames_of(small, scenes)
    assert drawn.speed.min() >= 21.0
    assert drawn.speed.max() <= 24.0
    assert drawn.speed.std() > 0.5
    fixed = replace(small, init=InitConfig(InitialSource.seed, InitialSpeed.fixed_25))
    _, frames = frames_of(fixed, scenes)
    assert (frames.speed == 25.0).all()


@pytest.mark.usefixtures("drifting")
def test_rollouts_from_the_measured_snapshot(scenes, small):
    measured = replace(small, init=InitConfig(source=InitialSource.scene))
    rollouts, frames = frames_of(measured, scenes, np.array([1, 4]))
    for column, scene in enumerate(rollouts.scene):
        speed = scenes.scaled_speed[scene, 0]
        start = frames.x[0, :, column] - speed
        position = scenes.position[scene, 0]
        np.testing.assert_allclose(start, position - position.min(), atol=1e-3)
        np.testing.assert_allclose(frames.speed[0, :, column], speed, rtol=1e-6)
        # Carriageway 2 lies to the right of the two lanes of carriageway 1.
        assert frames.lane[0, :, column].tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize("wanted", [5.0, 30.0, None])
def test_drivers_of_recorded_vehicles_want_at_most_what_was_seen(scenes, small, wanted):
    driver = small.driver if wanted is None else record_of("idm")(desired_speed=wanted)
    measured = replace(small, init=InitConfig(InitialSource.scene), driver=driver)
    rollouts = Rollouts([Row(measured)], scenes, np.array([1, 4]))
    batch, model = rollouts._batch(), traffic_model(measured.core)
    state, _, _ = jax.jit(lambda batch: begin(batch, measured.core, measured.init.speed, model))(batch)
    highest = scenes.scaled_speed[rollouts.scene].max(axis=1).T
    assert highest.min() < 15.0 < 30.0 < highest.max()
    np.testing.assert_allclose(state.desired_speed, np.minimum(highest, wanted or np.inf), rtol=1e-6)
    np.testing.assert_array_equal(state.x, batch.measured.x)  # nobody is moved to make room


def test_drivers_of_recorded_vehicles_remember_the_recorded_places(scenes, small):
    """Vehicles a metre apart on one lane are not moved to make room, not even in the drivers' memory."""
    measured = replace(small, init=InitConfig(InitialSource.scene), driver=record_of("idm")())
    batch, model = Rollouts([Row(measured)], scenes, np.array([1, 4]))._batch(), traffic_model(measured.core)
    recorded = jax.tree.map(jnp.asarray, batch.measured)
    place = 100.0 + (measured.driver.length + 1.0) * jnp.arange(4.0, dtype=jnp.float32)
    places = jnp.broadcast_to(place[:, None], recorded.x.shape)
    close = batch._replace(measured=replace(recorded, x=places, y=jnp.zeros_like(places)))
    state, _, _ = jax.jit(lambda batch: begin(batch, measured.core, measured.init.speed, model))(close)
    np.testing.assert_array_equal(state.x, places)
    np.testing.assert_allclose(state.memory.leader_history.gap[:-1], 1.0, rtol=1e-5)
    assert (state.memory.leader_history.gap[-1] == OUT_OF_SIGHT).all()


def test_recorded_starts_are_on_the_recorded_road(scenes, small):
    measured = replace(small, init=InitConfig(source=InitialSource.scene))

    def road(scenes, **keys):
        return Rollouts([Row(replace(measured, core=replace(small.core, **keys)))], scenes, HELD_OUT).config.core

    assert (road(scenes).n_lanes, road(scenes).speed_limit) == (4, pytest.approx(scenes.scaled_speed.max()))
    one_way = replace(scenes, settings={"scenes.direction": "per_direction"})
    assert (road(one_way).n_lanes, road(one_way, n_lanes=7).n_lanes) == (2, 7)
    assert (road(scenes, speed_limit=None).speed_limit, road(scenes, speed_limit=50.0).speed_limit) == (None, 50.0)
    wide = replace(scenes, infos=tuple(replace(info, lane_count={1: 5, 2: 5}) for info in scenes.infos))
    with refused("lanes-too-many") as caught:
        road(wide)
    assert "per_direction" in caught.value.problem.remedy
    assert Rollouts([Row(small)], scenes, HELD_OUT).config == small


def test_measured_snapshots_that_do_not_fit_the_road_stop(scenes, small):
    measured = replace(small, init=InitConfig(source=InitialSource.scene))
    for changed, key, value in (
        (replace(measured, core=replace(small.core, n_lanes=3)), "core.n_lanes", "at least 4"),
        (replace(measured, core=replace(small.core, n_vehicles=10)), "core.n_vehicles", "the 4 vehicles"),
        (
            replace(measured, eval=replace(small.eval, seed_scope=SeedScope.run)),
            "eval.seed_scope",
            "run_x_scene",
        ),
    ):
        with refused("out-of-range", key=key) as caught:
            Rollouts([Row(changed)], scenes, HELD_OUT)
        assert caught.value.problem.fault.startswith(f"must be {value}")
    blind = replace(scenes, lane=np.full_like(scenes.lane, -1))
    with refused("lane-missing", key="init.source"):
        Rollouts([Row(measured)], blind, HELD_OUT)


@pytest.mark.thorough
@pytest.mark.usefixtures("drifting")
def test_batches_of_any_width_score_alike(scenes, small):
    tables = []
    for width in (5, 512):
        config = replace(small, core=replace(small.core, chunk=width))
        evaluation = evaluate(config, scenes, np.array([0, 2, 3, 5]))
        tables.append((run_table(evaluation), frame_table(evaluation, config.hist.window)))
        base = evaluation.rows[0]
        assert (base.values["lcr"] > 0).any()
        assert (base.values["collisions"] == 1 / 4).all()
        assert len(base.scene) == 12
    (runs, frames), (other_runs, other_frames) = tables
    assert runs.equals(other_runs)
    assert frames.equals(other_frames)


@pytest.mark.slow
def test_the_real_simulation_does_not_depend_on_the_batch(scenes, small):
    core = replace(small.core, n_vehicles=10, density=3.0, collisions=True)
    config = replace(small, eval=EvaluationConfig(n_runs=8))
    _, together = frames_of(replace(config, core=replace(core, chunk=512)), scenes)
    assert together.x.shape == (12, 10, 48)
    assert int((together.lane[1:] != together.lane[:-1]).sum()) > 10
    _, apart = frames_of(replace(config, core=replace(core, chunk=11)), scenes)
    np.testing.assert_array_equal(together.lane, apart.lane)
    np.testing.assert_array_equal(together.crashed, apart.crashed)
    for name in ("x", "y", "speed"):
        # The compiler may round differently in batches of another width: one unit in the last place.
        np.testing.assert_allclose(getattr(together, name), getattr(apart, name), rtol=1e-5, atol=1e-4)
