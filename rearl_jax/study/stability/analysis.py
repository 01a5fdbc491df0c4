"""Linear string stability of car following in the core's time steps, with reaction delays.

Small deviations of position y and speed w from the equilibrium develop in a time step dt as

    y' = y + dt w
    w' = w + dt [f_s D (y_l - y) + f_v D_own w + f_dv (D_own w - D w_l)]

behind a leader l; D and D_own delay by the reaction times to the vehicle ahead and to the driver's own speed, which the
effect `reaction_delay` interpolates between time steps. With z = exp(i omega dt) and p = (z - 1) / dt, a leader's speed
is passed on by the transfer function

    G(z) = D (f_s - f_dv p) / [p^2 - (f_v + f_dv) D_own p + f_s D].

On a ring of N vehicles, waves with j crests solve G(z) = exp(-2 pi i j / N). A wave grows if |z| > 1.

Source: Treiber & Kesting, Traffic Flow Dynamics (2013), chapter 15, for continuous time; the time steps are those of
`rearl_jax.core.kinematics.move`.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from numpy.polynomial import Polynomial

from rearl_jax.core.car_following.model import Linearisation


@dataclass(frozen=True)
class Scheme:
    """Time steps and reaction delays.

    Attributes:
        dt: Time step [s].
        delay: Reaction time to the vehicle ahead [s]; negative values extrapolate.
        own_delay: Reaction time to the driver's own speed [s].
    """

    dt: float
    delay: float = 0.0
    own_delay: float = 0.0

    @property
    def memory(self) -> int:
        """Whole time steps of the longer delay, and one more for the interpolation."""
        return max(_whole(self.delay, self.dt), _whole(self.own_delay, self.dt)) + 1

    def delays(self) -> tuple[Polynomial, Polynomial]:
        """D and D_own times z^memory, as polynomials in z."""
        return self._delayed(self.delay), self._delayed(self.own_delay)

    def _delayed(self, delay: float) -> Polynomial:
        whole = _whole(delay, self.dt)
        share, coefficients = delay / self.dt - whole, np.zeros(self.memory + 1)
        coefficients[self.memory - whole] += 1 - share
        coefficients[self.memory - whole - 1] += share
        return Polynomial(coefficients)


def _whole(delay: float, dt: float) -> int:
    """Whole time steps in a delay; 0 in a negative one."""
    return math.floor(max(delay, 0.0) / dt)


def amplification(slopes: Linearisation, scheme: Scheme, frequency: float) -> float:
    """Amplitude of a follower's speed over its leader's [-] at a frequency of the speeds [Hz]: |G(z)|."""
    z = np.exp(2j * np.pi * frequency * scheme.dt)
    p = (z - 1) / scheme.dt
    delayed, delayed_own = (values(z) / z**scheme.memory for values in scheme.delays())
    gap, speed, approach = (float(slope) for slope in slopes)
    return float(abs(delayed * (gap - approach * p) / (p * p - (speed + approach) * delayed_own * p + gap * delayed)))


def ring_growth(slopes: Linearisation, scheme: Scheme, n_vehicles: int) -> Float[np.ndarray, " waves"]:
    """Fastest growth rate [1/s] of waves with 1, 2 ... n / 2 crests on a ring of n equal drivers; a wave decays if it
    is negative.
    """
    turns = np.exp(2j * np.pi * np.arange(1, n_vehicles // 2 + 1) / n_vehicles)
    largest = np.array([np.abs(_ring_roots(slopes, scheme, turn)).max() for turn in turns])
    return np.log(largest) / scheme.dt


def _ring_roots(slopes: Linearisation, scheme: Scheme, turn: complex) -> Complex[np.ndarray, " roots"]:
    """Factors z by which a wave grows per time step: turn G(z) = 1, `turn` a leader's phase before its follower."""
    gap, speed, approach = (float(slope) for slope in slopes)
    delayed, delayed_own = scheme.delays()
    p = Polynomial([-1.0, 1.0]) / scheme.dt
    waves = p * p * Polynomial.basis(scheme.memory)
    waves = waves - p * ((speed + approach) * delayed_own - approach * turn * delayed) + gap * (1 - turn) * delayed
    return waves.roots()
