"""Proposed meaning of each column of an unknown table: by its name, confirmed by its values."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rearl_jax.data.checks.typed_table import MAX_LANES
from rearl_jax.data.checks.unit_checks import ACCELERATION_P99
from rearl_jax.data.schema import COLUMNS
from rearl_jax.data.survey.clock import Clock, clock_of, named
from rearl_jax.data.survey.motion import Motion, motion_of, ring_of, with_size_units
from rearl_jax.data.survey.sample import FoundColumn, Sample
from rearl_jax.data.survey.sizes import Sizes, sizes_of
from rearl_jax.data.tables.track_names import NO_LEADER
from rearl_jax.data.tables.usual_names import end_in, is_in_pixels, is_on_globe, per_vehicle, unit_in
from rearl_jax.data.units import SI_FACTOR
from rearl_jax.data.vehicle_classes import CLASSES, class_of, code_of

_CANONICAL = tuple(column.name for column in COLUMNS)
_SI = ("m", "m/s", "m/s^2")
_MIN_LEADERS_PRESENT = 0.5  # share of the stated leaders that must be vehicles of the table


@dataclass(frozen=True)
class Taken:
    """A column that is taken for a canonical one: its name in the file, its entry in `data.units` or None, and why."""

    source: str
    unit: str | None
    why: str


@dataclass
class Proposal:
    """Proposed interpretation of a table.

    Attributes:
        taken: Columns by canonical name.
        refused: Reasons for leaving out columns that have a suitable name, by name in the file.
        missing: Reasons why the table cannot be read as it is, by canonical column: it was not found, or is not usable.
        doubts: Properties that the table does not determine.
        ring: Length of one lap of a ring road whose positions begin anew with every lap [m]; None for other roads.
    """

    taken: dict[str, Taken] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)
    doubts: list[str] = field(default_factory=list)
    ring: float | None = None

    def take(self, canonical: str, column: FoundColumn, why: str, unit: str | None = None) -> None:
        """Takes a column for a canonical one; the SI unit of a length, speed or acceleration needs no entry."""
        self.taken[canonical] = Taken(column.name, None if unit in _SI else unit, why)

    @property
    def sources(self) -> set[str]:
        """Names in the file of the columns that are taken."""
        return {taken.source for taken in self.taken.values()}

    def columns(self, present: Sequence[str]) -> dict[str, str | None]:
        """The value of `data.columns`: names that differ, and null for canonical names with another meaning."""
        foreign = {name: taken.source for name, taken in self.taken.items() if taken.source != name}
        free = set(present) - self.sources
        others = [name for name in _CANONICAL if name in free and name not in self.taken]
        return foreign | dict.fromkeys(others)

    @property
    def units(self) -> dict[str, str]:
        """The value of `data.units`."""
        return {name: taken.unit for name, taken in self.taken.items() if taken.unit is not None}

    def leave_out(self, canonical: str, why: str) -> None:
        """Removes the proposed meaning of a column, with the reason."""
        self.refused[self.taken.pop(canonical).source] = why


def proposal_of(sample: Sample) -> Proposal:
    """The proposed interpretation of the columns of a sample."""
    proposal = Proposal()
    clock = clock_of(sample.columns)
    motion = None if clock is None else motion_of(sample.columns, clock)
    if clock is None or (motion is None and not clock.by_name):
        looked_for = (
            "one column must identify the vehicle, and another one, time or frame, must rise by even steps from row to "
            "row of a vehicle (rows in the order of time); no two columns do"
        )
        if wide := per_vehicle([column.name for column in sample.columns]):
            looked_for += f"; {', '.join(wide[:4])} look like columns of single vehicles: give each its own rows"
        proposal.missing = {"track_id": looked_for, "time": looked_for}
        return proposal
    _take_clock(proposal, clock)
    sizes = sizes_of(sample.columns)
    if motion is None:
        _take_by_name(proposal, sample.columns)
    else:
        motion = with_size_units(motion, sizes)
        proposal.ring = ring_of(motion, clock)
        _take_motion(proposal, clock, motion)
    _take_sizes(proposal, sizes)
    for canonical, take_if_usable in _OTHERS.items():
        used = proposal.sources
        for column in named([column for column in sample.columns if column.name not in used], canonical):
            refusal = take_if_usable(proposal, column, clock, motion)
            if refusal is None:
                break
            proposal.refused.setdefault(column.name, refusal)
    return proposal


def _take_clock(proposal: Proposal, clock: Clock) -> None:
    """Takes the columns of vehicles, recordings, times and frames."""
    n_vehicles = len(np.unique(clock.vehicles))
    per_track = len(clock.vehicles) / n_vehicles
    reason = "name" if clock.by_name else "values alone: along its rows a clock rises"
    kind = "words" if clock.track.kind == "words" else "numbers"
    proposal.take("track_id", clock.track, f"{reason}; {n_vehicles} {kind}, {per_track:.0f} rows each")
    if clock.recording is not None:
        proposal.take("recording", clock.recording, "name; ids restart in each")
    if clock.time is not None:
        is_moment = clock.time.kind == "moments"
        what = "dates and times of day" if is_moment else f"rises by {clock.step:.4g} along tracks"
        proposal.take("time", clock.time, f"{reason}; {what}")
    if clock.frame is not None:
        proposal.take("frame", clock.frame, f"{reason}; whole numbers that rise along tracks")


def _take_motion(proposal: Proposal, clock: Clock, motion: Motion) -> None:
    """Position and speed with their units, and the unit of the clock."""
    of_position, of_speed = motion.units
    ratio = f"steps of {motion.position.name} are {motion.ratio:.4g} times "
    ratio += f"{motion.speed.name} x {clock.time_or_frame.name}"
    named_units = unit_in(motion.position.name, "m") or unit_in(motion.speed.name, "m/s")
    source = "names" if named_units else "sizes of vehicles or speeds" if of_position == "ft" else "steps"
    explained = f"{ratio}: {of_position}, {of_speed}" + (" (not certain)" if motion.doubt else "")
    why = f"{explained}; units by {source}"
    end = end_in(motion.position.name)
    of_vehicle = f"; of the {end}, as the name says" if end else "; taken for that of the centre"
    if proposal.ring is not None:
        of_vehicle += f"; begins anew every {proposal.ring:g} m, as on a ring"
    sign = "-" if motion.is_reversed else ""
    proposal.take(end or "position", motion.position, why + of_vehicle, f"{sign}{of_position}")
    proposal.take("speed", motion.speed, why, f"{'-' if motion.is_negative else ''}{of_speed}")
    if motion.doubt:
        proposal.doubts.append(motion.doubt)
    if motion.goes_both_ways and proposal.ring is None:
        proposal.missing["position"] = (
            f"{motion.position.name} rises for some vehicles and falls for others: give each driving direction in a "
            "table of its own, in which it rises while driving (-m reverses it)"
        )
    by_frame = clock.time is None
    unit = None if motion.clock_unit == "s" or clock.time_or_frame.kind == "moments" else motion.clock_unit
    # A step of 1 may also be that of frames, so seconds are stated.
    unit = "s" if unit is None and not by_frame and clock.step == 1.0 else unit
    if unit is not None:
        name = "frame" if by_frame else "time"
        why = f"{proposal.taken[name].why}; {unit} makes steps agree with speeds"
        proposal.take(name, clock.time_or_frame, why, unit)


def _take_by_name(proposal: Proposal, columns: Sequence[FoundColumn]) -> None:
    """Position and speed by their names, where no two columns agree."""
    for canonical, kind in (("position", "m"), ("speed", "m/s")):
        used = proposal.sources
        free = [column for column in columns if column.name not in used and not is_in_pixels(column.name)]
        numbers = [column for column in free if column.kind == "numbers"]
        candidates = named(numbers, canonical)
        if not candidates:
            proposal.missing[canonical] = (
                "no column has such a name, and none changes as position and speed do together"
            )
            if wordy := named([column for column in free if column.kind == "words"], canonical):
                example = wordy[0].texts.dropna().iloc[0]
                proposal.missing[canonical] = f"the column {wordy[0].name} holds no numbers, such as {example!r}"
            if globe := [column.name for column in columns if is_on_globe(column.name)]:
                proposal.missing[canonical] += f"; project {', '.join(globe)} onto the road, in m along and across it"
            continue
        why = "name only: no column of positions changes by speed x time"
        proposal.take(canonical, candidates[0], why, unit_in(candidates[0].name, kind))
    if not proposal.missing:
        names = [proposal.taken[canonical].source for canonical in ("position", "speed")]
        proposal.doubts.append(f"{names[0]} does not change by {names[1]} x time: units, axis or columns may be wrong")
    if "time" not in proposal.taken and "frame" in proposal.taken:
        proposal.missing["time"] = "the table has frames of unknown rate: state it, such as 'data.units={frame: 25/s}'"


def _take_sizes(proposal: Proposal, sizes: Sizes) -> None:
    """Takes the columns of lengths and widths that have no other meaning yet."""
    used = proposal.sources
    proposal.refused.update(sizes.refused)
    for canonical, size in sizes.taken.items():
        if size.column.name not in used:
            proposal.take(canonical, size.column, size.why, size.unit)
            if canonical == "length" and size.column.name.casefold() == "width" and "position" in proposal.taken:
                position = proposal.taken["position"].source
                otherwise = f"if it is the corner, as in highD, 'data.columns={{rear: {position}}}'"
                proposal.doubts.append(f"{position} is taken for the centre of the box; {otherwise}")


def _take_acceleration(proposal: Proposal, column: FoundColumn, clock: Clock, motion: Motion | None) -> str | None:
    if column.kind != "numbers":
        return "holds no numbers"
    unit = unit_in(column.name, "m/s^2")
    if unit is None and motion is not None and motion.units[1] in ("ft/s", "mph") and motion.units[0] == "ft":
        unit = "ft/s^2"
    unit = unit or "m/s^2"
    if float(np.nanquantile(np.abs(column.values), 0.99)) * SI_FACTOR[unit] > ACCELERATION_P99:
        return f"1 % of the values are above {ACCELERATION_P99:g} m/s^2 if it is in {unit}"
    unit = f"-{unit}" if motion is not None and motion.is_negative else unit
    proposal.take("acceleration", column, f"name; taken to be in {unit}", unit)
    return None


def _take_lateral(proposal: Proposal, column: FoundColumn, clock: Clock, motion: Motion | None) -> str | None:
    if column.kind != "numbers":
        return "holds no numbers"
    if is_in_pixels(column.name):
        return "is in pixels, as the name says"
    stated = unit_in(column.name, "m")
    unit = stated or (motion.units[0] if motion is not None else "m")
    why = "name" if stated else "name; in the unit of the position"
    proposal.take("lateral", column, why, unit)
    return None


def _take_lane(proposal: Proposal, column: FoundColumn, clock: Clock, motion: Motion | None) -> str | None:
    numbers = column.values[np.isfinite(column.values)]
    if not column.is_whole or not numbers.size:
        return "holds no whole numbers"
    low, high = int(numbers.min()), int(numbers.max())
    if low < 0 or high - low >= MAX_LANES or high >= 100:
        return f"the numbers {low} to {high} are not lanes of one carriageway"
    unit = f"from {low}" if low else None
    proposal.take("lane", column, f"name; numbers {low} to {high}, taken to count from the left", unit)
    return None


def _take_vehicle_class(proposal: Proposal, column: FoundColumn, clock: Clock, motion: Motion | None) -> str | None:
    words = column.texts.dropna().unique()
    unknown = [word for word in words if class_of(word) not in CLASSES]
    if unknown:
        stated = ", ".join(f"{code_of(word)}: {CLASSES[0]}" for word in unknown[:3])
        examples, known = ", ".join(map(str, unknown[:3])), ", ".join(CLASSES)
        remedy = f"'data.columns={{vehicle_class: {column.name}}}' 'data.classes={{{stated}}}'"
        return f"{examples} is no class that is known ({known}): say what it is with {remedy}"
    proposal.take("vehicle_class", column, f"name; {', '.join(map(str, words[:4]))}")
    return None


def _take_leader_id(proposal: Proposal, column: FoundColumn, clock: Clock, motion: Motion | None) -> str | None:
    leaders, vehicles = (ids.texts.dropna().str.replace(r"\.0*$", "", regex=True) for ids in (column, clock.track))
    known = set(vehicles.unique())
    stated = leaders[~leaders.str.lower().isin(NO_LEADER) | leaders.isin(known)]
    if not len(stated):
        return "names no vehicle"
    share = float(stated.isin(known).mean())
    if share < _MIN_LEADERS_PRESENT:
        return f"only {share:.0%} of its numbers are vehicles of the table"
    proposal.take("leader_id", column, f"name; {share:.0%} are vehicles of the table")
    return None


def _take_direction(proposal: Proposal, column: FoundColumn, clock: Clock, motion: Motion | None) -> str | None:
    numbers = np.unique(column.values[np.isfinite(column.values)])
    if column.kind != "numbers" or not set(numbers) <= {1.0, 2.0}:
        words = column.texts.dropna().unique()
        fault = f"the carriageways are 1 and 2, not {', '.join(map(str, words[:3]))}"
        if len(words) == 2:  # read as one road, vehicles of both directions would overlap
            proposal.missing["direction"] = (
                f"{fault}: write 1 and 2 there, or read each direction as a table of its own"
            )
        return fault
    proposal.take("direction", column, f"name; {', '.join(f'{number:g}' for number in numbers)}")
    return None


def _take_recording(proposal: Proposal, column: FoundColumn, clock: Clock, motion: Motion | None) -> str | None:
    if "recording" in proposal.taken or column.name != "recording":
        return "ids and times show one recording only"
    proposal.take("recording", column, "name")
    return None


_OTHERS: dict[str, Callable[[Proposal, FoundColumn, Clock, Motion | None], str | None]] = {
    "acceleration": _take_acceleration,
    "lateral": _take_lateral,
    "lane": _take_lane,
    "vehicle_class": _take_vehicle_class,
    "leader_id": _take_leader_id,
    "direction": _take_direction,
    "recording": _take_recording,
}
"""Functions that take a column with the name of a canonical one if its values are usable; else they return why not."""
