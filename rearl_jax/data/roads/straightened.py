"""Tracks on a map or in an image, converted to traffic on a straight road: carriageways, positions, lanes."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from rearl_jax.data.checks.lateral_checks import USUAL_WIDTH
from rearl_jax.data.checks.losses import Losses, split_tracks
from rearl_jax.data.problems import bad_recording
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.roads.road_axis import SPACING, RoadAxis, road_axis
from rearl_jax.data.vehicle_rows import first_and_last_rows, follows_row_before

RARE_SHARE = 0.001
"""Smallest share of the rows of a carriageway for a lane; rarer numbers are faults, or short pieces beside the road."""
LANE_SPREAD = 3.0
"""Largest width [m] that holds 90 % of the vehicle centres of a lane; it is larger on a ramp that leaves the road."""
_MAX_LANE = 1e15  # larger than every lane number, and exact as float64
_MIN_MOVED = 5.0  # m; the direction of a vehicle that moves less is unknown
_SHARED_SHARE = 0.3  # of the rows of a lane number in either direction, if both carriageways use the number
_END_MARGIN = 5.0 * SPACING  # m; vehicles may be so far beyond the ends of the axis


@dataclass(frozen=True)
class LaneOrder:
    """Lanes of one carriageway.

    Attributes:
        ranks: Number in the source -> rank, 0 = leftmost.
        left_edge: Lateral position of the left edge of the leftmost lane [m], positive to the right.
        apart: Numbers whose vehicles do not drive along the road, as on ramps that leave it.
    """

    ranks: dict[int, int]
    left_edge: float
    apart: tuple[int, ...]

    @property
    def count(self) -> int:
        """Number of lanes."""
        return max(self.ranks.values(), default=0) + 1

    def rank_of(self, number: np.ndarray) -> np.ndarray:
        """Rank of each number; NaN for one that is not a lane of this carriageway."""
        return pd.Series(number).map(self.ranks).to_numpy(np.float64, na_value=np.nan)


@dataclass(frozen=True)
class Straightened:
    """Traffic on a straight road.

    Attributes:
        columns: direction, x, y, position, lateral and lane of each row, as in the canonical table.
        lanes: Lanes of each direction.
        road_length: Length of the road [m].
        off_road: Mask of the rows in lanes that leave the road.
        no_lane: Mask of the rows whose lane number is not a lane of the road.
        wrong_way: Mask of the rows of vehicles that drive against all others of their lane.
    """

    columns: pd.DataFrame
    lanes: dict[int, LaneOrder]
    road_length: float
    off_road: np.ndarray
    no_lane: np.ndarray
    wrong_way: np.ndarray

    @property
    def is_mirrored(self) -> bool:
        """True if the vehicles of direction 2 seem to drive on the left, which means that y has the wrong sign: the
        data sets are from countries with right-hand traffic.
        """
        y, direction = self.columns["y"].to_numpy(), self.columns["direction"].to_numpy()
        if len(self.lanes) < 2:
            return False
        oncoming, along_x = (float(np.nanmedian(y[direction == side])) for side in (1, 2))
        return oncoming > along_x


def straightened(
    track: np.ndarray,
    piece: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    number: np.ndarray,
    info: RecordingInfo,
    *,
    y_down: bool,
    shared: float = _SHARED_SHARE,
) -> Straightened:
    """The tracks on a straight road.

    As in the highD format, direction 2 drives along x and y grows to its right; direction 1 drives against x. If all
    drive one way, that is direction 1 and drives along x.

    Args:
        track: Vehicle of each row; its rows are together and in the order of time.
        piece: Number of the part of a track, within one lane, to which each row belongs, ascending.
        x: Position on the map [m].
        y: Position on the map [m].
        number: Lane in the source, NaN where it is unknown.
        info: The recording, for messages.
        y_down: Whether y points down, as in images, so that right and left are interchanged.
        shared: Smallest share of rows in each direction for a lane number to belong to both carriageways [-]; above
            0.5 every number belongs to one carriageway.

    Raises:
        BadRecordingError: No vehicle moves.
    """
    axis = road_axis(track, piece, x, y, y_down=y_down)
    if axis is None:
        text = "no vehicle moves, so that the road cannot be found"
        raise bad_recording("no-motion", text, "complete the positions", info.file, column=info.columns["x"])
    along, across = axis.places(x, y)
    ways, sides = _ways(track, along, number, shared)
    of_lane = pd.Series(number).map(sides).to_numpy(np.float64, na_value=np.nan)
    wrong = np.isfinite(of_lane) & (of_lane != 0.0) & (ways != 0.0) & (of_lane != ways)
    # Vehicles that stand, or drive against all others, get the direction of their lane.
    ways = np.where((ways == 0.0) | wrong, np.where(np.isfinite(of_lane) & (of_lane != 0.0), of_lane, 1.0), ways)
    both = bool((ways < 0.0).any() and (ways > 0.0).any())
    first, length = _extent(axis, along)
    lanes, columns = dict[int, LaneOrder](), {}
    columns["x"], columns["y"] = along - first, across
    columns["position"] = np.where(ways > 0.0, along - first, length - (along - first))
    columns["direction"] = np.where(ways > 0.0, 2 if both else 1, 1)
    lateral, lane = np.full(len(track), np.nan), np.full(len(track), np.nan)
    off_road, no_lane = np.zeros(len(track), dtype=bool), np.zeros(len(track), dtype=bool)
    for way in np.unique(ways):
        here = np.flatnonzero(ways == way)
        order = _lane_order(number[here], way * across[here])
        lanes[int(columns["direction"][here[0]])] = order
        lateral[here] = way * across[here] - order.left_edge
        lane[here] = order.rank_of(number[here])
        off_road[here] = np.isin(number[here], order.apart)
        no_lane[here] = ~np.isfinite(lane[here]) & ~off_road[here]
    columns |= {"lateral": lateral, "lane": lane}
    placeholder = _within_lanes(track, number, lane, off_road)
    off_road, no_lane = off_road & ~placeholder, no_lane | placeholder
    return Straightened(pd.DataFrame(columns), lanes, length, off_road, no_lane, wrong)


def _lane_order(number: np.ndarray, across: np.ndarray) -> LaneOrder:
    """The lanes of one carriageway.

    Lanes are side by side at least half a lane apart; numbers nearer to each other are parts of one lane. `number` is
    the lane of each row in the source, NaN where unknown, `across` its lateral position, positive to the right [m].
    """
    known = (np.abs(number) < _MAX_LANE) & np.isfinite(across)
    numbers, which, n_rows = np.unique(number[known], return_inverse=True, return_counts=True)
    offsets = [across[known][which == lane] for lane in range(len(numbers))]
    low, middle, high = np.array([np.quantile(of_lane, (0.05, 0.5, 0.95)) for of_lane in offsets]).reshape(-1, 3).T
    is_rare = n_rows < RARE_SHARE * known.sum()
    is_lane = ~is_rare & (high - low <= LANE_SPREAD)
    ranks, rank, previous = dict[int, int](), 0, -np.inf
    for lane in np.argsort(middle):
        if not is_lane[lane]:
            continue
        if middle[lane] - previous > 0.5 * USUAL_WIDTH:
            rank += 0 if np.isinf(previous) else max(int(np.rint((middle[lane] - previous) / USUAL_WIDTH)), 1)
            previous = middle[lane]
        ranks[int(numbers[lane])] = rank
    apart = tuple(numbers[~is_lane & ~is_rare].astype(np.int64).tolist())
    middle = np.sort(middle[is_lane])
    left = float(middle[0]) if middle.size else 0.0
    width = (float(middle[-1]) - left) / rank if rank else USUAL_WIDTH
    return LaneOrder(ranks, left - 0.5 * width, apart)


def _within_lanes(track: np.ndarray, number: np.ndarray, lane: np.ndarray, off_road: np.ndarray) -> np.ndarray:
    """Mask of the rows off the road whose number mostly stands between rows of one lane, as no ramp does."""
    begins = ~follows_row_before(track)
    begins[1:] |= number[1:] != number[:-1]
    first, last = first_and_last_rows(np.cumsum(begins))
    before, after = np.maximum(first - 1, 0), np.minimum(last + 1, len(track) - 1)
    is_within = (track[before] == track[first]) & (track[after] == track[first]) & (lane[before] == lane[after])
    apart = off_road[first]
    numbers, which = np.unique(number[first][apart], return_inverse=True)
    n_within, n_pieces = np.bincount(which, is_within[apart], len(numbers)), np.bincount(which, minlength=len(numbers))
    return off_road & np.isin(number, numbers[n_within > 0.5 * n_pieces])


def leave_out(table: pd.DataFrame, off_road: pd.Series, losses: Losses) -> pd.DataFrame:
    """The table without the rows off the road, which are counted; a track that comes back continues under a new id."""
    marked = off_road.reindex(table.index).to_numpy(bool)
    if not marked.any() or marked.all():
        return table
    back = follows_row_before(table["track_id"].to_numpy())
    back[1:] &= ~marked[1:] & marked[:-1]
    track = table["track_id"].to_numpy()
    n_remaining = pd.Series(~marked).groupby(track).cumsum().to_numpy()
    kept = losses.remove(table, marked, "off_road")
    # Not at the first remaining row of a track, because nothing precedes it.
    return split_tracks(kept, (back & (n_remaining > 1))[~marked])


def _ways(
    track: np.ndarray, along: np.ndarray, number: np.ndarray, shared: float
) -> tuple[np.ndarray, dict[float, float]]:
    """Sense of driving along the axis, 1 or -1, of each row (0 if unknown) and of each lane number (0 if both)."""
    starts, ends = first_and_last_rows(track)
    moved = np.nan_to_num(along[ends] - along[starts])
    way = np.where(np.abs(moved) > _MIN_MOVED, np.sign(moved), 0.0)
    ways = np.repeat(way, ends - starts + 1)
    moving = (ways != 0.0) & np.isfinite(number)
    lanes, inverse = np.unique(number[moving], return_inverse=True)
    forward = np.bincount(inverse, weights=ways[moving] > 0.0) / np.maximum(np.bincount(inverse), 1)
    sides = np.where((forward >= shared) & (forward <= 1.0 - shared), 0.0, np.where(forward > 0.5, 1.0, -1.0))
    return ways, dict(zip(lanes.tolist(), sides.tolist(), strict=True))


def _extent(axis: RoadAxis, along: np.ndarray) -> tuple[float, float]:
    """Smallest position of a vehicle along the axis, and the length of the road from there [m]."""
    end = float(np.hypot(np.diff(axis.along), np.diff(axis.bend)).sum())
    on_road = along[(along > -_END_MARGIN) & (along < end + _END_MARGIN)]
    first = float(on_road.min(initial=0.0))
    return first, max(float(on_road.max(initial=0.0)) - first, 1.0)
