"""A repaired traffic model: drivers calibrated with and without effects, and the effects.

Plain numbers and texts only, so that a model can be written by hand.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rearl_jax.config.driver import MODELS
from rearl_jax.config.mobil import BOUNDS

SCHEMA = 1
"""Version of the file's layout."""

CAR, TRUCK = "car", "truck"
"""Names of the classes of vehicles."""


@dataclass(frozen=True)
class DriverClass:
    """Drivers of one class of vehicles. Their parameters are log-normal.

    Attributes:
        share: Share of all vehicles [-].
        log_mean: Mean of the logarithm of each parameter of the car-following model, by name.
        log_covariance: Covariance of these logarithms, rows and columns in the order of the model's declaration.
        noise_sd: Standard deviation of the acceleration noise [m/s^2].
        noise_time: Correlation time of the noise [s].
        length: Mean length of the vehicles [m].
        length_sd: Standard deviation of the length [m].
    """

    share: float
    log_mean: Mapping[str, float]
    log_covariance: Sequence[Sequence[float]]
    noise_sd: float
    noise_time: float
    length: float
    length_sd: float


@dataclass(frozen=True)
class EffectValues:
    """An effect with its parameter values.

    Attributes:
        name: One of `core.effects.EFFECTS`.
        parameters: Values of all its parameters, by name; a list for a curve.
        variable: Variable a curve depends on, one of `core.effects.VARIABLES`; None for effects that are not curves.
    """

    name: str
    parameters: Mapping[str, float | Sequence[float]]
    variable: str | None = None


@dataclass(frozen=True)
class LaneChangeValues:
    """Parameters of MOBIL of all drivers, as of `config.mobil.MobilConfig`, and a bias.

    Attributes:
        politeness: Weight of the followers' gain [-].
        gain_threshold: Least gain of a change [m/s^2].
        safe_decel: Largest deceleration of the new follower [m/s^2].
        bias: Gain of the right lane and loss of the left one [m/s^2], as of the effect `keep_right`.
        delay: Time between two decisions of a driver [s].
    """

    politeness: float
    gain_threshold: float
    safe_decel: float
    bias: float
    delay: float


LANE_CHANGE_BOUNDS = {**BOUNDS, "bias": (-2.0, 2.0), "delay": (0.05, 3600.0)}
"""Bounds of the parameters, in the units of `LaneChangeValues`: those of the keys, but a delay may be longer."""


@dataclass(frozen=True)
class Source:
    """Origin of a model.

    Attributes:
        data_id: Identity of the recordings it was calibrated on.
        study: Name of the study.
        code_version: Version of the code.
    """

    data_id: str
    study: str
    code_version: str


@dataclass(frozen=True)
class RepairedModel:
    """A traffic model that was repaired by effects.

    Attributes:
        source: Origin of the model.
        population: Drivers by class, `car` and perhaps `truck`, calibrated together with the effects.
        effects: Effects in addition to car following.
        baseline: The same drivers calibrated without effects; classes, shares and lengths as in `population`.
        car_following: Name of the car-following model, one of `config.driver.MODELS`.
        lane_changing: Parameters of MOBIL, with and without effects; None for highway-env's.
    """

    source: Source
    population: Mapping[str, DriverClass]
    baseline: Mapping[str, DriverClass]
    effects: Sequence[EffectValues] = field(default_factory=tuple)
    car_following: str = "idm"
    lane_changing: LaneChangeValues | None = None

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of a driver's parameters, in the order of every covariance."""
        return MODELS[self.car_following].names


def diagonal(log_sd: Mapping[str, float]) -> list[list[float]]:
    """Covariance of independent parameters, in the order of the standard deviations of their logarithms."""
    return [[log_sd[row] ** 2 if row == column else 0.0 for column in log_sd] for row in log_sd]
