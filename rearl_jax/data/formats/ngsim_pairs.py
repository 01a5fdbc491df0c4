"""Reader of NGSIM I-80 leader-follower pairs, with and without lateral positions: a row holds both at one time.

A recording is the union of the members of its pairs. A vehicle that is in several pairs appears once per
frame; a vehicle that leaves the pairs and returns later gets a new id.

The table with lateral positions, widths and classes is raw NGSIM in SI units, one recording from 4:00 to 4:15 pm. Only
its followers have a lateral position; a vehicle that is only a leader has none.

Source: NGSIM I-80, DOI 10.21949/1504477; without lateral positions reconstructed trajectories, arXiv 2201.04755.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.losses import Losses, reject, split_tracks
from rearl_jax.data.checks.stray_rows import require_own_runs
from rearl_jax.data.checks.unit_checks import MEDIAN_SIZE, require_period
from rearl_jax.data.files.columnar import column_names, read_columns
from rearl_jax.data.files.folder import only_parquet
from rearl_jax.data.formats.ngsim import ATTRIBUTION, CLASSES, FRAME_RATE, LANES, LICENCE
from rearl_jax.data.problems import Finding, bad_recording, require_columns, source_row
from rearl_jax.data.schema import Recording, RecordingInfo, validate
from rearl_jax.data.vehicle_rows import follows_row_before

TRUCK_LENGTH = 7.0  # m; the lengths of I-80 leaders have a gap between 6.8 m (cars) and 7.7 m
_NUMBERS = "follower leader t_s y_f_m v_f_mps a_f_mps2 y_l_m v_l_mps a_l_mps2 leader_length_m lane".split()
COLUMNS = ("run", *_NUMBERS)
"""Columns by which a file is recognised."""
LATERAL_RECORDING = "i80_0400"

_OF_BOTH = "follower leader frame lane".split()
_OF_FOLLOWER = "x_f_m y_f_m v_f_mps a_f_mps2 length_f_m width_f_m class_f".split()
_OF_LEADER = "y_l_m v_l_mps a_l_mps2 leader_length_m leader_width_m class_l".split()
LATERAL_COLUMNS = (*_OF_BOTH, *_OF_FOLLOWER, *_OF_LEADER)
"""Columns by which a file is recognised, all of numbers."""
_WANTED = "the folder with the one file of leader-follower pairs, columns "
_I80 = partial(
    RecordingInfo,
    frame_rate=FRAME_RATE,
    lane_count={1: LANES["i80"]},
    road_length=0.0,
    licence=LICENCE,
    attribution=ATTRIBUTION,
)
find_pairs = partial(only_parquet, wanted=_WANTED + ", ".join(COLUMNS))
"""The Parquet file of pairs in the folder; MissingInputError if there is none, or more than one."""
find_lateral = partial(only_parquet, wanted=_WANTED + ", ".join(LATERAL_COLUMNS))
"""The same for pairs with lateral positions."""
_MAX_ID = 1e12
_MAX_TIME = 1e7  # s, more than any recording lasts
_SHARED_TOLERANCE = 0.01  # m; largest difference of a vehicle's position or length between its pairs


def pairs_recordings(path: Path) -> dict[str, str]:
    """Recording id -> run of the table, such as i80_0400 -> 0400pm-0415pm."""
    recordings: dict[str, str] = {}
    for run in runs_of(path, "run", "follower", COLUMNS):
        name = f"i80_{run[:4]}"
        if name in recordings:
            text = f"the runs {recordings[name]} and {run} would both be {name}"
            raise bad_recording("run-twice", text, "give each run another start time", path, column="run")
        recordings[name] = run
    return recordings


def runs_of(path: Path, column: str, vehicle: str, columns: Sequence[str]) -> list[str]:
    """Runs of a table of pairs, by name.

    `column` is that of the runs, `vehicle` that of numbers of vehicles or pairs; the table must have all `columns`.

    Raises:
        BadRecordingError: A column is missing, a row has no run or seems to have that of others, or there are no rows.
    """
    require_columns(column_names(path), columns, path)
    runs = read_columns(path, (), (column,))[column]
    unnamed = runs.isna().to_numpy()
    if unnamed.any() or runs.empty:
        text, row = ("the table has no rows", None) if runs.empty else ("a row has no run", source_row(runs, unnamed))
        raise bad_recording("run-unnamed", text, "complete the file", path, column=column, row=row)
    names = runs.unique().tolist()
    if len(names) > 1:
        vehicles = read_columns(path, (vehicle,))[vehicle].to_numpy(np.float64, na_value=np.nan)
        require_own_runs(runs.to_numpy(object), vehicles, path, column)
    return sorted(names)


def read_pairs(path: Path, recording: str, run: str, policy: DataConfig) -> Recording:
    """The vehicles of one run; gaps to the leader are those of the source.

    The source states the position y of the front, so the centre is at y - length / 2. A follower that is not a leader
    has no length in the source and gets data.default_length; the bumper-to-bumper gap does not depend on it.
    """
    pairs = read_columns(path, _NUMBERS, only=("run", run))
    info = _I80(
        id=recording,
        source="NGSIM I-80, leader-follower pairs, reconstructed",
        notes=(
            "members of leader-follower pairs only, congested traffic: not every vehicle of a lane",
            "no lateral position: y is 0 for all; lane known for a third of the pairs",
            f"length known for leaders, {policy.default_length:g} m assumed for the others; "
            f"truck = longer than {TRUCK_LENGTH:g} m",
        ),
        file=f"{path} ({run})",
        columns={"track_id": "follower", "frame": "t_s", "time": "t_s", "leader_id": "leader"}
        | {"position": "y_f_m", "x": "y_f_m", "speed": "v_f_mps", "acceleration": "a_f_mps2"}
        | {"length": "leader_length_m"},
    )
    return joined_pairs(pairs, info, policy)


def lateral_recordings(path: Path) -> dict[str, None]:
    """The one recording of the table."""
    require_columns(column_names(path), LATERAL_COLUMNS, path)
    return {LATERAL_RECORDING: None}


def read_lateral(path: Path, recording: str, part: None, policy: DataConfig) -> Recording:
    """The vehicles of all pairs; gaps to the leader are those of the source.

    The source states the position y of the front, so the centre is at y - length / 2.
    """
    rows = read_columns(path, LATERAL_COLUMNS)
    info = _I80(
        id=recording,
        source="NGSIM I-80, leader-follower pairs with lateral positions",
        notes=(
            "members of leader-follower pairs only, chosen for following in one lane for long: not every vehicle of a "
            "lane, no lane changes",
            "lateral position known for followers only",
            "accelerations are clipped at 3.41 m/s^2 in the source",
        ),
        file=str(path),
        columns={"track_id": "follower", "frame": "frame", "time": "frame", "leader_id": "leader", "y": "x_f_m"}
        | {"position": "y_f_m", "x": "y_f_m", "lateral": "x_f_m", "speed": "v_f_mps", "acceleration": "a_f_mps2"}
        | {"length": "length_f_m", "width": "width_f_m", "vehicle_class": "class_f"},
    )
    frame = rows["frame"].to_numpy(np.float64)
    whole = frame == np.rint(frame)
    if not whole.all():
        row = int(np.argmin(whole))
        text = f"{frame[row]:g} is not a number of a frame"
        raise bad_recording("not-a-number", text, "write a whole number", path, column="frame", row=row + 1)
    classes = {name: [CLASSES.get(number, str(number)) for number in rows[name]] for name in ("class_f", "class_l")}
    pairs = rows.assign(t_s=frame / FRAME_RATE, **classes).rename(columns={"leader_width_m": "width_l_m"})
    return joined_pairs(pairs, info, policy)


def joined_pairs(pairs: pd.DataFrame, info: RecordingInfo, policy: DataConfig) -> Recording:
    """The recording that consists of the vehicles of all pairs, with the length of its road.

    Pairs have the columns that `read_pairs` reads, and optional ones of the follower (`f`) and the leader (`l`):
    `length_f_m`, `width_f_m`, `width_l_m`, `class_f`, `class_l` (classes of the canonical table), and `x_f_m`, lateral
    positions of the followers. Vehicles of unknown length get `default_length`.
    """
    _require_ids(pairs, info)
    _require_units(pairs, info)
    _require_one_length(pairs, info)
    losses = Losses()
    members = _members(pairs, policy.default_length)
    members = _agreeing(members, info, policy, losses)
    members = members.sort_values(["track_id", "frame", "leader_id"], na_position="last", kind="stable")
    members = members.drop_duplicates(["track_id", "frame"])
    members = members.assign(y=_across(members))
    returns = follows_row_before(members["track_id"].to_numpy())
    returns[1:] &= np.diff(members["frame"].to_numpy()) > 1
    if returns.any():
        note = f"{int(returns.sum())} vehicles left the pairs and came back under a new id"
        info = replace(info, notes=(*info.notes, note))
    table, dropped = validate(split_tracks(members, returns), info, policy, losses)
    front = table["position"].to_numpy() + 0.5 * table["length"].to_numpy()
    return Recording(replace(info, road_length=float(front.max())), table, dropped)


def _require_ids(pairs: pd.DataFrame, info: RecordingInfo) -> None:
    """Raise BadRecordingError if a known id is not a whole number."""
    for name in ("follower", "leader"):
        values = pairs[name].to_numpy(np.float64, na_value=np.nan)
        bad = ~np.isnan(values) & ~((np.abs(values) < _MAX_ID) & (values == np.rint(values)))
        if bad.any():
            row = int(np.argmax(bad))
            text = f"{values[row]:g} is not a number of a vehicle"
            raise bad_recording("not-a-number", text, "write a whole number", info.file, column=name, row=row + 1)


def _require_units(pairs: pd.DataFrame, info: RecordingInfo) -> None:
    """Raise BadRecordingError for times or lengths in another unit, which later checks would not find."""
    pair = pairs.groupby(["follower", "leader"], dropna=False, sort=False).ngroup().to_numpy()
    order = np.argsort(pair, kind="stable")
    time = pairs["t_s"].to_numpy(np.float64)[order]
    if (np.abs(time) > _MAX_TIME).any():
        text = f"a time is beyond {_MAX_TIME:g} s"
        raise bad_recording("wrong-units", text, "give the time in s", info.file, column="t_s")
    require_period(time, pair[order], 1.0 / FRAME_RATE, info.file, "t_s")
    lengths = pairs["leader_length_m"].to_numpy(np.float64)
    lengths = lengths[~np.isnan(lengths)]
    low, high = MEDIAN_SIZE["length", "car"]
    if not lengths.size:
        return
    # Some leaders are always cars; lengths in feet would make trucks of all of them.
    middle = np.quantile(lengths, 0.5, method="lower")  # not a mean of two middle values, which overflows
    if not (lengths.min() <= high and low <= middle < np.inf):
        text = f"lengths from {lengths.min():.2f} m on, {middle:.2f} m in the median, are not those of cars"
        raise bad_recording("wrong-units", text, "convert the lengths to m", info.file, column="leader_length_m")


def _require_one_length(pairs: pd.DataFrame, info: RecordingInfo) -> None:
    """Raise BadRecordingError if the length of a vehicle changes."""
    for who, column in (("leader", "leader_length_m"), ("follower", "length_f_m")):
        if column not in pairs:
            continue
        lengths = pairs.groupby(who)[column]
        with np.errstate(invalid="ignore"):  # the schema check finds infinite lengths
            span = np.asarray(lengths.transform("max")) - np.asarray(lengths.transform("min"))
        if (span > _SHARED_TOLERANCE).any():
            row = int(np.argmax(span > _SHARED_TOLERANCE))
            text, remedy = f"vehicle {pairs[who].iloc[row]} has several lengths", "correct the lengths"
            raise bad_recording("lengths-contradict", text, remedy, info.file, column=column, row=row + 1)


def _members(pairs: pd.DataFrame, default_length: float) -> pd.DataFrame:
    """Rows of followers, then of leaders, in columns of the schema."""
    frame = np.rint(pairs["t_s"].to_numpy() * FRAME_RATE)
    vehicles = np.union1d(pairs["leader"].dropna(), pairs["follower"].dropna())
    length = pairs.groupby("leader")["leader_length_m"].first().astype(np.float64).reindex(vehicles)
    if "length_f_m" in pairs:
        length = length.fillna(pairs.groupby("follower")["length_f_m"].first().astype(np.float64))
    parts = []
    for who, mark, leader in (("follower", "f", pairs["leader"]), ("leader", "l", np.nan)):
        own_length = length.reindex(pairs[who]).fillna(default_length).set_axis(pairs.index)
        position = pairs[f"y_{mark}_m"].astype(np.float64) - 0.5 * own_length
        part = {
            "track_id": pairs[who],
            "frame": frame,
            "direction": 1,
            "x": position,
            "position": position,
            "lateral": pairs["x_f_m"] if who == "follower" and "x_f_m" in pairs else np.nan,
            "lane": pairs["lane"] - 1,
            "speed": pairs[f"v_{mark}_mps"].astype(np.float64),
            "acceleration": pairs[f"a_{mark}_mps2"].astype(np.float64),
            "length": own_length,
            "width": pairs.get(f"width_{mark}_m", np.nan),
            "vehicle_class": pairs.get(f"class_{mark}", np.where(own_length > TRUCK_LENGTH, "truck", "car")),
            "leader_id": leader,
        }
        parts.append(pd.DataFrame(part, index=pairs.index))
    return pd.concat(parts)


def _across(members: pd.DataFrame) -> pd.Series:
    """Lateral position [m]; where unknown the vehicle's nearest known one, else the median of its lane, else 0."""
    lateral = members["lateral"]
    nearest = lateral.groupby(members["track_id"]).ffill().groupby(members["track_id"]).bfill()
    return nearest.fillna(lateral.groupby(members["lane"]).transform("median")).fillna(0.0)


def _agreeing(members: pd.DataFrame, info: RecordingInfo, policy: DataConfig, losses: Losses) -> pd.DataFrame:
    """The rows of vehicles on whose position all their pairs agree."""
    positions = members.groupby(["track_id", "frame"])["position"]
    with np.errstate(invalid="ignore"):  # the schema check finds infinite positions
        off = np.asarray(positions.transform("max")) - np.asarray(positions.transform("min")) > _SHARED_TOLERANCE
    if not off.any():
        return members
    row = int(np.argmax(off))
    text = f"pairs disagree about where vehicle {members['track_id'].iloc[row]} is in the same frame"
    finding = Finding("contradiction", "position", off, text, "keep the pair that is right")
    return reject(members, finding, info, policy, losses)
