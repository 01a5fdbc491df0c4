"""Reader of OpenACC, platoons of cars with adaptive cruise control on the test track ZalaZone: speeds and gaps.

Positions are reconstructed on a straight single lane: the first vehicle moves by its integrated speed, every other one
is gap + length behind the vehicle ahead, so bumper-to-bumper gaps are exactly those of the source. Where the source
lacks a vehicle or all of its gaps, the platoon is divided into parts, each a separate recording.

Source: European Commission, Joint Research Centre, Open ACC Database, DOI 10.2905/JRC.KMH3D00; Makridis et
al., Transportation Research Part C 125 (2021) 103047.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks import typed_table
from rearl_jax.data.checks.frame_rates import phase_of
from rearl_jax.data.checks.losses import Losses, stop_or_count
from rearl_jax.data.checks.motion_checks import MAX_BACKWARD
from rearl_jax.data.checks.unit_checks import require_period
from rearl_jax.data.files.columnar import column_names, read_columns
from rearl_jax.data.files.folder import only_parquet
from rearl_jax.data.formats.openacc_labels import INDEX_FILE, labels_of_run, switched
from rearl_jax.data.formats.openacc_pairs import checked_pairs, on_breaks
from rearl_jax.data.problems import Finding, bad_recording, source_row
from rearl_jax.data.schema import Recording, RecordingInfo, validate

FRAME_RATE = 10.0
LICENCE = "CC BY 4.0"
ATTRIBUTION = "European Commission, Joint Research Centre, Open ACC Database, https://doi.org/10.2905/JRC.KMH3D00"
MAX_HOLE = 10  # frames, 1 s; a gap or speed that is missing for at most this time is interpolated
MAX_GAP = 1000.0  # m; the widest gap of the data set is 230 m
MAX_TIME = 86_400.0  # s; largest difference of a time from the median time of a run
_NUMBERS = ("t_s", "pos", "speed_mps", "gap_to_follower_m")
COLUMNS = ("file", *_NUMBERS)
"""Columns by which a file is recognised."""
MODEL = "model"
"""Label of tracks: the car model. A model is one physical car, which drove in many files."""
_MAX_PLACES = 1000  # vehicles; no platoon has as many

find_platoons = partial(
    only_parquet, wanted=f"the folder with the one file of OpenACC platoons, columns {', '.join(COLUMNS)}"
)
"""The Parquet file of platoons in the folder; MissingInputError if there is none, or more than one."""


@dataclass(frozen=True)
class Platoon:
    """An unbroken part of the vehicles of one file.

    Attributes:
        file: Name of the run in the table.
        first: Number of its first vehicle in the file; 1 leads all others.
        last: Number of its last vehicle.
        unlinked: Numbers of vehicles of the file that belong to no part; listed with the first part only.
        notes: Notes on vehicles and gaps that the file lacks.
    """

    file: str
    first: int
    last: int
    unlinked: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()


def platoon_recordings(path: Path) -> dict[str, Platoon]:
    """Recording id -> part of a platoon with two vehicles or more.

    Raises:
        BadRecordingError: A row does not state its vehicle and run, or a run has no two linked vehicles.
    """
    rows = read_columns(path, _NUMBERS, ("file",))
    place = rows["pos"].to_numpy(np.float64)
    wrong = rows["file"].isna().to_numpy() | ~((place >= 1.0) & (place < _MAX_PLACES) & (place == np.rint(place)))
    if wrong.any():
        text, row = "a row does not state its vehicle and file", int(np.argmax(wrong)) + 1
        raise bad_recording("vehicle-unnamed", text, "complete it", path, column="pos", row=row)
    has_gap = rows.groupby(["file", "pos"], observed=True)["gap_to_follower_m"].count() > 0
    recordings: dict[str, Platoon] = {}
    for file in has_gap.index.unique("file"):
        linked = has_gap.loc[file].rename(index=int)
        platoons = platoons_of(f"openacc_{file}", str(file), linked.index.tolist(), linked.index[linked].tolist())
        if not platoons:
            text, row = f"no vehicle of {file} has a gap to a neighbour", int(np.argmax(rows["file"] == file)) + 1
            remedy = "complete the gaps, or remove the rows of this run"
            raise bad_recording("unlinked", text, remedy, path, column="gap_to_follower_m", row=row)
        recordings |= platoons
    return recordings


def platoons_of(
    recording: str, file: str, vehicles: Sequence[int], gaps: Collection[int], models: Sequence[str] = ()
) -> dict[str, Platoon]:
    """Recording id -> part with two vehicles or more of a run; empty if no gap between neighbours is recorded.

    `recording` is the id of a run of one part. `vehicles` holds the numbers of those that are recorded, ascending,
    `gaps` those of vehicles whose gap behind is recorded, and `models` the models of all from number 1 on.
    """
    chains: list[list[int]] = []
    for number in vehicles:
        if chains and chains[-1][-1] == number - 1 and number - 1 in gaps:
            chains[-1].append(number)
        else:
            chains.append([number])
    unlinked = tuple(chain[0] for chain in chains if len(chain) == 1)
    chains = [chain for chain in chains if len(chain) > 1]
    notes = on_breaks(vehicles, gaps, models)
    platoons = {}
    for chain in chains:
        part = f"_{chain[0]}to{chain[-1]}" if len(chains) > 1 else ""
        platoons[f"{recording}{part}"] = Platoon(file, chain[0], chain[-1], unlinked, notes)
        unlinked = ()
    return platoons


def read_platoon(path: Path, recording: str, platoon: Platoon, policy: DataConfig) -> Recording:
    """One part of a platoon.

    Left out and counted unless data.on_bad is stop: vehicles without a gap to a neighbour (`unlinked`),
    impossible values (`negative_gap`, `far_gap`, `out_of_range`, `bad_time`, `duplicate`), and rows whose
    speed or a gap ahead stays unknown for over 1 s (`no_gap`).

    Raises:
        BadRecordingError: One of these occurs and data.on_bad is stop, or a row breaks the schema.
    """
    models = (MODEL,) if MODEL in column_names(path) else ()
    rows = read_columns(path, _NUMBERS, models, only=("file", platoon.file))
    rows["t_s"] = on_frames(rows["t_s"].to_numpy(np.float64))
    runs = labels_of_run(path.parent / INDEX_FILE, platoon.file)
    info = RecordingInfo(
        id=recording,
        frame_rate=FRAME_RATE,
        lane_count={1: 1},
        road_length=0.0,
        source="OpenACC, ZalaZone platoons",
        licence=LICENCE,
        attribution=ATTRIBUTION,
        labels=(*models, *runs),
        notes=(
            "proving ground, single file, adaptive cruise control or human drivers; the road is straightened",
            f"positions rebuilt from speeds and gaps, vehicle length {policy.default_length:g} m assumed",
        ),
        file=f"{path} ({platoon.file})",
        columns={
            "track_id": "pos",
            "frame": "t_s",
            "speed": "speed_mps",
            "position": "gap_to_follower_m",
            "x": "gap_to_follower_m",
        },
    )
    of_place = {MODEL: _models(rows, info.file)} if models else {}
    return rebuilt(rows, platoon, info, of_place | runs, policy)


def rebuilt(
    rows: pd.DataFrame,
    platoon: Platoon,
    info: RecordingInfo,
    labels: Mapping[str, Mapping[int, str | None] | str | None],
    policy: DataConfig,
    switches: pd.Series | None = None,
    losses: Losses | None = None,
) -> Recording:
    """The recording with positions rebuilt from speeds and gaps.

    Args:
        rows: t_s, pos, speed_mps and gap_to_follower_m; those of a vehicle in the order of time.
        platoon: The part of them.
        info: The recording, without the length of its road.
        labels: Labels by name: one value for all vehicles, or one for each number in the platoon.
        policy: Treatment of bad rows.
        switches: Driver by number in the platoon and frame, if drivers switch; see `switched`.
        losses: Rows that are already left out.

    Raises:
        BadRecordingError: As in `read_platoon`.
    """
    losses = Losses() if losses is None else losses
    columns = info.columns
    require_period(
        rows["t_s"].to_numpy(np.float64), rows["pos"].to_numpy(), 1.0 / FRAME_RATE, info.file, columns["frame"]
    )
    rows = _plausible(rows, platoon, info, policy, losses)
    table, placed, n_filled, of_pairs = _placed(rows, platoon, policy.default_length, info)
    for name, value in labels.items():
        table[name] = [value[place] for place in table["track_id"]] if isinstance(value, Mapping) else value
    text = "gap or speed unknown for over 1 s"
    _leave_out(~placed, table, "no_gap", "position", text, info, policy, losses)
    table = table.iloc[np.flatnonzero(placed)]
    if table.empty:
        text, remedy = "no vehicle has a known place", "complete speeds and gaps"
        raise bad_recording("place-unknown", text, remedy, info.file, column=columns["track_id"])
    if switches is not None:
        table, info = switched(table, switches, info)
    backward = table["speed"].to_numpy() < 0.0
    note = f"{n_filled} speeds and gaps in holes of 1 s or less interpolated, "
    note += f"{int(backward.sum())} negative speeds set to 0"
    table = table.assign(speed=np.where(backward, 0.0, table["speed"]))
    road_length = float(np.max(table["position"].to_numpy() + 0.5 * table["length"].to_numpy()))
    info = replace(info, notes=(*info.notes, *platoon.notes, *of_pairs, note), road_length=road_length)
    return Recording(info, *validate(table, info, policy, losses))


def on_frames(time: np.ndarray) -> np.ndarray:
    """The times of a run [s], shifted by half a frame at most, so that they are multiples of the frame interval."""
    return time - phase_of(time * FRAME_RATE) / FRAME_RATE


def fill_holes(values: np.ndarray) -> np.ndarray:
    """The columns, in which up to MAX_HOLE missing frames are interpolated; longer holes and the ends stay NaN."""
    filled = values.copy()
    for column in filled.T:
        known = np.flatnonzero(~np.isnan(column))
        if not known.size:
            continue
        rows, steps = np.arange(known[0], known[-1]), np.diff(known)
        rows = rows[np.repeat(steps <= MAX_HOLE + 1, steps) & np.isnan(column[rows])]
        column[rows] = np.interp(rows, known, column[known])
    return filled


def _plausible(
    rows: pd.DataFrame, platoon: Platoon, info: RecordingInfo, policy: DataConfig, losses: Losses
) -> pd.DataFrame:
    """The platoon's rows with frame numbers, in which impossible speeds and gaps are set to NaN."""
    place, time = rows["pos"].to_numpy(np.float64), rows["t_s"].to_numpy(dtype=np.float64)
    unlinked = np.isin(place, platoon.unlinked)
    text = f"vehicle {', '.join(map(str, platoon.unlinked))} has no gap to a neighbour"
    _leave_out(unlinked, rows, "unlinked", "track_id", text, info, policy, losses)
    inside = (place >= platoon.first) & (place <= platoon.last)
    finite = np.isfinite(time)
    usual = np.median(time[finite]) if finite.any() else np.nan
    lost = inside & ~(finite & (np.abs(time - usual) <= MAX_TIME))
    _leave_out(lost, rows, "bad_time", "frame", "the time is unknown or a day off", info, policy, losses)
    rows = rows.iloc[np.flatnonzero(inside & ~lost)]
    if rows.empty:
        text, column = "no row states its time", info.columns["frame"]
        raise bad_recording("time-unknown", text, "complete the times", info.file, column=column)
    frame = np.rint(rows["t_s"].to_numpy(dtype=np.float64) * FRAME_RATE).astype(np.int64)
    rows = rows.assign(frame=frame)
    twice = rows.duplicated(["pos", "frame"]).to_numpy()
    _leave_out(twice, rows, "duplicate", "frame", "a vehicle occurs twice in a frame", info, policy, losses)
    rows = rows.iloc[np.flatnonzero(~twice)]

    speed = rows["speed_mps"].to_numpy(dtype=np.float64, copy=True)
    gap = rows["gap_to_follower_m"].to_numpy(dtype=np.float64, copy=True)
    # The gap behind the last vehicle is that to a vehicle outside of the platoon.
    gap[rows["pos"].to_numpy(np.float64) == platoon.last] = np.nan
    wrong = (speed < -MAX_BACKWARD) | (speed > typed_table.RANGES["speed"][1])
    _leave_out(wrong, rows, "out_of_range", "speed", "no vehicle has this speed", info, policy, losses)
    negative, far = gap < 0.0, gap > MAX_GAP
    _leave_out(negative, rows, "negative_gap", "position", "the gap is negative", info, policy, losses)
    _leave_out(far, rows, "far_gap", "position", f"the gap is above {MAX_GAP:g} m", info, policy, losses)
    return rows.assign(
        speed_mps=np.where(wrong, np.nan, speed), gap_to_follower_m=np.where(negative | far, np.nan, gap)
    )


def _placed(
    rows: pd.DataFrame, platoon: Platoon, length: float, info: RecordingInfo
) -> tuple[pd.DataFrame, np.ndarray, int, tuple[str, ...]]:
    """Table of all vehicles in all frames, mask of rows with a known position, number of filled values, and notes."""
    frame, place = rows["frame"].to_numpy(), rows["pos"].to_numpy(np.float64).astype(np.int64)
    frames = np.arange(frame.min(), frame.max() + 1)
    places = np.arange(platoon.first, platoon.last + 1)

    def grid(values: np.ndarray) -> np.ndarray:
        """The values of the rows, by frame and vehicle; NaN where a row is missing."""
        wide = np.full((frames.size, places.size), np.nan)
        wide[frame - frames[0], place - places[0]] = values
        return wide

    measured = grid(rows["speed_mps"].to_numpy(dtype=np.float64))
    gaps = grid(rows["gap_to_follower_m"].to_numpy(dtype=np.float64))[:, :-1]
    notes = checked_pairs(gaps, measured, places.tolist(), FRAME_RATE, info)
    speed, ahead = fill_holes(measured), fill_holes(gaps)
    n_filled = int((~np.isnan(speed)).sum() - (~np.isnan(measured)).sum())
    n_filled += int((~np.isnan(ahead)).sum() - (~np.isnan(gaps)).sum())
    of_first = np.nan_to_num(speed[:, 0])
    position = np.zeros_like(speed)
    position[1:, 0] = np.cumsum(0.5 * (of_first[1:] + of_first[:-1])) / FRAME_RATE
    position[:, 1:] = position[:, :1] - np.cumsum(ahead + length, axis=1)
    placed = ~np.isnan(speed) & ~np.isnan(position)
    # A vehicle has no position if a vehicle ahead of it has none.
    placed = np.logical_and.accumulate(placed, axis=1)
    position += 0.5 * length - np.min(position, where=placed, initial=np.inf)
    # A frame that the source lacks gets the row number of the frame before it, for error messages.
    source_row = pd.Series(grid(rows.index.to_numpy(dtype=np.float64)).ravel("F")).ffill().bfill()
    table = pd.DataFrame(
        {
            "track_id": np.repeat(places, frames.size),
            "frame": np.tile(frames, places.size),
            "direction": 1,
            "x": position.ravel("F"),
            "y": 0.0,
            "position": position.ravel("F"),
            "lane": 0,
            "speed": speed.ravel("F"),
            "length": length,
            "vehicle_class": "car",
            "leader_id": np.repeat(np.where(places > platoon.first, places - 1.0, np.nan), frames.size),
        },
        index=source_row.to_numpy().astype(np.int64),
    )
    return table, placed.ravel("F"), n_filled, notes


def _leave_out(
    bad: np.ndarray,
    rows: pd.DataFrame,
    name: str,
    column: str,
    message: str,
    info: RecordingInfo,
    policy: DataConfig,
    losses: Losses,
) -> None:
    """Count the marked rows, or stop at the first."""
    stop_or_count(rows, Finding(name, column, bad, message, "complete the source"), info, policy, losses)


def _models(rows: pd.DataFrame, file: str) -> dict[int, str | None]:
    """Car model of each place in the platoon."""
    models = rows.drop_duplicates(["pos", MODEL])
    twice = models.duplicated("pos").to_numpy()
    if twice.any():
        text = f"vehicle {models['pos'].iloc[int(np.argmax(twice))]:g} has several car models"
        row = source_row(models, twice)
        raise bad_recording("models-contradict", text, "correct the models", file, column=MODEL, row=row)
    return {int(place): model for place, model in zip(models["pos"], models[MODEL], strict=True)}
