"""Five car-following models with one signature. Units are SI; `gap` is from bumper to bumper.

Each returns an acceleration from own speed, (perceived) gap, leader's speed and acceleration, and traits of the driver.
A driver without a leader has a gap of 1000 m and a leader at the desired speed.

Sources
-------
iidm: Treiber & Kesting (2013), Traffic Flow Dynamics, sec. 11.3.7: improved Intelligent Driver Model.
gipps: Gipps (1981), A behavioural car-following model, Transp. Res. B 15.
fvdm: Bando et al. (1995), Phys. Rev. E 51: optimal velocity; Jiang, Wu & Zhu (2001), Phys. Rev. E 64: full velocity
    difference.
newell: Newell (2002), Transp. Res. B 36; bounded acceleration and a drifting wave trip time after Laval & Leclercq
    (2010), Phil. Trans. R. Soc. A 368 (timid and aggressive drivers), and Laval, Toth & Zhou (2014), Transp. Res. B 70.
wiedemann: Wiedemann (1974); thresholds CC0 to CC9 as described in the manual of PTV Vissim (Wiedemann 99).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass
class Situation:
    """The drivers' input; one entry per driver and lane that the driver attends to."""

    v: np.ndarray  # own speed [m/s]
    gap: np.ndarray  # [m]
    vl: np.ndarray  # speed of the leader [m/s]
    al: np.ndarray  # acceleration of the leader [m/s^2]
    last: np.ndarray  # own acceleration of the time step before [m/s^2]
    v0: np.ndarray  # desired speed here and now [m/s]
    time_gap: np.ndarray  # desired time gap here and now [s]
    s0: np.ndarray  # gap at standstill [m]
    a: np.ndarray  # maximum acceleration [m/s^2]
    b: np.ndarray  # comfortable deceleration [m/s^2]
    mood: np.ndarray  # drifting trait of unit variance (Newell's trip time, Wiedemann's slow speed) [-]


def brake_in_time(s: Situation, acc: np.ndarray) -> np.ndarray:
    """Brake as kinematics demands where that is more than 0.7 m/s^2 (Gipps' idea of safety, for models without one)."""
    need = np.maximum(s.v - s.vl, 0.0) ** 2 / (2.0 * np.maximum(s.gap - 0.5 * s.s0, 0.5))
    return np.where(need > 0.7, np.minimum(acc, -need), acc)


def iidm(s: Situation) -> np.ndarray:
    """Improved Intelligent Driver Model."""
    wish = s.s0 + np.maximum(0.0, s.v * s.time_gap + s.v * (s.v - s.vl) / (2.0 * np.sqrt(s.a * s.b)))
    z = wish / np.maximum(s.gap, 0.1)
    ratio = s.v / np.maximum(s.v0, 0.5)
    free = np.where(
        ratio <= 1.0,
        s.a * (1.0 - np.minimum(ratio, 1.0) ** 4),
        -s.b * (1.0 - np.maximum(ratio, 1.0) ** (-4.0 * s.a / s.b)),
    )
    safe_free = np.where(np.abs(free) < 1e-3, 1e-3, free)
    below = np.where(
        z >= 1.0, s.a * (1.0 - z**2), free * (1.0 - np.minimum(z, 1.0) ** np.clip(2.0 * s.a / safe_free, 0.0, 60.0))
    )
    above = np.where(z >= 1.0, free + s.a * (1.0 - z**2), free)
    return np.where(ratio <= 1.0, below, above)


def gipps(s: Situation) -> np.ndarray:
    """Gipps' model; the equilibrium time gap 1.5 tau is the driver's, and leaders are thought to brake like oneself."""
    tau = s.time_gap / 1.5
    ratio = np.maximum(s.v / np.maximum(s.v0, 0.5), 0.0)
    free = s.v + 2.5 * s.a * tau * (1.0 - ratio) * np.sqrt(0.025 + ratio)
    root = (s.b * tau) ** 2 + s.b * (2.0 * (s.gap - s.s0) - s.v * tau + s.vl**2 / s.b)
    safe = -s.b * tau + np.sqrt(np.maximum(root, 0.0))
    return (np.minimum(free, safe) - s.v) / tau


def fvdm(s: Situation) -> np.ndarray:
    """Full velocity difference model with Bando's tanh function, whose width is set by the time gap."""
    beta = 1.2
    width = 0.95 * s.v0 * s.time_gap / (1.0 + np.tanh(beta))
    reach = np.maximum(s.gap - s.s0, 0.0) / np.maximum(width, 1.0)
    optimal = s.v0 * (np.tanh(reach - beta) + np.tanh(beta)) / (1.0 + np.tanh(beta))
    near = np.clip((110.0 - s.gap) / 40.0, 0.0, 1.0)
    return brake_in_time(s, 0.30 * s.a * (optimal - s.v) + 0.70 * near * (s.vl - s.v))


def newell(s: Situation) -> np.ndarray:
    """Newell's simplified model with bounded acceleration; the wave trip time drifts by 8 per cent of its mean."""
    trip = s.time_gap * np.clip(1.0 + 0.08 * s.mood, 0.7, 1.4)
    follow = (np.maximum(s.gap - s.s0, 0.0) / trip - s.v) / (0.45 * trip)
    free = s.a * (1.0 - s.v / np.maximum(s.v0, 0.5))
    return brake_in_time(s, np.minimum(follow, np.maximum(free, -2.0)))


def wiedemann(s: Situation) -> np.ndarray:
    """Wiedemann's regimes: braking, closing in, unconscious following, free."""
    dv = s.vl - s.v
    slower = np.where((dv > 0) | (s.al < -1.0), s.v, s.vl + dv * np.clip(0.2 * s.mood, -0.5, 0.5))
    near = s.s0 + 0.9 * s.time_gap * np.maximum(slower, 0.0)
    far = near + 1.5 + 2.5 * s.s0 / 2.1
    see = far - 8.0 * (dv + 0.35)  # where a slower leader is noticed
    wide = 11.44e-4 * s.gap**2
    close_at = np.where(s.vl > 0, -0.35 - wide, 0.0)
    open_at = np.where(s.v > 0.35, wide + 0.35, wide)

    room = np.minimum(s.s0 - s.gap, -0.3)
    brake = np.where(dv < 0, np.minimum(s.al + dv**2 / room, s.last), np.minimum(s.al + 0.5 * (dv - open_at), s.last))
    brake = np.where(s.gap > s.s0, brake, np.minimum(s.al + 0.5 * (dv - open_at), s.last))
    brake = np.where(s.v > 0, np.minimum(np.maximum(brake, -10.0 + 0.5 * np.sqrt(s.v)), -0.25), 0.0)
    closing = np.maximum(0.5 * dv**2 / np.minimum(near - s.gap - 0.1, -0.2), -8.0)
    wish = np.clip(s.v0 - s.v, -2.0, None)
    coast = np.minimum(np.where(s.last <= 0.0, np.minimum(s.last, -0.25), np.maximum(s.last, 0.25)), wish)
    coast = np.clip(coast, -0.5, 0.5)
    strong = 2.0 * s.a + (s.a - 2.0 * s.a) * np.minimum(s.v, 22.2) / 22.2
    ease = np.where(s.gap < far, np.minimum(dv**2 / np.maximum(far - s.gap, 0.3), strong), strong)
    free = np.where(s.gap > near, np.minimum(ease, wish), 0.0)
    regime = np.select(
        [(s.gap < near) & (dv <= open_at), (dv < close_at) & (s.gap < see), (dv < open_at) & (s.gap < far)],
        [brake, closing, coast],
        free,
    )
    return brake_in_time(s, regime)


MODELS: dict[str, Callable[[Situation], np.ndarray]] = {
    "iidm": iidm,
    "gipps": gipps,
    "fvdm": fvdm,
    "newell": newell,
    "wiedemann": wiedemann,
}
