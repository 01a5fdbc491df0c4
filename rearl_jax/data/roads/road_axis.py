"""The axis of a road, found from the paths of its vehicles, and positions along and across it.

Positions on a map or in an image become positions on a straight road: along the axis, which follows the bends of the
road, and across it. Everywhere the road must be within 60 degrees of its main direction.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from rearl_jax.data.vehicle_rows import first_and_last_rows

SPACING = 20.0
"""Distance between the points of an axis [m], short compared with the radii of highway bends, which exceed 300 m."""
_MAX_STEP = 0.5 * SPACING  # m between two frames; at 10 frames per second no vehicle moves further


@dataclass(frozen=True)
class RoadAxis:
    """An axis through the middle of the traffic.

    Attributes:
        origin: A point of the straight line in the main direction of the traffic [m, m].
        forward: Unit vector along the straight line.
        right: Unit vector to the right of the straight line.
        along: Positions of the points of the axis along the straight line [m], ascending.
        bend: Distances of those points from the straight line, positive to the right [m].
    """

    origin: np.ndarray
    forward: np.ndarray
    right: np.ndarray
    along: np.ndarray
    bend: np.ndarray

    def places(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances along the axis from its first point and across it, positive to the right [m]."""
        known = np.isfinite(x) & np.isfinite(y)
        x, y = np.where(known, x, np.nan), np.where(known, y, np.nan)
        a, b = _on_line(x, y, self.origin, self.forward, self.right)
        steps = np.hypot(np.diff(self.along), np.diff(self.bend))
        length = np.concatenate([[0.0], np.cumsum(steps)])
        slope = np.gradient(self.bend, self.along)
        angle = np.arctan(np.interp(a, self.along, slope))
        off = b - np.interp(a, self.along, self.bend)
        foot = a + off * np.sin(angle) * np.cos(angle)
        # Beyond its ends the axis is straight.
        beyond = np.maximum(foot - self.along[-1], 0.0) + np.minimum(foot - self.along[0], 0.0)
        return np.interp(foot, self.along, length) + beyond, off * np.cos(angle)


def road_axis(track: np.ndarray, piece: np.ndarray, x: np.ndarray, y: np.ndarray, *, y_down: bool) -> RoadAxis | None:
    """The axis that most vehicles drive along; None if none of them moves.

    The straight line has the main direction of the vehicles' paths, in either sense. The lateral shift of the road
    between two points is the median over all vehicles that pass both without changing lanes. The arguments are those of
    `straightened.straightened`.
    """
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y) & (np.abs(x) < 1e7) & (np.abs(y) < 1e7))
    if not known.size:
        return None
    track, piece, x, y = (values[known] for values in (track, piece, x, y))
    first, last = first_and_last_rows(track)
    moved = np.stack([x[last] - x[first], y[last] - y[first]], axis=1)
    values, vectors = np.linalg.eigh(moved.T @ moved)
    if not values[-1] > 1.0:
        return None
    forward = vectors[:, -1]
    # The sense in which most vehicles drive; if as many drive either way, that of growing x.
    ahead = np.sign(moved @ forward).sum()
    if ahead < 0 or (ahead == 0 and forward[0] < 0):
        forward = -forward
    right = np.array([-forward[1], forward[0]]) if y_down else np.array([forward[1], -forward[0]])
    origin = np.array([np.median(x), np.median(y)])
    a, b = _on_line(x, y, origin, forward, right)
    low, high = np.quantile(a, (0.001, 0.999))
    n_points = max(int(np.ceil((high - low) / SPACING)), 1) + 1
    along = low + SPACING * np.arange(n_points)
    bend = np.concatenate([[0.0], np.cumsum(_increments(piece, a - low, b, n_points - 1))])
    return RoadAxis(origin, forward, right, along, bend - np.median(bend))


def _on_line(
    x: np.ndarray, y: np.ndarray, origin: np.ndarray, forward: np.ndarray, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Positions along the straight line and to its right, the arrays a and b of this module [m]."""
    dx, dy = x - origin[0], y - origin[1]
    return dx * forward[0] + dy * forward[1], dx * right[0] + dy * right[1]


def _increments(piece: np.ndarray, a: np.ndarray, b: np.ndarray, n: int) -> np.ndarray:
    """Shift of the road to the right between consecutive points [m]: the median over all vehicles that pass both.

    `a` and `b` are the positions of the rows along the straight line, from the first point, and to its right [m].
    """
    cell = np.floor(a / SPACING).astype(np.int64)
    step = np.diff(a)
    crosses = (piece[1:] == piece[:-1]) & (np.abs(np.diff(cell)) == 1) & (np.abs(step) < _MAX_STEP)
    rows = np.flatnonzero(crosses)
    point = np.maximum(cell[rows], cell[rows + 1])
    share = (SPACING * point - a[rows]) / step[rows]
    # Only the first crossing of a point counts, because a vehicle that stands there may cross it several times.
    crossings = pd.DataFrame({"piece": piece[rows], "point": point, "b": b[rows] + share * (b[rows + 1] - b[rows])})
    crossings = crossings.groupby(["piece", "point"], as_index=False).first()
    crossing_piece, point, b = (crossings[name].to_numpy() for name in ("piece", "point", "b"))
    same = (crossing_piece[1:] == crossing_piece[:-1]) & (np.diff(point) == 1)
    medians = pd.Series(np.diff(b)[same]).groupby(point[:-1][same]).median()
    # Where no vehicle passes both points, and at the ends, the road continues as in the neighbouring parts.
    return medians.reindex(np.arange(n)).interpolate(limit_direction="both").fillna(0.0).to_numpy(np.float64)
