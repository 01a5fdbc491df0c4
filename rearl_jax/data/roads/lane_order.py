"""Ranks of lanes from the left, from the lateral positions of their vehicles, whatever lane numbers a source uses."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from rearl_jax.data.checks.lateral_checks import USUAL_WIDTH

RARE_SHARE = 0.001
"""Smallest share of the rows of a carriageway for a lane; rarer numbers are faults, or short pieces beside the road."""
LANE_SPREAD = 3.0
"""Largest width [m] that holds 90 % of the vehicle centres of a lane; it is larger on a ramp that leaves the road."""


_MAX_LANE = 1e15  # larger than every lane number, and exact as float64


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


def lane_order(number: np.ndarray, across: np.ndarray) -> LaneOrder:
    """The lanes of one carriageway.

    Lanes are side by side at least half a lane apart; numbers nearer to each other are parts of one lane.

    Args:
        number: Lane of each row in the source; NaN where it is unknown.
        across: Lateral position of each row, positive to the driver's right [m].
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
