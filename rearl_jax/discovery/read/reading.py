"""Measured drivers from recordings: smooths positions, finds surrounding vehicles, cuts tracks into pieces
(uninterrupted parts).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pandas as pd

from rearl_jax.core.effects.stimulus import OUT_OF_SIGHT
from rearl_jax.core.following import HARDEST_BRAKING
from rearl_jax.core.leader_history import MAX_TIME_SINCE_CHANGE
from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.data.records import Recording
from rearl_jax.discovery.read.fused_errors import FusedErrors
from rearl_jax.discovery.read.kernels import UNSMOOTHED, Kernel
from rearl_jax.discovery.read.leader_changes import handed_over, handovers, last_changes
from rearl_jax.discovery.read.measured import Measured, Surroundings, is_new, joined
from rearl_jax.discovery.read.sideways_motion import LONGEST_LEAD
from rearl_jax.discovery.read.smoothing import Thinned, cut_off, jumps, position_noise, smoothed_tracks, track_bounds
from rearl_jax.discovery.read.surroundings import look_around
from rearl_jax.discovery.thresholds import THRESHOLDS
from rearl_jax.problems import InvalidInputError, Problem

LONGEST = 65.0
"""Longest piece of a track [s]; longer ones are cut."""

SETTLING = 1.5
"""Time the observer needs to settle at the start of a piece, or after an excluded interval [s]."""

BEFORE_JUMP = 0.5
"""Time before a position jump in which the jump affects smoothed values [s]."""

LEAST_NOISE, EXACT_NOISE = 0.02, 0.05
"""Smallest assumed standard deviation of positions [m], for measurements and for simulations without noise. Noise is
added to more accurate positions: otherwise the residuals would be errors of time discretisation in the model and in the
source of the data; with 0.02 m, noise-free IDM drives were reported as `unexplained`.
"""

APART = 2.0
"""Time between independent measurements in smoothed positions, in standard deviations of the kernel [-]."""

EDGE = 3.0
"""Time from the ends of a smoothed track within which it is distorted, in standard deviations of the kernel [-]."""

SMOOTHED_NOISE = 0.005
"""Smallest assumed standard deviation of smoothed positions [m]: smoothing hides noise, but part of it remains."""

RATE_TOLERANCE = 0.002
"""Relative difference of frame rates [-] that rounded times of short recordings leave: 29.97 and 30 Hz are one."""


NO_LABELS: Mapping[str, Sequence[pd.Series]] = MappingProxyType({})
"""No labels."""


def padded_steps(longest: int, dt: float) -> int:
    """Number of time steps of all pieces of drives: those of LONGEST, or three quarters, a half, three eighths, ... of
    them that hold the longest track, whose time steps are `longest`; `dt` is their length [s]. There are few numbers
    because every one needs programs of its own, whose compilation takes far longer than the time steps without data.
    """
    n_steps = int(LONGEST / dt)
    longest = max(longest, 1)
    while n_steps // 2 >= longest:
        n_steps //= 2
    return 3 * n_steps // 4 if 3 * n_steps // 4 >= longest else n_steps


def one_frame_rate(recordings: Sequence[Recording]) -> float:
    """The frame rate of all recordings, the largest of rates that differ by no more than RATE_TOLERANCE [1/s].

    Raises:
        ValueError: The frame rates differ.
    """
    rates = {recording.info.frame_rate: recording.info.id for recording in recordings}
    if max(rates) <= (1.0 + RATE_TOLERANCE) * min(rates):
        return max(rates)
    examples = ", ".join(f"{rate:.6g} 1/s as {rates[rate]}" for rate in sorted(rates))
    remedy = "choose those of one rate with data.recordings, or resample the others"
    raise InvalidInputError(
        Problem("frame-rates-differ", f"must have one frame rate, not {examples}", remedy, key="data.recordings")
    )


def nobody_follows() -> InvalidInputError:
    """The error that no driver follows a leader long enough."""
    message = f"no driver follows a leader for {THRESHOLDS.least_used_time:g} s: lanes or leaders may be missing, "
    remedy = "run `rearl prepare` to see what was left out"
    return InvalidInputError(Problem("nobody-follows", f"{message}or tracks cut into fragments", remedy))


def measure(
    tables: Sequence[Thinned],
    position_lag: float = 0.0,
    kernel: Kernel = UNSMOOTHED,
    least_noise: float = LEAST_NOISE,
    labels: Mapping[str, Sequence[pd.Series]] = NO_LABELS,
    identity_label: str | None = None,
    fused_errors: FusedErrors | None = None,
) -> Measured:
    """All drivers of the recordings who follow a leader long enough.

    Args:
        tables: Tables of the recordings, with the same time step.
        position_lag: Delay of positions [s]; lanes, lateral positions and leaders are delayed by the same time.
        kernel: Kernel that positions were smoothed with.
        least_noise: Smallest standard deviation of unsmoothed positions [m]; noise is added to reach it.
        labels: Labels of the tracks of each recording, by track_id.
        identity_label: Label that identifies a person or car; None without such a label.
        fused_errors: Errors of positions that were fused with speeds; None for positions that were not.

    Raises:
        ValueError: No driver follows a leader long enough.
    """
    dt = tables[0][1]
    recordings = [_Rows(table, dt, round(position_lag / dt)) for table, _ in tables]
    measured_noise = float(np.median([recording.noise for recording in recordings]))
    noise = max(measured_noise, SMOOTHED_NOISE if kernel.deviation else least_noise)
    added = 0.0 if kernel.deviation else float(np.sqrt(noise**2 - measured_noise**2))
    stride, edge = max(1, round(APART * kernel.deviation / dt)), round(EDGE * kernel.deviation / dt)
    n_steps = padded_steps(max((recording.longest for recording in recordings), default=0), dt)
    pieces, offset = [], 0
    for number, recording in enumerate(recordings):
        rng = np.random.default_rng(number)
        added_noise = added * rng.standard_normal(len(recording.position))
        found = recording.pieces(n_steps, stride, edge, noise, added_noise, kernel, number, offset)
        of_piece = {name: values[number].reindex(found.vehicle - offset) for name, values in labels.items()}
        pieces.append(replace(found, labels={name: values.to_numpy(object) for name, values in of_piece.items()}))
        offset += recording.n_tracks
    used = [found for found in pieces if len(found.driver)]
    if not used:
        raise nobody_follows()
    n_jumps = sum(int(recording.jumps.sum()) for recording in recordings)
    whole = Measured(
        **joined(used),
        dt=dt,
        stride=stride,
        noise=noise,
        kernel=kernel,
        jumps=n_jumps,
        fused_errors=fused_errors,
    )
    if identity_label is not None:
        whole = replace(whole, identity=pd.factorize(whole.labels[identity_label])[0].astype(np.int64))
    return whole.select(np.arange(len(whole.driver)))


class _Rows:
    """The rows of one recording with the surroundings of each."""

    def __init__(self, table: pd.DataFrame, dt: float, late_by: int) -> None:
        """Positions in the table are `late_by` time steps of `dt` [s] late; lanes and leaders are delayed equally."""
        self.dt = dt
        track = table["track_id"].to_numpy()
        self.starts, self.stops = track_bounds(table)
        self.n_tracks = int(track.max()) + 1 if len(track) else 0
        if late_by:
            first = np.repeat(self.starts, self.stops - self.starts)
            source = np.maximum(np.arange(len(track)) - late_by, first)
            delayed = {name: table[name].to_numpy()[source] for name in ("lane", "lateral", "leader_id")}
            table = table.assign(**delayed)
        self.table = table
        self.length = table["length"].to_numpy()
        self.is_truck = (table["vehicle_class"] == "truck").to_numpy()
        self.position = table["position"].to_numpy()
        self.noise = position_noise(self.position, self.starts, self.stops)
        self.jumps = np.zeros(len(self.position), bool)
        for start, stop in zip(self.starts, self.stops, strict=True):
            self.jumps[start:stop] = jumps(self.position[start:stop], dt)
        self.longest = int((self.stops - self.starts).max(initial=0))

    def pieces(
        self,
        n_steps: int,
        stride: int,
        edge: int,
        noise: float,
        added_noise: np.ndarray,
        kernel: Kernel,
        recording: int,
        offset: int,
    ) -> Measured:
        """All usable pieces of the recording number `recording`, each of at most `n_steps` time steps.

        Every `stride`-th time step is an independent measurement; the first and last `edge` rows of a track are
        distorted by smoothing; `noise` is the standard deviation of positions [m]; `added_noise` [m] is added to those
        of drivers; positions were smoothed with `kernel`; `offset` makes track numbers unique.
        """
        dt, table = self.dt, self.table
        x, v, a = smoothed_tracks(self.position, self.starts, self.stops, dt, cut_off(noise, dt))
        columns, leader, leader_row = self._columns(x, v, a, kernel)
        weight = self._weight(leader, leader_row, edge)
        cuts = [
            (start, min(start + n_steps, end))
            for begin, end in zip(self.starts, self.stops, strict=True)
            for start in range(begin, end, n_steps)
        ]
        cuts = [
            (start, stop)
            for start, stop in cuts
            if (stop - start) * dt >= THRESHOLDS.shortest_record
            and weight[start + int(SETTLING / dt) : stop].sum() * dt >= THRESHOLDS.least_used_time
        ]
        first, last = np.array(cuts, int).reshape(-1, 2).T
        index = np.minimum(first + np.arange(n_steps)[:, None], last - 1) if cuts else np.empty((n_steps, 0), int)
        is_recorded = np.arange(n_steps)[:, None] < last - first
        is_settled = np.arange(n_steps)[:, None] >= int(SETTLING / dt)
        values = {name: column[index] for name, column in columns.items()}
        track = table["track_id"].to_numpy()[index[0]].astype(np.int64) if cuts else np.empty(0, np.int64)
        return Measured(
            y=(self.position + added_noise)[index],
            weight=weight[index] * is_recorded * is_settled * is_new(n_steps, stride)[:, None],
            smooth=x[index],
            smooth_speed=v[index],
            surroundings=Surroundings(**values),
            length=self.length[index[0]],
            is_truck=self.is_truck[index[0]],
            driver=track + offset,
            vehicle=track + offset,
            leader=np.where(leader[index] >= 0, leader[index] + offset, NO_VEHICLE),
            recording=np.full(len(cuts), recording),
            identity=np.full(len(cuts), -1),
            dt=dt,
            stride=stride,
            noise=noise,
        )

    def _columns(
        self, x: np.ndarray, v: np.ndarray, a: np.ndarray, kernel: Kernel
    ) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
        """Surroundings of every row by name, the track of its leader, and the row of this leader in the same frame.

        `x` [m], `v` [m/s] and `a` [m/s^2] are smooth positions, speeds and accelerations of all rows; positions
        were smoothed with `kernel`.
        """
        table, length = self.table, self.length
        neighbours = look_around(table, v)
        track = table["track_id"].to_numpy().astype(np.int64)
        lane = table["lane"].to_numpy(dtype=np.float64, na_value=0.0)
        rightmost = pd.Series(lane).groupby(table["direction"].to_numpy()).transform("max").to_numpy()

        def values_of(row: np.ndarray, values: np.ndarray, otherwise: np.ndarray | float | int) -> np.ndarray:
            """`values` of another vehicle, found in `row`, and `otherwise` where there is none."""
            return np.where(row != NO_VEHICLE, values[row], otherwise)

        first, rear = neighbours.leader, x - length / 2  # rows of the first, second and third leader
        second = values_of(first, first, NO_VEHICLE).astype(int)
        third = np.where(second != NO_VEHICLE, first[second], NO_VEHICLE)
        front = x + length / 2
        second_speed = values_of(second, v, values_of(first, v, v))
        leader = values_of(first, track, NO_VEHICLE).astype(np.int64)
        gap = values_of(first, rear, front + OUT_OF_SIGHT) - front
        time_since, gap_lost, time_gap = last_changes(self.starts, self.stops, leader, gap, v, self.dt)
        reach = max(LONGEST_LEAD, EDGE * kernel.deviation)
        near = handovers(table, (self.starts, self.stops), leader, self.dt, reach)
        leader_rear, leader_centre, leader_speed = (
            handed_over(values_of(first, values, otherwise), values, near, kernel, self.dt)
            for values, otherwise in ((rear, front + OUT_OF_SIGHT), (x, x + OUT_OF_SIGHT), (v, v))
        )
        next_rear = values_of(near.following, rear, leader_rear)
        columns = {
            "time": table["time"].to_numpy(),
            "lane": lane,
            "is_leftmost": (lane == 0).astype(float),
            "is_rightmost": (lane == rightmost).astype(float),
            "lateral_offset": _offset_in_lane(table),
            "has_leader": (first != NO_VEHICLE).astype(float),
            "leader_rear": leader_rear,
            "leader_centre": leader_centre,
            "leader_speed": leader_speed,
            "leader_acceleration": np.clip(values_of(first, a, 0.0), HARDEST_BRAKING, -HARDEST_BRAKING),
            "leader_length": values_of(first, length, 4.5),
            "leader_is_truck": values_of(first, self.is_truck.astype(float), 0.0),
            "has_second": (second != NO_VEHICLE).astype(float),
            "second_rear": values_of(second, rear, front + OUT_OF_SIGHT)
            - values_of(second, values_of(first, length, 0.0), 0.0),
            "second_speed": second_speed,
            "has_third": (third != NO_VEHICLE).astype(float),
            "third_speed": values_of(third, v, second_speed),
            "has_follower": (neighbours.follower != NO_VEHICLE).astype(float),
            "follower_front": values_of(neighbours.follower, front, rear - OUT_OF_SIGHT),
            "follower_speed": values_of(neighbours.follower, v, v),
            "has_left": (neighbours.left != NO_VEHICLE).astype(float),
            "left_rear": values_of(neighbours.left, rear, front + OUT_OF_SIGHT),
            "left_speed": values_of(neighbours.left, v, v),
            "beside_speed": np.minimum(neighbours.beside_speed, OUT_OF_SIGHT),
            "n_beside": neighbours.n_beside,
            "time_since_change": time_since,
            "gap_lost": gap_lost,
            "time_gap_at_change": time_gap,
            "time_to_next": np.where(near.following != NO_VEHICLE, near.time_to - near.lead, MAX_TIME_SINCE_CHANGE),
            "next_rear": next_rear,
            "next_speed": values_of(near.following, v, leader_speed),
            "next_by_own": near.by_own,
            "next_is_nearer": (next_rear < leader_rear).astype(float),
            "former_rear": values_of(near.preceding, rear, front + OUT_OF_SIGHT),
            "former_speed": values_of(near.preceding, v, v),
        }
        return columns, leader, first

    def _weight(self, leader: np.ndarray, leader_row: np.ndarray, edge: int) -> np.ndarray:
        """1 if a row counts, else 0. It counts if a leader has been recorded for a second (a missing one may only be
        outside the recorded area), positions of driver and leader do not jump nearby, and neither of the two is within
        `edge` rows of the ends of its track.
        """
        n = max(1, round(1.0 / self.dt))
        row = np.arange(len(leader))
        first, stop = (np.repeat(bound, self.stops - self.starts) for bound in (self.starts, self.stops))
        absent = np.r_[0, np.cumsum(leader == NO_VEHICLE)]
        is_used = absent[row + 1] == absent[np.maximum(row - n, first)]  # no row without a leader in the last second
        jumped = np.r_[0, np.cumsum(self.jumps)]
        before, after = (round(time / self.dt) for time in (BEFORE_JUMP, SETTLING))
        is_calm = jumped[np.minimum(row + before, stop - 1) + 1] == jumped[np.maximum(row - after, first)]
        is_used &= is_calm & is_calm[leader_row]  # no row without a leader is left
        if not edge:
            return is_used.astype(float)
        is_inside = np.minimum(row - first, stop - 1 - row) >= edge
        return (is_used & is_inside & is_inside[leader_row]).astype(float)


def _offset_in_lane(table: pd.DataFrame) -> np.ndarray:
    """Distance from the middle of the nearest lane [m], positive to the right; 0 where unknown. The middle of a lane is
    the median lateral position on it; without lanes, that of all rows.
    """
    lateral = table["lateral"].to_numpy()
    middles = table.groupby(["direction", "lane"], observed=True)["lateral"].median().dropna()
    nearest = np.full(len(table), np.inf)
    for middle in middles if len(middles) else [table["lateral"].median()]:
        offset = lateral - middle
        nearest = np.where(np.abs(offset) < np.abs(nearest), offset, nearest)
    return np.where(np.isfinite(nearest), nearest, 0.0)
