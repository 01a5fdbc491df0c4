"""Speeds that were measured by themselves, and positions that take their fast part from them.

Satellite receivers and wheels measure speeds better than the derivative of a position or a gap shows them, so what a
vehicle does within seconds is in its speed column, and where it is, in its position. A speed column that was computed
from the positions says nothing new and is left alone: it is a filter of them, however smooth.

Source: complementary filter, Higgins, IEEE Trans. Aerosp. Electron. Syst. 11 (1975) 321.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.read.gate import Finding
from rearl_jax.discovery.read.smoothing import Thinned, smoothed, track_bounds
from rearl_jax.discovery.thresholds import THRESHOLDS

FAST = 2.0
"""Angular frequency [rad/s] above which the two columns are compared."""

DRIFT = 0.3
"""Angular frequency [rad/s] below which the position is believed: integrated speeds drift."""

FILTER_TIME = 1.0
"""Time before and after a moment from which a computed speed would take positions [s]."""

LEAST_TIME = 20.0
"""Shortest piece of a track that is compared [s]."""

SPEED_SENSOR = Finding(
    "speed_sensor",
    False,
    "slower",
    "rad/s",
    DRIFT,
    0.0,
    "speeds were measured by themselves and are smoother than positions: what vehicles do within seconds is taken from "
    "them",
)
"""That the fast part of positions is taken from the speeds."""


def has_speed_sensor(tables: Sequence[Thinned]) -> bool:
    """True if speeds are smoother than positions, and no filter of the positions."""
    of_position, of_speed, dt = [], [], tables[0][1]
    reach = round(FILTER_TIME / dt)
    for position, driven in _tracks(tables):
        if len(position) * dt < LEAST_TIME:
            continue
        fast, other = (values - smoothed(values, dt, FAST)[0] for values in (position, driven))
        window = np.lib.stride_tricks.sliding_window_view(fast, 2 * reach + 1)
        inner = slice(reach, len(window) - reach)  # the ends are bent by smoothing
        of_position.append(window[inner])
        of_speed.append(other[reach : len(other) - reach][inner])
    if not of_position:
        return False
    rows, target = np.concatenate(of_position), np.concatenate(of_speed)
    if target.std() > THRESHOLDS.sensor_roughness * rows[:, reach].std():
        return False
    left = target - rows @ np.linalg.lstsq(rows, target, rcond=None)[0]
    return bool(left.var() > THRESHOLDS.sensor_own_share * target.var())


def with_fast_speeds(table: Thinned) -> Thinned:
    """The table with positions whose fast part is the integrated speed."""
    rows, dt = table
    fused = [driven + smoothed(position - driven, dt, DRIFT)[0] for position, driven in _tracks([table])]
    return rows.assign(position=np.concatenate(fused) if fused else rows["position"]), dt


def _tracks(
    tables: Sequence[Thinned],
) -> Iterator[tuple[Float[np.ndarray, " steps"], Float[np.ndarray, " steps"]]]:
    """Positions of each track [m], and the distance driven since its start by its speeds [m]."""
    for table, dt in tables:
        position, speed = table["position"].to_numpy(), table["speed"].to_numpy()
        for start, stop in zip(*track_bounds(table), strict=True):
            own = speed[start:stop]
            yield position[start:stop], np.concatenate([[0.0], np.cumsum((own[1:] + own[:-1]) / 2) * dt])
