"""Files of weights: a line of JSON that describes the training, then the numbers.

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
from rearl_jax.problems import InvalidInputError, MissingInputError, Problem
from rearl_jax.results import shared_config

FORMAT = "rearl_jax PPO weights, version 1"
"""Beginning of the description in every file."""

DEFAULT = Path(__file__).with_name("ppo_default.eqx")
"""The shipped weights, trained by `rearl train ppo` with default keys."""


@dataclass(frozen=True)
class TrainedPolicy:
    """A policy, and facts about its training.

    Attributes:
        network: Weights of the policy.
        options: Options of the traffic under the policy.
        n_lanes: Number of lanes of the road in the training.
        car_steps: Vehicle-seconds of the training.
        file: Name of the file of weights.
        digest: Twelve hexadecimal digits of the file's hash.
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
    """The policy in a file, or the shipped one.

    Raises:
        MissingInputError: There is no such file.
        InvalidInputError: The file contains no weights, is damaged, or was trained on another road.
    """
    source = DEFAULT if path is None else Path(path)
    try:
        content = source.read_bytes()
    except FileNotFoundError as error:
        if path is None:
            raise FileNotFoundError(f"{source} is missing: incomplete installation, install again") from error
        remedy = "`rearl train ppo` writes results/train_ppo/weights.eqx"
        problem = Problem("file-missing", "names a file that is not there", remedy, file=path, key="ppo.weights")
        raise MissingInputError(problem) from error
    except IsADirectoryError as error:
        remedy = "name the file weights.eqx in it"
        raise InvalidInputError(Problem("not-a-file", "is a folder", remedy, file=path, key="ppo.weights")) from error
    policy = _read(source, content)
    if policy.n_lanes != core.lanes:
        message = f"must be {policy.n_lanes}, the lanes of the road that these weights were trained on"
        remedy = (
            f"train on this road: rearl train ppo core.n_lanes={core.lanes}; or start on a drawn one: init.source=seed "
            f"speed.norm=minmax core.n_lanes={policy.n_lanes}"
        )
        problem = Problem("other-road", message, remedy, file=str(source), key="core.n_lanes", value=core.lanes)
        raise InvalidInputError(problem)
    return policy


def _read(source: Path, content: bytes) -> TrainedPolicy:
    file = io.BytesIO(content)
    description = _description(source, file.readline())
    try:
        config, car_steps = description["config"], description["car_steps"]
        options = DrivingOptions(_admissible(config["admissible"]), Longitudinal[config["ppo"]["longitudinal"]])
        width, layers = config["ppo"]["width"], config["ppo"]["layers"]
        n_lanes = CoreConfig(n_lanes=config["core"]["n_lanes"]).lanes
        empty = jax.eval_shape(lambda: make_network(jax.random.key(0), width=width, layers=layers))
        network = eqx.tree_deserialise_leaves(file, empty)
    except (KeyError, TypeError) as error:
        message = "was written by another version of this package"
        raise InvalidInputError(
            Problem("weights-of-another-version", message, "train again", file=str(source))
        ) from error
    except (RuntimeError, ValueError, EOFError, OSError) as error:
        raise _damaged(source) from error
    if file.read(1):
        raise _damaged(source)
    digest = hashlib.sha256(content).hexdigest()[:12]
    return TrainedPolicy(network, options, n_lanes, car_steps, source.name, digest)


def _damaged(source: Path) -> InvalidInputError:
    message = "does not hold the weights it describes, and nothing else"
    return InvalidInputError(Problem("weights-damaged", message, "train again", file=str(source)))


def _description(source: Path, line: bytes) -> dict[str, Any]:
    """Description of the training of the weights."""
    try:
        description = json.loads(line)
    except ValueError:
        description = None
    if not isinstance(description, dict) or description.get("format") != FORMAT:
        message, remedy = f"is not a file of PPO weights ({FORMAT})", "name one that `rearl train ppo` has written"
        raise InvalidInputError(Problem("not-weights", message, remedy, file=str(source)))
    return description


def _admissible(plain: dict[str, Any]) -> AdmissibleConfig:
    return AdmissibleConfig(**{**plain, "lane": LaneGate[plain["lane"]]})
