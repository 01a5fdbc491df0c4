"""The main road of a simulated network: the sequence of its links, and the position at which each begins.

Simulators state how far a vehicle is along its link. The distance between the starts of two links follows from the
vehicles that drive from one to the other, because a step is speed x time. At forks and merges the road goes where most
vehicles go.
"""

import heapq
from dataclasses import dataclass

import numpy as np

START_TOLERANCE = 1.0
"""Largest difference [m] between two estimates of a link's start; speeds are rounded and change within a step."""
_OUTER = 0.01  # share of the rows at either end of a link that may be damaged


@dataclass(frozen=True)
class Steps:
    """Rows of vehicles on links, which are numbered from 0, sorted by vehicle and time.

    `along` is the distance of the front from the beginning of the link [m], `speed` in m/s, `period` the time between
    two frames [s].
    """

    track: np.ndarray
    frame: np.ndarray
    link: np.ndarray
    along: np.ndarray
    speed: np.ndarray
    period: float


def main_road(steps: Steps) -> tuple[np.ndarray, np.ndarray]:
    """Start of each link along the road of the link with the most rows [m], NaN for links that are not part of it; and
    the mask of the rows at which a vehicle starts another lap, as on a ring.
    """
    rows = np.flatnonzero((np.diff(steps.track) == 0) & (np.diff(steps.frame) == 1))
    moved = _moved(steps, rows)
    changes = steps.link[rows] != steps.link[rows + 1]
    rows, moved = rows[changes], moved[changes]
    apart = steps.along[rows] + moved - steps.along[rows + 1]
    joints = _joints(steps.link[rows], steps.link[rows + 1], apart)
    begins = _starts(joints, steps)
    # At least two vehicles, because a single one may be a damaged row.
    closing = {
        (joint.behind, joint.ahead)
        for joint in joints
        if joint.n > 1 and abs(begins[joint.ahead] - begins[joint.behind] - joint.apart) > START_TOLERANCE
    }
    laps = np.zeros(len(steps.track), bool)
    if closing:
        pairs = zip(steps.link[rows].tolist(), steps.link[rows + 1].tolist(), strict=True)
        laps[rows + 1] = [pair in closing for pair in pairs]
    return begins, laps


@dataclass(frozen=True)
class _Joint:
    """Two consecutive links, the distance from start to start [m], and the number of vehicles that drive over both."""

    behind: int
    ahead: int
    apart: float
    n: int


def _moved(steps: Steps, rows: np.ndarray) -> np.ndarray:
    """Distance from each row to the next [m]: speed x time, with the later or the mean speed, whichever fits better.

    Source: SUMO documentation, Simulation/Basic_Definition, Euler and ballistic integration.
    """
    later, mean = steps.speed[rows + 1], 0.5 * (steps.speed[rows] + steps.speed[rows + 1])
    same = steps.link[rows] == steps.link[rows + 1]
    if not same.any():
        return mean * steps.period
    step = (steps.along[rows + 1] - steps.along[rows])[same]
    errors = [np.median(np.abs(step - speed[same] * steps.period)) for speed in (later, mean)]
    return (later if errors[0] < errors[1] else mean) * steps.period


def _joints(behind: np.ndarray, ahead: np.ndarray, apart: np.ndarray) -> list[_Joint]:
    """Pairs of consecutive links whose distance is the same for most vehicles."""
    pairs, inverse = np.unique(np.stack([behind, ahead]), axis=1, return_inverse=True)
    joints = []
    for pair, rows in enumerate(_rows_of(inverse.ravel(), pairs.shape[1])):
        middle = float(np.median(apart[rows]))
        if np.median(np.abs(apart[rows] - middle)) <= START_TOLERANCE:
            joints.append(_Joint(int(pairs[0, pair]), int(pairs[1, pair]), middle, len(rows)))
    return joints


def _rows_of(group: np.ndarray, n_groups: int) -> list[np.ndarray]:
    """Rows of every group. Without groups np.split returns one part, which is cut off."""
    order = np.argsort(group, kind="stable")
    return np.split(order, np.searchsorted(group[order], np.arange(1, n_groups)))[:n_groups]


def _starts(joints: list[_Joint], steps: Steps) -> np.ndarray:
    """Start of each link along the road [m], from the link with most rows along the joints with most vehicles."""
    n_links = int(steps.link.max()) + 1
    rows = _rows_of(steps.link, n_links)
    ends = [np.quantile(steps.along[part], (_OUTER, 1.0 - _OUTER)) if part.size else np.zeros(2) for part in rows]
    neighbours: dict[int, list[tuple[int, int, float]]] = {link: [] for link in range(n_links)}
    for joint in joints:
        # Negative, because the heap gives the smallest number first.
        neighbours[joint.behind].append((-joint.n, joint.ahead, joint.apart))
        neighbours[joint.ahead].append((-joint.n, joint.behind, -joint.apart))
    begins = np.full(n_links, np.nan)
    placed: list[np.ndarray] = []
    waiting = [(0, int(np.argmax([part.size for part in rows])), 0.0)]
    while waiting:
        _, link, begin = heapq.heappop(waiting)
        here = begin + ends[link]
        if not np.isnan(begins[link]) or any(_beside(here, other) for other in placed):
            continue
        # A link between two links of the road must be joined to both; a ramp is joined to one of them only.
        sides = {apart > 0.0 for _, other, apart in neighbours[link] if not np.isnan(begins[other])}
        if placed and np.nanmin(begins) < begin < np.nanmax(begins) and len(sides) < 2:
            continue
        begins[link] = begin
        placed.append(here)
        for n, other, apart in neighbours[link]:
            heapq.heappush(waiting, (n, other, begin + apart))
    return begins - np.nanmin(begins)


def _beside(here: np.ndarray, other: np.ndarray) -> bool:
    """True if two stretches overlap along the road, so that they are side by side."""
    overlap = min(here[1], other[1]) - max(here[0], other[0])
    return bool(overlap > START_TOLERANCE or here[0] < other.mean() < here[1] or other[0] < here.mean() < other[1])
