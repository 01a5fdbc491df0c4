"""Position and speed of an unknown table, their units, and the lap of a ring road on which positions begin anew.

Of the two columns one is the rate of change of the other. The ratio of a step of position to speed x time depends on
the units alone, and differs for nearly all pairs of units. Steps are taken over pieces, stretches of some consecutive
rows of one vehicle.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rearl_jax.data.checks.clock import NTSC_RATES, PLAUSIBLE_RATES, STANDARD_RATES
from rearl_jax.data.checks.unit_checks import MIN_CORRELATION
from rearl_jax.data.survey.clock import Clock, named
from rearl_jax.data.survey.sample import FoundColumn
from rearl_jax.data.survey.sizes import Sizes
from rearl_jax.data.tables.usual_names import is_in_pixels, rank_of, unit_in
from rearl_jax.data.units import SI_FACTOR

UNITS_TOGETHER = (
    ("m", "m/s"), ("m", "km/h"), ("ft", "ft/s"), ("ft", "mph"), ("m", "mph"), ("ft", "km/h"), ("ft", "m/s"),
    ("m", "ft/s"), ("cm", "m/s"), ("cm", "km/h"), ("cm", "cm/s"), ("mm", "m/s"), ("km", "km/h"), ("km", "m/s"),
    ("mi", "mph"), ("m", "cm/s"), ("m", "kn"),
)  # fmt: skip
"""Units of position and speed, the likeliest first."""
TOLERANCE = 0.04
"""Largest relative difference between a measured ratio and that of two units; km/h and ft/s differ by 9 %."""
SHORTEST_LAP = 50.0
"""Shortest lap [m]; smaller jumps are faults of positions."""
LEAST_SEAMS = 3
"""Smallest number of equal jumps that shows that positions are those of a ring."""
LAP_TOLERANCE = 0.02
"""Largest relative difference between the jumps of a ring, because of noise and speeds that change in a step."""
_RATE_TOLERANCE = 0.015  # largest relative difference between a measured and a usual frame rate
_MAX_RATIO_SPREAD = 0.25  # largest interquartile range of the ratios of pieces, relative to their median
_PIECE_ROWS = 10  # rows over which a step is taken, beyond most of the noise and rounding of positions
_MIN_PIECES = 8  # pieces needed for an estimate
_MIN_OPPOSITE_SHARE = 0.05  # smallest share of pieces in the other direction if vehicles drive both ways
_MAX_SPEED_MPS = 50.0  # m/s; speeds of traffic above it are in ft/s
_MAX_ROW_TIME = 20.0  # s between rows; with a larger step the times are not in s
_FEET_OR_METRES = "m and m/s cannot be distinguished from ft and ft/s by names or sizes of vehicles; m are assumed"
_NO_MOTION = ("track_id", "frame", "time", "lane", "length", "width", "vehicle_class", "leader_id", "direction")


@dataclass(frozen=True)
class Motion:
    """Position and speed.

    Attributes:
        position: Column of positions.
        speed: Column of speeds.
        units: Units of position and speed.
        clock_unit: Unit of the times, or rate of the frames such as 25/s.
        ratio: Ratio of a step of position to speed x time, in the units of the table.
        doubt: Ambiguity of the units that names and values leave; empty for none.
        is_reversed: Positions fall while driving.
        is_negative: Speeds are negative.
        goes_both_ways: Some vehicles drive the other way.
    """

    position: FoundColumn
    speed: FoundColumn
    units: tuple[str, str]
    clock_unit: str
    ratio: float
    doubt: str = ""
    is_reversed: bool = False
    is_negative: bool = False
    goes_both_ways: bool = False


def motion_of(columns: Sequence[FoundColumn], clock: Clock) -> Motion | None:
    """The first position and speed that agree, the likeliest names first; None if no two columns agree."""
    pieces = Pieces(clock)
    if not pieces.time.size:
        return None
    used = {clock.track.name, clock.time_or_frame.name} | ({clock.frame.name} if clock.frame else set())
    numbers = [c for c in columns if c.kind == "numbers" and c.name not in used and not is_in_pixels(c.name)]
    for positions, speeds, is_named in _candidates(numbers):
        found = [
            motion
            for position in positions
            for speed in speeds
            if position is not speed
            and (is_named or pieces.go_together(position.values, speed.values))
            and (motion := _motion(position, speed, clock, pieces)) is not None
        ]
        if found:
            return found[0]
    return None


def with_size_units(motion: Motion, sizes: Sizes) -> Motion:
    """The motion with feet instead of metres, or metres instead of feet, if names, vehicle sizes or speeds require it.

    Steps alone do not distinguish m and m/s from ft and ft/s. If names and sizes disagree, the unit counts as doubtful.
    """
    if motion.units not in (("m", "m/s"), ("ft", "ft/s")):
        return motion
    by_name = unit_in(motion.position.name, "m") or (unit_in(motion.speed.name, "m/s") or "").partition("/")[0]
    by_size = sizes.unit
    if by_size is None and float(np.nanquantile(np.abs(motion.speed.values), 0.95)) > _MAX_SPEED_MPS:
        by_size = "ft"
    if by_name and by_size and by_name != by_size:
        return replace(motion, doubt=f"names say {by_name}, sizes of vehicles or speeds say {by_size}")
    unit = by_name or by_size
    if not unit:
        return replace(motion, doubt=_FEET_OR_METRES)
    return replace(motion, units=(unit, f"{unit}/s"))


def ring_of(motion: Motion, clock: Clock) -> float | None:
    """Length of one lap [m]; None unless all jumps of positions along tracks are jumps back by the same distance."""
    position, speed = motion.position.values, motion.speed.values
    pieces = Pieces(clock, 1, (position, speed))
    forward = (-1.0 if motion.is_reversed else 1.0) * pieces.steps(position)
    driven = np.abs(motion.ratio * pieces.means(speed) * pieces.time)
    missing = (driven - forward) * SI_FACTOR[motion.units[0]]
    jumps = missing[np.abs(missing) > SHORTEST_LAP]
    if jumps.size < LEAST_SEAMS:
        return None
    lap = float(np.median(jumps))
    return round(lap, 2) if lap > 0.0 and (np.abs(jumps - lap) < LAP_TOLERANCE * lap).all() else None


class Pieces:
    """All pieces of the tracks, each some rows long, and the time that each takes."""

    def __init__(self, clock: Clock, n_rows: int = _PIECE_ROWS, needed: Sequence[np.ndarray] = ()) -> None:
        """Pieces of at most `n_rows` rows of a vehicle, without rows in which a needed column is unknown."""
        vehicles, counted = clock.vehicles, clock.time_or_frame.values
        known = np.flatnonzero((vehicles >= 0) & np.isfinite([counted, *needed]).all(axis=0))
        self._order = known[np.lexsort((counted[known], vehicles[known]))]
        track = vehicles[self._order]
        self.length = min(n_rows, max(len(track) // max(np.unique(track).size, 1) - 1, 1))
        self._same = track[self.length :] == track[: -self.length]
        self.time = (counted[self._order][self.length :] - counted[self._order][: -self.length])[self._same]

    def steps(self, values: np.ndarray) -> np.ndarray:
        """Change of a column over each piece."""
        values = values[self._order]
        return (values[self.length :] - values[: -self.length])[self._same]

    def go_together(self, position: np.ndarray, speed: np.ndarray) -> bool:
        """True if steps of one column correlate with another one x time; needed if names do not show what they are."""
        step, expected = np.abs(self.steps(position)), np.abs(self.means(speed) * self.time)
        known = np.isfinite(step) & np.isfinite(expected)
        if known.sum() < _MIN_PIECES or min(np.std(step[known]), np.std(expected[known])) == 0.0:
            return False
        return bool(np.corrcoef(step[known], expected[known])[0, 1] > MIN_CORRELATION)

    def means(self, values: np.ndarray) -> np.ndarray:
        """Mean of a column over each piece, by the trapezoidal rule."""
        values = values[self._order]
        middle = 0.5 * (values[1:] + values[:-1])
        return np.convolve(middle, np.full(self.length, 1.0 / self.length), mode="valid")[self._same]


def _candidates(numbers: Sequence[FoundColumn]) -> Iterator[tuple[list[FoundColumn], list[FoundColumn], bool]]:
    """Positions and speeds to try, and whether both are known by name.

    If one is not, all columns are tried whose name is not that of another quantity.
    """
    positions, speeds = named(numbers, "position"), named(numbers, "speed")
    free = [c for c in numbers if not any(rank_of(c.name, other) is not None for other in _NO_MOTION)]
    yield positions, speeds, True
    if not (positions and speeds):
        yield positions or free, speeds or free, False


def _motion(position: FoundColumn, speed: FoundColumn, clock: Clock, pieces: Pieces) -> Motion | None:
    """The motion if the two columns belong together."""
    step, expected = pieces.steps(position.values), pieces.means(speed.values) * pieces.time
    known = np.isfinite(step) & np.isfinite(expected) & (expected != 0.0)
    step, expected = step[known], expected[known]
    if step.size < _MIN_PIECES:
        return None
    # Without slow pieces, in which noise dominates.
    moving = np.abs(expected) >= 0.3 * float(np.quantile(np.abs(expected), 0.9))
    ratios = step[moving] / expected[moving]
    size = np.abs(ratios)
    low, middle, high = np.quantile(size, (0.25, 0.5, 0.75))
    if ratios.size < _MIN_PIECES or middle <= 0.0 or high - low > _MAX_RATIO_SPREAD * middle:
        return None
    found = _units(float(middle), position, speed, clock)
    if found is None:
        return None
    forward = step[moving] > 0.0
    units, clock_unit, doubt = found
    return Motion(
        position,
        speed,
        units,
        clock_unit,
        doubt=doubt,
        ratio=float(middle),
        is_reversed=bool(np.mean(forward) < 0.5),
        is_negative=bool(np.mean(expected[moving] < 0.0) > 0.5),
        goes_both_ways=bool(_MIN_OPPOSITE_SHARE < np.mean(forward) < 1.0 - _MIN_OPPOSITE_SHARE),
    )


def _units(
    ratio: float, position: FoundColumn, speed: FoundColumn, clock: Clock
) -> tuple[tuple[str, str], str, str] | None:
    """The likeliest units of position, speed and clock that explain a ratio, and the remaining ambiguity."""
    of_position, of_speed = unit_in(position.name, "m"), unit_in(speed.name, "m/s")
    pairs = [pair for pair in UNITS_TOGETHER if of_position in (None, pair[0]) and of_speed in (None, pair[1])]
    for clock_unit, seconds in _clock_units(clock):
        for pair in pairs:
            if abs(ratio / (SI_FACTOR[pair[1]] / SI_FACTOR[pair[0]] * seconds) - 1.0) <= TOLERANCE:
                return pair, clock_unit, ""
    if clock.time_or_frame.kind == "moments" or not clock.time_or_frame.is_whole or (clock.time and clock.step != 1.0):
        return None
    found = []
    for pair in pairs:
        rate = SI_FACTOR[pair[1]] / SI_FACTOR[pair[0]] / ratio
        usual = min((*STANDARD_RATES, *NTSC_RATES), key=lambda known: abs(known / rate - 1.0))
        if abs(usual / rate - 1.0) <= _RATE_TOLERANCE:
            found.append((pair, f"{usual:.10g}/s"))
    if not found:
        return None
    others = [f"{unit} with {' and '.join(pair)}" for pair, unit in found[1:] if unit != found[0][1]]
    doubt = f"the rate of the frames follows from steps and speeds; it could also be {' or '.join(others)}"
    return *found[0], doubt if others else ""


def _clock_units(clock: Clock) -> list[tuple[str, float]]:
    """Possible units of the times, for which the step is that of a traffic recording, the likeliest first, in s."""
    if clock.time is None or clock.step <= 0.0:
        return []
    if clock.time.kind == "moments":
        return [("s", 1.0)]
    longest = {"s": _MAX_ROW_TIME}
    units = [
        unit
        for unit in ("s", "ms", "us", "ns")
        if 1.0 / PLAUSIBLE_RATES[1] <= clock.step * SI_FACTOR[unit] <= longest.get(unit, 1.0 / PLAUSIBLE_RATES[0])
    ]
    named_unit = unit_in(clock.time.name, "s")
    return [(unit, SI_FACTOR[unit]) for unit in sorted(units, key=lambda unit: unit != named_unit)]
