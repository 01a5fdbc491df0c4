"""Car-following models of the generator, on bumper-to-bumper gaps.

Hidden effects change what a model reacts to (time gap, desired speed, perceived gap and approach rate), its
interaction, or the resulting acceleration, so they act on every model. The interaction is the reduction of the
free-road acceleration by a leader; in IDM it is in parts of the maximum acceleration, as in its equation.

Sources: Treiber, Hennecke & Helbing, Phys. Rev. E 62 (2000) 1805 (IDM); highway-env 1.12.1, `IDMVehicle`; Milanes &
Shladover, Transp. Res. C 48 (2014) 285, and Xiao, Wang & van Arem, Transp. Res. Rec. 2623 (2017) 1 (adaptive cruise
control); Gipps, Transp. Res. B 15 (1981) 105; Jiang, Wu & Zhu, Phys. Rev. E 64 (2001) 017101, with the optimal velocity
of Bando et al., Phys. Rev. E 51 (1995) 1035; Krauss, DLR-FB 98-08 (1998).
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from rearl_jax.blind.traffic.fleet import Fleet

SMALLEST_GAP = 0.3
"""Gap [m] below which no model reacts more strongly."""

FREE_GAP = 1.0e6
"""Gap [m] above which there is no leader."""


@dataclass(frozen=True)
class Drivers:
    """Drivers whose acceleration is to be computed.

    Attributes:
        speed: Speeds [m/s].
        desired_speed, time_gap: Current values, hidden effects included [m/s], [s].
        fleet: All drivers.
        who: Index of each of these drivers in the fleet, its size for a placeholder; None for all drivers in order.
    """

    speed: np.ndarray
    desired_speed: np.ndarray
    time_gap: np.ndarray
    fleet: Fleet
    who: np.ndarray | None = None

    def parameter(self, name: str) -> np.ndarray:
        """A constant parameter of these drivers; 1 for the placeholder."""
        values = self.fleet.parameter(name)
        return values if self.who is None else np.append(values, 1.0)[self.who]


class BaseModel(ABC):
    """A car-following model.

    Attributes:
        parameters: Names of its parameters in addition to desired speed, time gap and jam gap.
    """

    parameters: tuple[str, ...] = ()

    @abstractmethod
    def interaction(self, drivers: Drivers, gap: np.ndarray, dv: np.ndarray) -> np.ndarray:
        """Reduction of the free-road acceleration by a leader, in parts of `scale`, from gap [m] and approach rate
        [m/s].
        """

    @abstractmethod
    def acceleration(self, drivers: Drivers, interaction: np.ndarray) -> np.ndarray:
        """Acceleration with an interaction [m/s^2]."""

    @abstractmethod
    def scale(self, drivers: Drivers) -> np.ndarray:
        """Unit of the interaction [m/s^2]."""

    def equilibrium_gap(self, drivers: Drivers) -> np.ndarray:
        """Gap [m] at constant speed."""
        return drivers.parameter("jam_gap") + drivers.time_gap * drivers.speed


class DirectModel(BaseModel):
    """A model that states the acceleration on a free road and the one behind a leader."""

    @abstractmethod
    def free(self, drivers: Drivers) -> np.ndarray:
        """Free-road acceleration [m/s^2]."""

    @abstractmethod
    def follow(self, drivers: Drivers, gap: np.ndarray, dv: np.ndarray) -> np.ndarray:
        """Acceleration behind a leader [m/s^2]."""

    def interaction(self, drivers: Drivers, gap: np.ndarray, dv: np.ndarray) -> np.ndarray:
        return self.free(drivers) - self.follow(drivers, np.maximum(gap, SMALLEST_GAP), dv)

    def acceleration(self, drivers: Drivers, interaction: np.ndarray) -> np.ndarray:
        return self.free(drivers) - interaction

    def scale(self, drivers: Drivers) -> np.ndarray:
        return np.ones_like(drivers.speed)


class IDM(BaseModel):
    """The Intelligent Driver Model; the desired gap is never below s0."""

    parameters = ("max_accel", "comfort_decel")

    def interaction(self, drivers: Drivers, gap: np.ndarray, dv: np.ndarray) -> np.ndarray:
        """(s* / s)^2."""
        wanted = drivers.parameter("jam_gap") + np.maximum(0.0, self._dynamic(drivers, dv))
        return (wanted / np.maximum(gap, SMALLEST_GAP)) ** 2

    def acceleration(self, drivers: Drivers, interaction: np.ndarray) -> np.ndarray:
        return drivers.parameter("max_accel") * (1.0 - self._speed_term(drivers) - interaction)

    def scale(self, drivers: Drivers) -> np.ndarray:
        return drivers.parameter("max_accel")

    def equilibrium_gap(self, drivers: Drivers) -> np.ndarray:
        return super().equilibrium_gap(drivers) / np.sqrt(1.0 - self._speed_term(drivers))

    def _dynamic(self, drivers: Drivers, dv: np.ndarray) -> np.ndarray:
        """Part of the desired gap that depends on speeds [m]."""
        root = np.sqrt(drivers.parameter("max_accel") * drivers.parameter("comfort_decel"))
        return drivers.speed * drivers.time_gap + 0.5 * drivers.speed * dv / root

    def _speed_term(self, drivers: Drivers) -> np.ndarray:
        return (drivers.speed / drivers.desired_speed) ** 4


class HighwayEnvIDM(IDM):
    """highway-env's IDM: distances include 5 m of vehicle, and the desired distance may be negative."""

    parameters = ("max_accel", "comfort_decel", "accel_exponent")
    length = 5.0  # m

    def interaction(self, drivers: Drivers, gap: np.ndarray, dv: np.ndarray) -> np.ndarray:
        wanted = drivers.parameter("jam_gap") + self.length + self._dynamic(drivers, dv)
        return (wanted / (np.maximum(gap, SMALLEST_GAP) + self.length)) ** 2

    def equilibrium_gap(self, drivers: Drivers) -> np.ndarray:
        wanted = drivers.parameter("jam_gap") + self.length + drivers.time_gap * drivers.speed
        return wanted / np.sqrt(1.0 - self._speed_term(drivers)) - self.length

    def _speed_term(self, drivers: Drivers) -> np.ndarray:
        return (drivers.speed / drivers.desired_speed) ** drivers.parameter("accel_exponent")


class ApproachGainIDM(DirectModel):
    """min(a [1 - ((s0 + v T) / s)^p] - k dv, k0 (v0 - v))."""

    parameters = ("max_accel", "gap_exponent", "approach_gain", "speed_gain")

    def free(self, drivers: Drivers) -> np.ndarray:
        return np.minimum(drivers.parameter("max_accel"), _towards_desired_speed(drivers))

    def follow(self, drivers: Drivers, gap: np.ndarray, dv: np.ndarray) -> np.ndarray:
        pressure = (self.equilibrium_gap(drivers) / gap) ** drivers.parameter("gap_exponent")
        wanted = drivers.parameter("max_accel") * (1.0 - pressure) - drivers.parameter("approach_gain") * _seen(dv, gap)
        return np.minimum(wanted, _towards_desired_speed(drivers))


class ConstantTimeHeadway(DirectModel):
    """min(k_s (s - s0 - v T) - k dv, k0 (v0 - v))."""

    parameters = ("gap_gain", "approach_gain", "speed_gain")

    def free(self, drivers: Drivers) -> np.ndarray:
        return _towards_desired_speed(drivers)

    def follow(self, drivers: Drivers, gap: np.ndarray, dv: np.ndarray) -> np.ndarray:
        gap_error = gap - self.equilibrium_gap(drivers)
        wanted = drivers.parameter("gap_gain") * gap_error - drivers.parameter("approach_gain") * _seen(dv, gap)
        return np.minimum(wanted, _towards_desired_speed(drivers))


class Gipps(DirectModel):
    """Gipps' safe speed in continuous time; the reaction time is two thirds of the time gap."""

    parameters = ("max_accel", "comfort_decel")

    def free(self, drivers: Drivers) -> np.ndarray:
        share = drivers.speed / drivers.desired_speed
        return 2.5 * drivers.parameter("max_accel") * (1.0 - share) * np.sqrt(0.025 + share)

    def follow(self, drivers: Drivers, gap: np.ndarray, dv: np.ndarray) -> np.ndarray:
        reaction, braking = drivers.time_gap / 1.5, drivers.parameter("comfort_decel")
        left = 2.0 * (gap - drivers.parameter("jam_gap")) - drivers.speed * reaction
        square = (braking * reaction) ** 2 + braking * left + np.maximum(drivers.speed - dv, 0.0) ** 2
        safe = np.sqrt(np.maximum(square, 0.01)) - braking * reaction
        return np.minimum(self.free(drivers), (safe - drivers.speed) / reaction)


class FVDM(DirectModel):
    """k0 [v0 tanh((s - s0) / (v0 T)) - v] - k dv."""

    parameters = ("speed_gain", "approach_gain")

    def free(self, drivers: Drivers) -> np.ndarray:
        return _towards_desired_speed(drivers)

    def follow(self, drivers: Drivers, gap: np.ndarray, dv: np.ndarray) -> np.ndarray:
        excess = np.maximum(0.0, gap - drivers.parameter("jam_gap"))
        optimal = drivers.desired_speed * np.tanh(excess / (drivers.desired_speed * drivers.time_gap))
        braking = drivers.parameter("approach_gain") * _seen(dv, gap)
        return drivers.parameter("speed_gain") * (optimal - drivers.speed) - braking

    def equilibrium_gap(self, drivers: Drivers) -> np.ndarray:
        reach = drivers.desired_speed * drivers.time_gap
        return drivers.parameter("jam_gap") + reach * np.arctanh(drivers.speed / drivers.desired_speed)


class Krauss(DirectModel):
    """Krauss' safe speed in continuous time, without dawdling."""

    parameters = ("max_accel", "comfort_decel")

    def free(self, drivers: Drivers) -> np.ndarray:
        return np.minimum(drivers.parameter("max_accel"), (drivers.desired_speed - drivers.speed) / drivers.time_gap)

    def follow(self, drivers: Drivers, gap: np.ndarray, dv: np.ndarray) -> np.ndarray:
        ahead = np.maximum(drivers.speed - dv, 0.0)
        stopping = 0.5 * (drivers.speed + ahead) / drivers.parameter("comfort_decel")
        left = gap - drivers.parameter("jam_gap") - ahead * drivers.time_gap
        safe = ahead + left / (stopping + drivers.time_gap)
        return np.minimum(self.free(drivers), (safe - drivers.speed) / drivers.time_gap)


def _towards_desired_speed(drivers: Drivers) -> np.ndarray:
    """k0 (v0 - v) [m/s^2]."""
    return drivers.parameter("speed_gain") * (drivers.desired_speed - drivers.speed)


def _seen(dv: np.ndarray, gap: np.ndarray) -> np.ndarray:
    """Approach rate [m/s]; 0 without a leader."""
    return np.where(gap > FREE_GAP, 0.0, dv)


BASES: dict[str, BaseModel] = {
    "highway_env_idm": HighwayEnvIDM(),
    "idm": IDM(),
    "approach_gain_idm": ApproachGainIDM(),
    "constant_time_headway": ConstantTimeHeadway(),
    "gipps": Gipps(),
    "fvdm": FVDM(),
    "krauss": Krauss(),
}
"""Car-following models by name."""
