"""Configuration of the baseline PPO: how the policy is trained, and which weights are driven with.

Defaults marked "highway-env" are those of its PPO script (HighwayEnv, scripts/sb3_highway_ppo.py), "purejaxrl" those of
purejaxrl/ppo.py; "own choice" is what neither says.
"""

import math
from dataclasses import dataclass

from rearl_jax.config._key import key
from rearl_jax.config.decision import Longitudinal
from rearl_jax.problems import out_of_range


@dataclass(unsafe_hash=True)
class PpoConfig:
    """Training of the PPO policy"""

    seed: int = key(0, "seed of weights, initial traffic and drawn actions; its traffic is never that of an evaluation")
    # Not int, which OmegaConf refuses to read 1e6 as.
    car_steps: float = key(1e6, "vehicle-seconds to train on, rounded up to whole updates; own choice")
    scenarios: int = key(64, "scenarios simulated for every update, each from another initial state; own choice")
    horizon: int = key(60, "length of these rollouts [s]; REARL (Bi et al.)")
    longitudinal: Longitudinal = key(
        Longitudinal.mdp,
        "how target speeds are followed: mdp: as highway-env, blind to others; idm_capped: never "
        "faster than IDM allows (own choice)",
    )
    gamma: float = key(0.8, "discount of a second [-]; highway-env")
    gae_lambda: float = key(0.95, "decay of the advantage estimate [-]; purejaxrl")
    clip: float = key(0.2, "change of an action's probability that still counts in the objective [-]; purejaxrl")
    learning_rate: float = key(5e-4, "step size of Adam at the start [-]; highway-env")
    anneal: bool = key(True, "let the step size fall to zero over the training, linearly; purejaxrl")
    epochs: int = key(10, "passes over the vehicle-seconds of an update; highway-env")
    minibatch: int = key(4096, "vehicle-seconds of a gradient step at most; own choice")
    entropy_weight: float = key(0.01, "weight of the entropy in the objective [-]; purejaxrl")
    value_weight: float = key(0.5, "weight of the squared error of the value [-]; purejaxrl")
    max_grad_norm: float = key(0.5, "norm that gradients are cut to [-]; purejaxrl")
    width: int = key(128, "neurons of each hidden layer; own choice")
    layers: int = key(2, "hidden layers; highway-env")
    checkpoint_every: int = key(5, "updates between two checkpoints, from which a killed training goes on")

    def n_updates(self, n_vehicles: int) -> int:
        """Updates that take `car_steps` vehicle-seconds with this many vehicles per scenario."""
        return math.ceil(self.car_steps / self.batch(n_vehicles))

    def batch(self, n_vehicles: int) -> int:
        """Vehicle-seconds of an update."""
        return self.scenarios * self.horizon * n_vehicles

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        for name in ("scenarios", "horizon", "epochs", "minibatch", "width", "layers", "checkpoint_every"):
            if getattr(self, name) < 1:
                raise out_of_range(name, "must be at least 1", getattr(self, name))
        if not 1 <= self.car_steps < math.inf:
            raise out_of_range("car_steps", "must be at least 1 and finite", self.car_steps)
        if not 0 <= self.seed < 2**31:
            raise out_of_range("seed", "must be within 0 and 2^31 - 1", self.seed)
        for name in ("gamma", "gae_lambda"):
            if not 0 <= getattr(self, name) <= 1:
                raise out_of_range(name, "must be within 0 and 1", getattr(self, name))
        for name in ("clip", "learning_rate", "max_grad_norm"):
            if not getattr(self, name) > 0:
                raise out_of_range(name, "must be > 0", getattr(self, name))
        for name in ("entropy_weight", "value_weight"):
            if not getattr(self, name) >= 0:
                raise out_of_range(name, "must be >= 0", getattr(self, name))


@dataclass(unsafe_hash=True)
class PpoPolicyConfig:
    """The policy of method=ppo"""

    weights: str | None = key(
        None, "file of weights as `rearl train ppo` writes it; null = the weights that come with the package"
    )
