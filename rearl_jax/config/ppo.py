"""Configuration of the baseline PPO: training and weights.

Defaults marked "highway-env" are those of its PPO script (HighwayEnv, scripts/sb3_highway_ppo.py), "purejaxrl" those of
purejaxrl/ppo.py.
"""

import math
from dataclasses import dataclass

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_finite, check_least, check_positive, check_within
from rearl_jax.config.decision import Longitudinal
from rearl_jax.problems import out_of_range


@dataclass(unsafe_hash=True)
class PpoConfig:
    """Training of the PPO policy"""

    seed: int = key(0, "seed of weights, initial traffic and drawn actions; its traffic is never that of an evaluation")
    # Not int, which OmegaConf refuses to read 1e6 as.
    car_steps: float = key(1e6, "vehicle-seconds to train on, rounded up to whole updates")
    scenarios: int = key(64, "scenarios simulated for every update, each from another initial state")
    horizon: int = key(60, "length of the training rollouts [s]; REARL (Bi et al.)")
    longitudinal: Longitudinal = key(
        Longitudinal.mdp,
        "speed control; mdp: as in highway-env, without regard to other vehicles; idm_capped: IDM limits the "
        "acceleration",
    )
    gamma: float = key(0.8, "discount factor per second [-]; highway-env")
    gae_lambda: float = key(0.95, "decay of the advantage estimate [-]; purejaxrl")
    clip: float = key(0.2, "clipping range of the probability ratio [-]; purejaxrl")
    learning_rate: float = key(5e-4, "initial step size of Adam [-]; highway-env")
    anneal: bool = key(True, "reduce the step size linearly to zero; purejaxrl")
    epochs: int = key(10, "passes over the data of an update; highway-env")
    minibatch: int = key(4096, "largest number of vehicle-seconds per gradient step")
    entropy_weight: float = key(0.01, "weight of the entropy in the objective [-]; purejaxrl")
    value_weight: float = key(0.5, "weight of the squared error of the value function [-]; purejaxrl")
    max_grad_norm: float = key(0.5, "largest norm of a gradient [-]; purejaxrl")
    width: int = key(128, "neurons of each hidden layer")
    layers: int = key(2, "hidden layers; highway-env")
    checkpoint_every: int = key(5, "updates between two checkpoints, from which an interrupted training continues")

    def n_updates(self, n_vehicles: int) -> int:
        """Updates that take `car_steps` vehicle-seconds with this many vehicles per scenario."""
        return math.ceil(self.car_steps / self.batch(n_vehicles))

    def batch(self, n_vehicles: int) -> int:
        """Vehicle-seconds of an update."""
        return self.scenarios * self.horizon * n_vehicles

    def check(self) -> None:
        check_least(self, 1, "scenarios", "horizon", "epochs", "minibatch", "width", "layers", "checkpoint_every")
        if not 1 <= self.car_steps < math.inf:
            raise out_of_range("car_steps", "must be at least 1 and finite", self.car_steps)
        check_within(self, 0, 2**31 - 1, "seed")
        check_within(self, 0, 1, "gamma", "gae_lambda")
        check_positive(self, "clip", "learning_rate", "max_grad_norm")
        check_least(self, 0, "entropy_weight", "value_weight")
        check_finite(self, "learning_rate", "entropy_weight", "value_weight")


@dataclass(unsafe_hash=True)
class PpoPolicyConfig:
    """The policy of method=ppo"""

    weights: str | None = key(None, "file of weights written by `rearl train ppo`; null = the shipped weights")
