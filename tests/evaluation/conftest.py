"""One real evaluation of the shipped recordings for all tests, and small scenes that are quick to score."""

import contextlib
import functools
import io
import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

N_SCENES, N_FRAMES, N_SLOTS = 6, 12, 4


@dataclass(frozen=True)
class Done:
    """A run of `rearl evaluate`: its configuration, measures, printed text and folder."""

    config: object
    evaluation: object
    estimates: dict
    summary: list
    printed: str
    folder: Path

    def table(self, name):
        return pd.read_parquet(self.folder / f"{name}.parquet")


@pytest.fixture(scope="session")
def done(tmp_path_factory):
    """`rearl evaluate eval.n_runs=1` on the shipped US-101 recordings."""
    from rearl_jax.config import EvaluateTask, ResultsConfig
    from rearl_jax.config.evaluation import EvaluationConfig
    from rearl_jax.evaluation import task

    root = tmp_path_factory.mktemp("results")
    config = EvaluateTask(results=ResultsConfig(root=str(root)), eval=EvaluationConfig(n_runs=1))
    seen = {}

    def keeping(name, function):
        def called(*arguments):
            seen[name] = function(*arguments)
            return seen[name]

        return called

    printed = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
        for name in ("evaluate", "estimates"):
            patch.setattr(task, name, keeping(name, getattr(task, name)))
        rows = task.run(config)["rows"]
    folder = root / "evaluate"
    assert rows == [{key: row[key] for key in rows[0]} for row in json.loads((folder / "summary.json").read_text())]
    return Done(config, seen["evaluate"], seen["estimates"], rows, printed.getvalue(), folder)


@pytest.fixture
def scenes():
    """Small scenes."""
    return made_scenes()


def made_scenes():
    """Six scenes of two recordings, four vehicles each, on two carriageways of two lanes."""
    from rearl_jax.config.scenes import SpeedNorm
    from rearl_jax.data.records import RecordingInfo
    from rearl_jax.data.scenes.scene_set import SceneCounts, SceneSet

    rng = np.random.default_rng(7)
    shape = (N_SCENES, N_FRAMES, N_SLOTS)
    speed = rng.uniform(8.0, 30.0, (N_SCENES, 1, N_SLOTS)) + rng.normal(0.0, 0.5, shape)
    position = rng.uniform(10.0, 300.0, (N_SCENES, 1, N_SLOTS)) + np.cumsum(speed, axis=1)
    direction = np.broadcast_to(np.array([1, 1, 2, 2], np.int8), shape).copy()
    lane = np.broadcast_to(np.array([0, 1, 0, 1], np.int8), shape).copy()
    lane[:, N_FRAMES // 2 :, 0] = 1
    next_lane = np.concatenate([lane[:, 1:], lane[:, -1:]], axis=1)
    x = np.where(direction == 2, position, 1000.0 - position)
    y = 4.0 * lane + 20.0 * (direction == 2)
    gap = np.hypot(x[..., :, None] - x[..., None, :], y[..., :, None] - y[..., None, :])
    info = RecordingInfo("a", 25.0, {1: 2, 2: 2}, 1000.0, "a set", "CC0", "somebody", notes=("a note",))
    return SceneSet(
        scene_id=np.arange(N_SCENES),
        recording=np.array(["a", "a", "a", "b", "b", "b"]),
        window=np.array([0, 1, 2, 0, 1, 2]),
        start_frame=np.arange(N_SCENES),
        start_time=np.array([0.0, 1.0, 2.0, 0.0, 1.0, 2.0]) * N_FRAMES,
        frame_rate=np.full(N_SCENES, 25.0),
        track_id=np.broadcast_to(np.arange(N_SLOTS), shape).copy(),
        x=x,
        y=y,
        position=position,
        lane=lane,
        direction=direction,
        length=np.full(shape, 4.5),
        speed=speed,
        action=np.ones(shape, np.int8),
        has_next=np.ones(shape, bool),
        next_lane=next_lane,
        spacing=gap.sum(axis=-1) / (N_SLOTS - 1),
        feature_distance=gap.sum(axis=-1) / (N_SLOTS - 1),
        is_long_track=np.ones(shape, bool),
        speed_min=float(speed.min()),
        speed_max=float(speed.max()),
        speed_norm=SpeedNorm.minmax,
        infos=(info, replace(info, id="b")),
        counts=SceneCounts(2, 0, 6, 0, 6),
        settings={},
    )


@pytest.fixture(scope="session")
def simulated_by():
    """Replaces the traffic of base and critical, in a context; programs that are compiled in it end with it."""
    from rearl_jax.evaluation import rollouts, simulators

    @contextlib.contextmanager
    def replacing(simulate):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(simulators, "simulate_base", simulate)
            patch.setattr(rollouts, "program", functools.cache(simulators.program.__wrapped__))
            yield

    return replacing


def drift(state, drivers, model, n_seconds):
    """Frames of vehicles that keep their speed, which compile in no time.

    Vehicle 0 changes to lane 3 after the fifth second and crashes after the eighth.
    """
    import jax.numpy as jnp

    from rearl_jax.core.rollout import Frames
    from rearl_jax.core.state import nearest_lane

    second = jnp.arange(1, n_seconds + 1)[:, None, None]
    same = jnp.zeros((n_seconds, *state.x.shape), state.x.dtype)
    first = jnp.arange(state.x.shape[0])[None, :, None] == 0
    y = jnp.where(first & (second > 5), 3 * model.lane_width, state.y[None] + same).astype(state.y.dtype)
    return Frames(
        x=state.x[None] + second.astype(state.x.dtype) * state.speed[None],
        y=y,
        heading=same,
        speed=state.speed[None] + same,
        acceleration=same,
        lane=nearest_lane(y, model),
        crashed=first & (second > 8) & (same == 0),
    )


@pytest.fixture(scope="module")
def drifting(simulated_by):
    """The method base replaced by vehicles that drift."""
    with simulated_by(drift):
        yield


@pytest.fixture(scope="module")
def standing(simulated_by):
    """Base and critical replaced by vehicles that keep their speed; acceleration and heading show the drivers.

    A list of whether the drivers of each program are cooperative, one entry per tracing.
    """
    import jax.numpy as jnp

    from rearl_jax.core.rollout import Frames
    from rearl_jax.core.state import nearest_lane

    traced = []

    def simulate(state, drivers, model, n_seconds):
        traced.append(model.cooperative)
        second = jnp.arange(n_seconds, dtype=state.x.dtype)[:, None, None]
        same = jnp.zeros((n_seconds, *state.x.shape), state.x.dtype)
        return Frames(
            x=state.x[None] + second * state.speed[None],
            y=state.y[None] + same,
            heading=state.desired_speed[None] + same,
            speed=state.speed[None] + same,
            acceleration=drivers.car_following.max_accel[None] + same,
            lane=nearest_lane(state.y, model)[None] + jnp.zeros(same.shape, jnp.int32),
            crashed=same > 0,
        )

    with simulated_by(simulate):
        yield traced


@pytest.fixture
def small(scenes):
    """A configuration for the small scenes with drawn starts; six rollouts at a time: one program for all tests."""
    from rearl_jax.config import EvaluateTask
    from rearl_jax.config.core import CoreConfig, InitConfig, InitialSource
    from rearl_jax.config.evaluation import EvaluationConfig

    return EvaluateTask(
        init=InitConfig(InitialSource.seed),
        core=CoreConfig(n_vehicles=N_SLOTS, collisions=False, chunk=6),
        eval=EvaluationConfig(n_runs=3, resamples=200, noise_draws=50),
    )


@pytest.fixture
def references(scenes):
    """Two of the small scenes as representatives."""
    return representatives(scenes)


def representatives(scenes):
    """Two of the scenes as representatives."""
    import jax.numpy as jnp

    from rearl_jax.detection.references import References

    chosen = [0, 3]
    arrays = (scenes.scaled_speed, scenes.spacing, scenes.mean_spacing)
    speed, spacing, mean = (jnp.asarray(values[chosen], jnp.float32) for values in arrays)
    action = jnp.asarray(scenes.action[chosen], jnp.int32)
    return References(speed, spacing, mean, action, jnp.asarray([0.25, 0.75], jnp.float32))


@pytest.fixture
def intervening(small):
    """The small configuration with interventions."""
    from rearl_jax.config.evaluation import Method

    return replace(small, method=Method.rearl)
