"""Training of the PPO policy, with regular checkpoints from which an interrupted training continues.

All random numbers of an update follow from the seed and its number alone, so a resumed training equals an
uninterrupted one bit for bit.
"""

import functools
import io
import json
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pandas as pd
from jaxtyping import Array, Float, Int, Key

from rearl_jax._typing import PRNGKey
from rearl_jax.baselines.driving import DrivingOptions
from rearl_jax.baselines.experience import Experience, collect
from rearl_jax.baselines.learning import Learner, Losses, decisions_of, improve, make_optimiser
from rearl_jax.baselines.network import ActorCritic, make_network
from rearl_jax.code_version import code_hash
from rearl_jax.config import TrainPpoTask
from rearl_jax.config.core import CoreConfig
from rearl_jax.config.decision import AdmissibleConfig
from rearl_jax.config.ppo import PpoConfig
from rearl_jax.core.model import traffic_model
from rearl_jax.core.spawn import spawn
from rearl_jax.decision.situation import ACTION_NAMES
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.results import Study, config_hash

log = logging.getLogger(__name__)

CHECKPOINT = "checkpoint.eqx"
"""Checkpoint from which an interrupted training continues; removed at the end."""

FIRST_RUN = 2**31
"""First run number of the updates. An evaluation numbers its runs from 0, so training and evaluation never share an
initial state, whatever the seeds.
"""

ACTION_STREAM = 2**31
"""Number of the random stream of actions and of the order of decisions, separate from that of initial states."""

WEIGHTS_RUN = 2**32 - 1
"""Run number of the random key of the initial weights."""

Update: TypeAlias = Callable[[Learner, Int[Array, ""], Int[Array, ""]], tuple[Learner, "CurvePoint"]]
"""Function from the learner, the seed and the number of an update to the learner after it and the update's figures."""


class CurvePoint(eqx.Module):
    """Figures of one update, or arrays of figures of all updates.

    Attributes:
        episode_return: Sum of the rewards of a vehicle until it crashes or the rollout ends; mean over vehicles.
        crashed: Share of the vehicles that crash.
        speed: Mean speed of the vehicles that drive [m/s].
        actions: Share of each action in all decisions, in the order of `MetaAction`.
        losses: Means over the gradient steps.
    """

    episode_return: Float[Array, "*updates"]
    crashed: Float[Array, "*updates"]
    speed: Float[Array, "*updates"]
    actions: Float[Array, "*updates actions"]
    losses: Losses


@dataclass(frozen=True)
class Training:
    """A finished training.

    Attributes:
        network: The trained network.
        curve: Figures of every update, `[n_updates]`.
        n_before: Updates made by an earlier process.
        compile_s: Time of compiling [s].
        seconds: Time of the updates of this process [s].
    """

    network: ActorCritic
    curve: CurvePoint
    n_before: int
    compile_s: float
    seconds: float


def training_keys(
    seed: Int[Array, ""], update: Int[Array, ""], n_scenarios: int
) -> tuple[Key[Array, " scenarios"], PRNGKey]:
    """Random keys of an update: for the initial traffic of each scenario, and for actions and the order of decisions.

    The keys of the traffic are made from seed, run and scene as in an evaluation, but no evaluation has these run
    numbers.
    """
    run_key = jax.random.fold_in(jax.random.key(seed), jnp.uint32(FIRST_RUN) + update.astype(jnp.uint32))
    keys = jax.vmap(lambda scenario: jax.random.fold_in(run_key, scenario))(jnp.arange(n_scenarios, dtype=jnp.uint32))
    return keys, jax.random.fold_in(run_key, ACTION_STREAM)


def first_learner(config: TrainPpoTask) -> Learner:
    """The learner before the first update."""
    key = jax.random.fold_in(jax.random.key(config.ppo.seed), WEIGHTS_RUN)
    network = jax.jit(functools.partial(make_network, width=config.ppo.width, layers=config.ppo.layers))(key)
    return Learner(network, _optimiser(config.ppo, config.core).init(cast(optax.Params, network)))


def make_update(ppo: PpoConfig, admissible: AdmissibleConfig, core: CoreConfig) -> Update:
    """One update: rollouts with the learner's policy, then gradient steps on them."""
    model = traffic_model(core)
    options = DrivingOptions(admissible, ppo.longitudinal)
    optimiser = _optimiser(ppo, core)

    def update(learner: Learner, seed: Int[Array, ""], update_number: Int[Array, ""]) -> tuple[Learner, CurvePoint]:
        keys, policy_key = training_keys(seed, update_number, ppo.scenarios)
        action_key, order_key = jax.random.split(policy_key)
        dtype = jnp.dtype(core.dtype.name)
        state, drivers = spawn(keys, model, n_vehicles=core.n_vehicles, density=core.density, dtype=dtype)
        experience = collect(state, drivers, learner.network, action_key, model, options, n_seconds=ppo.horizon)
        learner, losses = improve(learner, decisions_of(experience, ppo), order_key, ppo, optimiser)
        return learner, point_of(experience, jax.tree.map(jnp.mean, losses))

    return update


def _optimiser(ppo: PpoConfig, core: CoreConfig) -> optax.GradientTransformation:
    return make_optimiser(ppo, ppo.n_updates(core.n_vehicles), ppo.batch(core.n_vehicles))


@dataclass(frozen=True)
class _Program:
    """A compiled update, the shapes of its figures, and the time of compiling [s]."""

    update: Update
    point: CurvePoint
    seconds: float


def _program(config: TrainPpoTask) -> _Program:
    """The compiled update, shared by all trainings of a process that differ only in the seed."""
    return _compiled(replace(config.ppo, seed=0), config.admissible, config.core)


@functools.cache
def _compiled(ppo: PpoConfig, admissible: AdmissibleConfig, core: CoreConfig) -> _Program:
    function, zero = make_update(ppo, admissible, core), jnp.int32(0)
    learner = first_learner(TrainPpoTask(ppo=ppo, admissible=admissible, core=core))
    begin = time.perf_counter()
    update = jax.jit(function).lower(learner, zero, zero).compile()
    return _Program(update, jax.eval_shape(function, learner, zero, zero)[1], time.perf_counter() - begin)


def point_of(experience: Experience, losses: Losses) -> CurvePoint:
    """Figures of the rollouts of one update."""
    drives, decides = experience.drives, experience.decides
    n_decisions = jnp.maximum(jnp.sum(decides, dtype=jnp.int32), 1).astype(jnp.float32)
    shares = [jnp.sum(decides & (experience.action == action), dtype=jnp.int32) for action in range(len(ACTION_NAMES))]
    n_drives = jnp.sum(drives, dtype=jnp.int32).astype(jnp.float32)
    return CurvePoint(
        episode_return=jnp.mean(jnp.sum(jnp.where(drives, experience.reward, 0.0), axis=0)),
        crashed=jnp.mean(experience.crashed[-1].astype(jnp.float32)),
        speed=jnp.sum(jnp.where(drives, experience.speed, 0.0)) / n_drives,
        actions=jnp.stack(shares).astype(jnp.float32) / n_decisions,
        losses=losses,
    )


def train(
    config: TrainPpoTask, study: Study, progress: Callable[[int, int], None] = lambda done, total: None
) -> Training:
    """The trained network and its learning curve; continues from the study's checkpoint if there is one.

    Raises:
        InvalidInputError: The weights have become infinite.
    """
    n_updates = config.ppo.n_updates(config.core.n_vehicles)
    program, learner, seed = _program(config), first_learner(config), jnp.int32(config.ppo.seed)
    curve = jax.tree.map(lambda leaf: np.full((n_updates, *leaf.shape), np.nan, leaf.dtype), program.point)
    learner, curve, n_before = _restored(config, study, learner, curve)
    progress(n_before, n_updates)
    begin = time.perf_counter()
    for update_number in range(n_before, n_updates):
        learner, point = program.update(learner, seed, jnp.int32(update_number))
        if not np.isfinite(point.losses.total):
            message = f"must be lower: the training has diverged in update {update_number + 1} of {n_updates}"
            problem = Problem("diverged", message, key="ppo.learning_rate", value=f"{config.ppo.learning_rate:g}")
            raise InvalidInputError(problem)
        for values, value in zip(jax.tree.leaves(curve), jax.tree.leaves(point), strict=True):
            values[update_number] = value
        done = update_number + 1
        if done % config.ppo.checkpoint_every == 0 or done == n_updates:
            study.write_bytes(CHECKPOINT, _checkpoint(config, learner, curve, done))
        progress(done, n_updates)
    return Training(learner.network, curve, n_before, program.seconds, time.perf_counter() - begin)


def _checkpoint(config: TrainPpoTask, learner: Learner, curve: CurvePoint, n_done: int) -> bytes:
    """A checkpoint: a line of JSON with the settings of its training, then all numbers."""
    file = io.BytesIO()
    file.write(json.dumps(_identity(config) | {"updates": n_done}).encode() + b"\n")
    eqx.tree_serialise_leaves(file, (learner, curve))
    return file.getvalue()


def _restored(
    config: TrainPpoTask, study: Study, learner: Learner, curve: CurvePoint
) -> tuple[Learner, CurvePoint, int]:
    """Learner, curve and number of updates in the study's checkpoint; the given learner and curve, and 0, if there is
    no checkpoint of this configuration and code, or a damaged one.
    """
    path = study.path / CHECKPOINT
    if not path.exists():
        return learner, curve, 0
    try:
        with path.open("rb") as file:
            header = json.loads(file.readline())
            if {key: header[key] for key in _identity(config)} != _identity(config):
                log.info("%s belongs to another configuration or code: the training starts again", path)
                return learner, curve, 0
            n_done = int(header["updates"])
            stored_learner, stored_curve = eqx.tree_deserialise_leaves(file, (learner, curve))
    except (KeyError, TypeError, ValueError, EOFError, RuntimeError) as error:  # RuntimeError: equinox's, of a leaf
        log.warning("%s is damaged (%s): the training starts again", path, error)
        return learner, curve, 0
    log.info("the training continues after update %d", n_done)
    return stored_learner, stored_curve, n_done


def _identity(config: TrainPpoTask) -> dict[str, str]:
    """Settings that must agree for a training to continue from a checkpoint."""
    return {"config_hash": config_hash(config), "code_hash": code_hash()}


def curve_table(training: Training, batch: int) -> pd.DataFrame:
    """One row per update: `update`, `car_steps` so far, `return`, `crashed`, `speed`, the share of each action in
    `left`, `keep`, `right`, `faster`, `slower`, and `loss`, `policy_loss`, `value_loss`, `entropy`, `divergence`,
    `clipped_share`.
    """
    curve, update_number = training.curve, np.arange(1, len(training.curve.episode_return) + 1)
    losses = curve.losses
    columns = {
        "update": update_number.astype(np.int32),
        "car_steps": update_number * batch,
        "return": curve.episode_return,
        "crashed": curve.crashed,
        "speed": curve.speed,
        **{name: curve.actions[:, action] for action, name in enumerate(ACTION_NAMES)},
        "loss": losses.total,
        "policy_loss": losses.policy,
        "value_loss": losses.value,
        "entropy": losses.entropy,
        "divergence": losses.divergence,
        "clipped_share": losses.clipped_share,
    }
    return pd.DataFrame({name: np.asarray(values) for name, values in columns.items()})
