"""Configuration of the evaluation: method, rollouts, intervals."""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_least, check_within
from rearl_jax.problems import out_of_range


class Method(Enum):
    """Control of the simulated vehicles."""

    base = "base"
    """IDM and MOBIL with highway-env's parameters, without corrections."""
    rearl = "rearl"
    """As `base`, with decisions of a policy if the traffic differs too much from its reference."""
    ppo = "ppo"
    """One policy for all vehicles, trained without recordings."""
    critical = "critical"
    """IDM and MOBIL with several classes of drivers, whose shares are adapted beforehand."""

    @property
    def needs_references(self) -> bool:
        """True for methods that compare the traffic with representative scenes."""
        return self is Method.rearl

    @property
    def needs_splits(self) -> bool:
        """True for methods that also use scenes that they are not evaluated on."""
        return self in (Method.rearl, Method.critical)


class Variant(Enum):
    """Versions of a repaired model that are simulated."""

    all = "all"
    """Base and rearl, each without and with the model's effects, side by side."""
    calibrated = "calibrated"
    """Drivers calibrated without effects."""
    repaired = "repaired"
    """Drivers calibrated together with the effects, which are switched on."""


ONE_VARIANT_HELP = "with model: calibrated (without its effects) or repaired (with them)"
"""Help text of the key `variant` of tasks that simulate one variant."""


class SeedScope(Enum):
    """Assignment of rollouts to scenes."""

    run_x_scene = "run_x_scene"
    """One rollout per run and scene, scored against its scene."""
    run = "run"
    """One rollout per run, scored against every scene."""


class Subset(Enum):
    """Scenes to simulate."""

    evaluation = "evaluation"
    """Scenes held out for results."""
    tuning = "tuning"
    """Scenes for the choice of parameters."""
    threshold = "threshold"
    """Scenes that define the detection thresholds."""


@dataclass(unsafe_hash=True)
class EvaluationConfig:
    """Rollouts per scene, random numbers and intervals"""

    subset: Subset = key(
        Subset.evaluation, "scenes to simulate: evaluation (results), tuning (choice of parameters), threshold"
    )
    n_runs: int = key(
        5, "rollouts of every scene, each with other drivers and, with init.source=seed, from another start; REARL"
    )
    seed: int = key(0, "seed of initial states, resampling and noise floor; equal for every method")
    seed_scope: SeedScope = key(
        SeedScope.run_x_scene, "run_x_scene: one rollout per run and scene; run: one per run, scored on all scenes"
    )
    resamples: int = key(10_000, "bootstrap resamples of scenes for the intervals")
    confidence: float = key(0.95, "confidence level of the intervals [-]")
    noise_draws: int = key(1000, "pairs of samples of each scene for its noise floor, their distance by chance")
    example: int | None = key(None, "scene_id of the space-time diagram; null = the held-out scene of median speed")

    def check(self) -> None:
        check_least(self, 1, "n_runs", "resamples", "noise_draws")
        check_within(self, 0, 2**31 - 1, "seed")
        if not 0 < self.confidence < 1:
            raise out_of_range("confidence", "must be between 0 and 1", self.confidence)
