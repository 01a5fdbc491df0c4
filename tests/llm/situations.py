"""Situations to ask about: a small one made by hand, and random ones."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from rearl_jax.config.llm import PromptConfig
from rearl_jax.config.metrics import HistConfig
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import Frames
from rearl_jax.decision.execution import MAX_SINCE_LANE_CHANGE
from rearl_jax.decision.situation import Situation
from rearl_jax.detection.detector import Detection, DetectionOptions, Thresholds
from rearl_jax.detection.references import References
from rearl_jax.detection.table import ReferenceTable, tabulate
from rearl_jax.llm.prompts import Prompter

LEFT, KEEP, RIGHT, FASTER, SLOWER = range(5)
TABULATE = jax.jit(tabulate, static_argnums=1)


def make_table(speed, spacing, action, hist=None) -> ReferenceTable:
    """References from arrays `[n_references, n_seconds, n_slots]`."""
    spacing = np.asarray(spacing, float)
    references = References(
        speed=jnp.asarray(np.asarray(speed, float)),
        spacing=jnp.asarray(spacing),
        mean_spacing=jnp.asarray(spacing.mean(axis=-1)),
        action=jnp.asarray(action),
        share=jnp.full(len(spacing), 1 / len(spacing)),
    )
    return TABULATE(references, HistConfig() if hist is None else hist)


def make_situation(second, **given) -> Situation:
    """A situation with NumPy leaves, as fetched from the device; all fields that are not given have neutral values.

    Args:
        second: Number of the second.
        given: Fields of the frame, the detection and the situation; `x` and `lane` are needed.
    """
    x, lane = np.asarray(given["x"], np.float32), np.asarray(given["lane"], np.int32)
    n_scenarios = x.shape[1]
    zeros, no_vehicle = np.zeros_like(x), np.zeros(x.shape, bool)

    def values(name, default, dtype):
        return jnp.asarray(np.broadcast_to(np.asarray(given.get(name, default), dtype), np.shape(default)))

    def scenes(name, default, dtype):
        return values(name, np.full(n_scenarios, default), dtype)

    frame = Frames(
        x=jnp.asarray(x),
        y=values("y", 4.0 * lane, np.float32),
        heading=jnp.asarray(zeros),
        speed=values("speed", zeros, np.float32),
        acceleration=values("acceleration", zeros, np.float32),
        lane=jnp.asarray(lane),
        crashed=jnp.asarray(no_vehicle),
    )
    detection = Detection(
        reference=scenes("reference", 0, np.int32),
        hellinger=scenes("hellinger", 0.0, np.float32),
        mape=scenes("mape", 0.0, np.float32),
        speed_exceeded=scenes("speed_exceeded", False, bool),
        spacing_exceeded=scenes("spacing_exceeded", False, bool),
        triggered=scenes("triggered", True, bool),
        mask=values("mask", ~no_vehicle, bool),
        spacing=values("spacing", zeros, np.float32),
        mean_spacing=scenes("mean_spacing", 0.0, np.float32),
    )
    situation = Situation(
        second=jnp.int32(second),
        frame=frame,
        target_lane=values("target_lane", lane, np.int32),
        detection=detection,
        admissible=values("admissible", np.ones((5, *x.shape)), bool),
        since_lane_change=values("since_lane_change", np.full(x.shape, MAX_SINCE_LANE_CHANGE), np.int32),
        last_action=values("last_action", np.full(x.shape, -1), np.int32),
    )
    return jax.tree.map(np.asarray, situation)


def make_thresholds(n_scenarios, hellinger=0.33, mape=0.2) -> Thresholds:
    """Equal thresholds of all scenarios."""
    return Thresholds(jnp.full(n_scenarios, hellinger), jnp.full(n_scenarios, mape))


@functools.cache
def small_table() -> ReferenceTable:
    """Two references of six seconds and three vehicles."""
    speed = np.stack([np.tile([10.0, 20.0, 30.0], (6, 1)), np.tile([6.04, 6.06, 31.96], (6, 1))])
    spacing = np.stack([np.tile([50.0, 60.0, 70.0], (6, 1)), np.tile([20.0, 20.0, 35.0], (6, 1))])
    action = np.stack([np.tile([KEEP, FASTER, LEFT], (6, 1)), np.tile([SLOWER, RIGHT, KEEP], (6, 1))])
    return make_table(speed, spacing, action)


@functools.cache
def small_situation(second) -> Situation:
    """Three cars in three scenarios; the first and the last are compared with reference 1, the middle one with 0.

    In scenario 0 car 0 leads on lane 1, car 1 follows it, car 2 is beside car 1, changing from lane 2 to lane 3; no car
    may go left. In scenario 1 all drive on lane 0, and car 1 may do nothing. Scenario 2 is not asked about car 0.
    """
    admissible = np.ones((5, 3, 3), bool)
    admissible[LEFT, :, 0] = False
    admissible[:, 1, 1] = False
    admissible[LEFT, :, 1] = False
    mask = np.ones((3, 3), bool)
    mask[0, 2] = False
    speed = [[18.0, 21.0, 5.0], [20.55, 21.0, 15.0], [25.0, 9.0, 25.0]]
    if second == 0:
        speed = np.full((3, 3), 30.0)  # outside the window of second 5
    return make_situation(
        second,
        x=[[100.0, 300.0, 0.0], [60.0, 200.0, 500.0], [62.0, 100.0, 1000.0]],
        y=[[4.0, 0.0, 4.0], [4.0, 0.0, 8.0], [9.8, 0.0, 12.0]],
        lane=[[1, 0, 1], [1, 0, 2], [2, 0, 3]],
        target_lane=[[1, 0, 1], [1, 0, 2], [3, 0, 3]],
        speed=speed,
        acceleration=[[0.0, 0.04, 0.0], [-0.04, 1.26, 0.0], [2.0, -3.0, 0.0]],
        spacing=[[39.0, 150.0, 750.0], [21.0, 100.0, 500.0], [20.0, 150.0, 750.0]],
        mean_spacing=[26.7, 133.3, 666.7],
        reference=[1, 0, 1],
        hellinger=[0.5, 0.3, 0.1],
        mape=[0.25, 0.525, 0.1],
        speed_exceeded=[True, False, False],
        spacing_exceeded=[True, True, False],
        admissible=admissible,
        mask=mask,
        last_action=[[-1, FASTER, KEEP], [KEEP, -1, -1], [RIGHT, SLOWER, -1]],
        since_lane_change=[[MAX_SINCE_LANE_CHANGE, 3, 4], [MAX_SINCE_LANE_CHANGE, 1, 2], [0, 1, 2]],
    )


def random_situation(second, n_vehicles=10, n_scenarios=8, seed=0, n_references=3) -> Situation:
    """Cars anywhere on a stretch of road, some between lanes, some with equal speeds; some asked about."""
    rng = np.random.default_rng([seed, second])
    shape = (n_vehicles, n_scenarios)
    y = rng.uniform(-1.5, 13.5, shape)
    spacing = rng.uniform(20, 250, shape)
    return make_situation(
        second,
        x=rng.uniform(0, 300, shape),
        y=y,
        lane=np.clip(np.ceil(y / 4 - 0.5), 0, 3),
        speed=rng.integers(4, 34, shape),
        acceleration=rng.normal(0, 1, shape),
        spacing=spacing,
        mean_spacing=spacing.mean(axis=0),
        reference=rng.integers(0, n_references, n_scenarios),
        mask=rng.random(shape) < 0.8,
        admissible=rng.random((5, *shape)) < 0.4,
    )


def ask_small(**options):
    """All questions of the small scene's last second."""
    prompter = Prompter(small_table(), TrafficModel(), PromptConfig(**options), DetectionOptions())
    for second in range(6):
        questions = prompter.questions(small_situation(second), make_thresholds(3))
    return questions
