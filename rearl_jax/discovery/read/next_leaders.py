"""The leaders before and after each change of leader, and the gradual transition in smoothed recordings."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Float, Int
from scipy.stats import norm

from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.data.vehicle_rows import VehicleRows

LONGEST_LEAD = 5.0
"""Time before a change of leader from which a driver may respond to the next leader [s]; lane changes take 3 to 6 s.

Source: Toledo & Zohar, Transp. Res. Rec. 1999 (2007) 71.
"""


@dataclass(frozen=True)
class Handovers:
    """Changes of leader around each row; leaders are rows of the table as in `surroundings.Around`.

    Attributes:
        following: Row of the leader after the next change, in the same frame; NO_VEHICLE if no change is near.
        time_to: Time until the next change [s]; inf if no change is near.
        by_own: Whether the driver itself changes lanes at the next change.
        preceding: Row of the leader before the last change, in the same frame; NO_VEHICLE if no change is near.
        time_since: Time since the last change [s]; inf if no change is near.
    """

    following: Int[np.ndarray, " rows"]
    time_to: Float[np.ndarray, " rows"]
    by_own: Float[np.ndarray, " rows"]
    preceding: Int[np.ndarray, " rows"]
    time_since: Float[np.ndarray, " rows"]


def handovers(
    table: pd.DataFrame,
    bounds: tuple[np.ndarray, np.ndarray],
    leader: Int[np.ndarray, " rows"],
    dt: float,
    longest: float,
) -> Handovers:
    """Changes from one leader to another.

    Args:
        table: Canonical table, sorted by track and frame.
        bounds: First row of each track, and one past its last.
        leader: Track of the leader of every row, NO_VEHICLE without one.
        dt: Time step [s].
        longest: Largest time to or since a change for the change to count as near [s].
    """
    n = len(table)
    changes = Handovers(*(np.full(n, value) for value in (NO_VEHICLE, np.inf, 0.0, NO_VEHICLE, np.inf)))
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=-1.0)
    frame, index = table["frame"].to_numpy(np.int64), VehicleRows(table)
    first, stop = (np.repeat(bound, bounds[1] - bounds[0]) for bound in bounds)
    row = np.arange(n)
    is_change = (row > first) & (leader != np.r_[NO_VEHICLE, leader[:-1]])
    reach = max(1, round(longest / dt))
    last = 0
    for k in np.flatnonzero(is_change):
        old, new = leader[k - 1], leader[k]
        if old == NO_VEHICLE or new == NO_VEHICLE:
            continue
        before = row[max(first[k], last, k - reach) : k]
        last = k
        place = index.rows(int(new), frame[before])
        here = place != NO_VEHICLE
        changes.following[before[here]], changes.time_to[before[here]] = place[here], (k - before[here]) * dt
        changes.by_own[before[here]] = float(lane[k] != lane[k - 1])
        after = row[k : min(stop[k], k + reach)]
        place = index.rows(int(old), frame[after])
        here = place != NO_VEHICLE
        changes.preceding[after[here]], changes.time_since[after[here]] = place[here], (after[here] - k) * dt
    return changes


def handed_over(
    values: Float[np.ndarray, " rows"],
    own_values: Float[np.ndarray, " rows"],
    changes: Handovers,
    smoothing: float,
    dt: float,
) -> Float[np.ndarray, " rows"]:
    """A quantity of the leader, blended over changes of leader to match the follower's smoothed motion.

    A driver's immediate response to a step becomes, after smoothing with a Gaussian kernel, the response to a smoothed
    step.

    Args:
        values: The quantity of the present leader.
        own_values: The quantity of every row's own vehicle.
        changes: Changes of leader.
        smoothing: Standard deviation of the kernel [s]; 0 for none.
        dt: Time step [s].
    """
    if not smoothing:
        return values
    later = np.where(changes.following != NO_VEHICLE, own_values[changes.following] - values, 0.0)
    earlier = np.where(changes.preceding != NO_VEHICLE, own_values[changes.preceding] - values, 0.0)
    return (
        values
        + later * norm.cdf(-(changes.time_to - dt / 2) / smoothing)
        + earlier * norm.cdf(-(changes.time_since + dt / 2) / smoothing)
    )
