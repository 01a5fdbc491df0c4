"""The Intelligent Driver Model written out once more, so that what is hidden is what remains of true accelerations."""

from dataclasses import dataclass

import numpy as np


@dataclass
class Facts:
    """Arrays [n_steps, n]; `follows` marks drivers with a leader who are free in what they do.

    `remainder`: true acceleration less that of the plain model [m/s^2]; `time_gap_ratio`: the time gap that would
    explain the true acceleration in parts of the driver's own one, NaN where the model does not depend on it.
    """

    follows: np.ndarray
    gap: np.ndarray
    dv: np.ndarray
    plain: np.ndarray
    remainder: np.ndarray
    time_gap_ratio: np.ndarray


def facts(events) -> Facts:
    fleet, n = events.fleet, events.position.shape[1]
    has = events.leader < n
    leader = np.minimum(events.leader, n - 1)
    take = np.arange(len(events.time))[:, None], leader
    gap = events.position[take] - events.position - (fleet.length[leader] + fleet.length) / 2
    dv = events.speed - events.speed[take]
    root = 2 * np.sqrt(fleet.max_accel * fleet.comfort_decel)
    wanted = fleet.jam_gap + np.maximum(0, events.speed * fleet.time_gap + events.speed * dv / root)
    free = 1 - (events.speed / fleet.desired_speed) ** 4
    plain = fleet.max_accel * (free - np.where(has, wanted / gap, 0) ** 2)
    follows = has & (fleet.rank > 0) & (events.speed > 0.5) & (events.acceleration > -7.9)
    explained = gap * np.sqrt(np.maximum(0, free - events.acceleration / fleet.max_accel)) - fleet.jam_gap
    ratio = (explained - events.speed * dv / root) / (events.speed * fleet.time_gap + 1e-9)
    depends = follows & (explained > 0.5) & (events.speed > 3)
    return Facts(follows, gap, dv, plain, events.acceleration - plain, np.where(depends, ratio, np.nan))
