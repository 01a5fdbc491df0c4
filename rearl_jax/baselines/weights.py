"""Files of weights: a line of JSON that says how they were trained, then the numbers.

Source of the format: equinox, documentation of `tree_serialise_leaves`.
"""

import hashlib
import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import equinox as eqx
import jax

from rearl_jax.baselines.driving import DrivingOptions
from rearl_jax.baselines.network import ActorCritic, make_network
from rearl_jax.code_version import __version__
from rearl_jax.config import TrainPpoTask
from rearl_jax.config.core import CoreConfig
from rearl_jax.config.decision import AdmissibleConfig, LaneGate, Longitudinal
from rearl_jax.results import shared_config

FORMAT = "rearl_jax PPO weights, version 1"
"""Begins the description in every file."""

DEFAULT = Path(__file__).with_name("ppo_default.eqx")
"""The weights that come with the package: those of `rearl train ppo` with every key at its default."""


@dataclass(frozen=True)
class TrainedPolicy:
    """A policy and how it was trained.

    Attributes:
        network: Its weights.
        options: Options of its driving.
        n_lanes: Lanes of the road it has learnt on.
        car_steps: Vehicle-seconds it has learnt from.
        file: Name of its file.
        digest: Twelve hexadecimal digits of its file.
    """

    network: ActorCritic
    options: DrivingOptions
    n_lanes: int
    car_steps: int
    file: str
    digest: str


def weights_file(network: ActorCritic, config: TrainPpoTask) -> bytes:
    """The file of a trained network; equal trainings give equal files, wherever they are written."""
    ppo, n_vehicles = config.ppo, config.core.n_vehicles
    description = {
        "format": FORMAT,
        "code_version": __version__,
        "car_steps": ppo.n_updates(n_vehicles) * ppo.batch(n_vehicles),
        "config": shared_config(config),
    }
    file = io.BytesIO()
    file.write(json.dumps(description, sort_keys=True).encode() + b"\n")
    eqx.tree_serialise_leaves(file, network)
    return file.getvalue()


def load_policy(path: str | None, core: CoreConfig) -> TrainedPolicy:
    """The policy in a file, or the one that comes with the package.

    Args:
        path: The file; None for the package's own.
        core: Road it is to drive on.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It holds no weights, is damaged, or has learnt on another road.
    """
    source = DEFAULT if path is None else Path(path)
    try:
        content = source.read_bytes()
    except FileNotFoundError as error:
        if path is None:
            raise FileNotFoundError(f"{source} is missing: incomplete installation, install again") from error
        raise FileNotFoundError(
            f"ppo.weights={path}: there is no such file; `rearl train ppo` writes results/train_ppo/weights.eqx"
        ) from error
    except IsADirectoryError as error:
        raise ValueError(f"ppo.weights={path} is a folder: name the file weights.eqx in it") from error
    policy = _read(source, content)
    if policy.n_lanes != core.n_lanes:
        raise ValueError(
            f"{source} was trained on a road of {policy.n_lanes} lanes, core.n_lanes is {core.n_lanes}: set "
            f"core.n_lanes={policy.n_lanes}, or train on this road (rearl train ppo core.n_lanes={core.n_lanes}) and "
            "name the result with ppo.weights"
        )
    return policy


def _read(source: Path, content: bytes) -> TrainedPolicy:
    file = io.BytesIO(content)
    description = _description(source, file.readline())
    try:
        config, car_steps = description["config"], description["car_steps"]
        options = DrivingOptions(_admissible(config["admissible"]), Longitudinal[config["ppo"]["longitudinal"]])
        width, layers, n_lanes = config["ppo"]["width"], config["ppo"]["layers"], config["core"]["n_lanes"]
        empty = jax.eval_shape(lambda: make_network(jax.random.key(0), width=width, layers=layers))
        network = eqx.tree_deserialise_leaves(file, empty)
    except (KeyError, TypeError) as error:
        raise ValueError(f"{source} was written by another version of this package: train again") from error
    except (RuntimeError, ValueError, EOFError, OSError) as error:
        raise ValueError(f"{source} does not hold the weights it describes: the file is damaged") from error
    if file.read(1):
        raise ValueError(f"{source} holds more than the weights it describes: the file is damaged")
    digest = hashlib.sha256(content).hexdigest()[:12]
    return TrainedPolicy(network, options, n_lanes, car_steps, source.name, digest)


def _description(source: Path, line: bytes) -> dict[str, Any]:
    """Training that gave the weights."""
    try:
        description = json.loads(line)
    except ValueError:
        description = None
    if not isinstance(description, dict) or description.get("format") != FORMAT:
        raise ValueError(f"{source} is no file of PPO weights ({FORMAT}): name one that `rearl train ppo` has written")
    return description


def _admissible(plain: dict[str, Any]) -> AdmissibleConfig:
    return AdmissibleConfig(**{**plain, "lane": LaneGate[plain["lane"]]})
