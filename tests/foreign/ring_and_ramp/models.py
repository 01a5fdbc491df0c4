"""Drivers and the published base car-following models.

Every model maps (gap, own speed, leader speed) to an acceleration and lacks all of the ten effects:
it answers at once, to one leader only, with a fixed time gap per driver.

Sources
    helly  Helly 1959, Simulation of bottlenecks in single-lane traffic flow: 0.125 1/s2 on spacing, 0.5 1/s
           on speed difference; free road min rule and 0.3 1/s of van Arem, van Driel and Visser 2006 (MIXIC).
    fvd    Jiang, Wu and Zhu 2001 (0.41 1/s, 0.5 1/s), speed-difference term that fades with the gap and
           triangular optimal velocity as in Treiber and Kesting 2013, Traffic Flow Dynamics, ch. 10.
    lcm    Ni, Leonard, Jia and Wang 2016, Vehicle longitudinal control and traffic stream modeling (equal
           braking of follower and leader).
    driver spread and correlation: Ossen and Hoogendoorn 2011; Kim and Mahmassani 2011.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

BASE_MODELS = ("helly", "fvd", "lcm")
GAP_SCALE = {"helly": 1.0, "fvd": 1.0, "lcm": 0.5}  # 1, factor of the model on the time gap of a driver
A_MIN = -8.0  # m/s2, dry-road full braking
GUARD = 2.2  # m/s2, needed braking above which a driver stops following the model and just brakes
B_LEADER = 4.5  # m/s2, braking of the leader that drivers are prepared for


@dataclass
class Fleet:
    """Drivers and vehicles; one entry per vehicle and one last entry that stands for a fixed obstacle."""

    v0: Array  # m/s, desired speed
    gap_time: Array  # s, desired time gap
    s0: Array  # m, standstill gap
    a_max: Array  # m/s2, largest acceleration
    f_gap: Array  # 1, factor on the sensitivity to the gap
    f_speed: Array  # 1, factor on the sensitivity to the speed difference
    length: Array  # m
    width: Array  # m
    kind: NDArray[np.str_]  # car, van, truck
    truck: NDArray[np.bool_]

    def __len__(self) -> int:
        return self.v0.size


def draw_fleet(n: int, truck_share: Array, rng: np.random.Generator) -> Fleet:
    """Draw n vehicles with correlated driver parameters; truck_share is the truck probability of each one."""
    corr = np.array(
        [
            # v0     T     s0     a     gap   speed
            [1.00, -0.40, -0.15, 0.35, 0.20, 0.10],
            [-0.40, 1.00, 0.30, -0.20, -0.30, -0.15],
            [-0.15, 0.30, 1.00, -0.10, -0.10, 0.00],
            [0.35, -0.20, -0.10, 1.00, 0.25, 0.20],
            [0.20, -0.30, -0.10, 0.25, 1.00, 0.40],
            [0.10, -0.15, 0.00, 0.20, 0.40, 1.00],
        ]
    )
    z = np.clip(rng.standard_normal((n + 1, 6)) @ np.linalg.cholesky(corr).T, -2.2, 2.2)
    u = rng.random((n + 1, 2))
    truck = np.append(u[:n, 0] < truck_share, False)
    van = ~truck & (u[:, 1] < 0.12)
    size = rng.standard_normal((n + 1, 2))

    def pick(car: float, lorry: float, spread: float, col: int) -> Array:
        return np.where(truck, lorry, car) * np.exp(spread * z[:, col])

    fleet = Fleet(
        v0=np.where(truck, 24.0 + 0.8 * z[:, 0], 31.0 + 2.8 * z[:, 0]),
        gap_time=np.maximum(pick(1.25, 1.75, 0.26, 1), 0.7),
        s0=pick(2.6, 3.2, 0.2, 2),
        a_max=pick(1.7, 0.8, 0.2, 3),
        f_gap=pick(1.0, 0.8, 0.3, 4),
        f_speed=pick(1.0, 0.9, 0.25, 5),
        length=np.where(
            truck,
            14.0 + 2.5 * size[:, 0].clip(-2, 1.5),
            np.where(van, 5.8, 4.5) + np.where(truck, 0.0, 0.3) * size[:, 0].clip(-2, 2),
        ),
        width=np.where(truck, 2.5, np.where(van, 2.05, 1.83) + 0.05 * size[:, 1].clip(-2, 2)),
        kind=np.where(truck, "truck", np.where(van, "van", "car")),
        truck=truck,
    )
    fleet.length[n] = 0.0
    return fleet


def base_acceleration(
    model: str, fleet: Fleet, i: Ints, v0: Array, gap_time: Array, s: Array, v: Array, vl: Array
) -> Array:
    """Acceleration (m/s2) of drivers i for gap s (m), own speed v and leader speed vl (m/s)."""
    s0, a_max = fleet.s0[i], fleet.a_max[i]
    if model == "helly":
        follow = 0.5 * fleet.f_speed[i] * (vl - v) + 0.125 * fleet.f_gap[i] * (s - s0 - gap_time * v)
        acc = np.minimum(0.3 * (v0 - v), follow)
    elif model == "fvd":
        wish = np.clip((s - s0) / gap_time, 0.0, v0)
        fade = np.maximum(1.0, s / (v0 * gap_time))
        acc = 0.41 * fleet.f_gap[i] * (wish - v) + 0.5 * fleet.f_speed[i] * (vl - v) / fade
    elif model == "lcm":
        ell = fleet.s0[i] + 4.5  # m, effective length; the leader's own length is already in the gap
        b = 3.5 / fleet.f_speed[i]
        star = np.maximum((v * v - vl * vl) / (2.0 * b) + GAP_SCALE["lcm"] * gap_time * v + ell, 0.4 * ell)
        acc = 2.0 * a_max * (1.0 - v / v0 - np.exp(np.minimum(1.0 - (s + 4.5) / star, 3.0)))
    else:
        raise ValueError(f"unknown base model {model!r}")
    return np.clip(acc, A_MIN, a_max)


def guard(acc: Array, s: Array, v: Array, vl: Array, s0: Array) -> Array:
    """Limit acc (m/s2) when only hard braking avoids contact, also if the leader goes on braking (Gipps 1981)."""
    room = s - 0.75 * s0
    need = np.maximum(v - vl, 0.0) ** 2 / (2.0 * np.maximum(room, 0.25))
    acc = np.where(need > GUARD, np.minimum(acc, -1.15 * need), acc)
    stop = v * v / (2.0 * np.maximum(room + vl * vl / (2.0 * B_LEADER), 0.25))
    alarm = np.clip((stop - 0.85 * B_LEADER) / (0.2 * B_LEADER), 0.0, 1.0)
    acc = np.where(alarm > 0.0, np.minimum(acc, -1.1 * stop * alarm), acc)
    return np.clip(np.where(room < 0.0, np.minimum(acc, -4.0), acc), A_MIN, None)
