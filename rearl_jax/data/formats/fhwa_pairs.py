"""Reader of FHWA's leader-follower pairs: the same drivers behind a car with adaptive cruise control and behind people.

Every pair becomes two tracks, one of the follower and one of the leader, because one driver follows leaders of both
kinds. Labels: `leader` is ACC or person, `person` identifies the driver that follows.

Source: U.S. Federal Highway Administration, TO-21-426, modelling interactions of people with inconspicuous vehicles
under adaptive cruise control; github.com/usdot-fhwa-stol, Apache 2.0.
"""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.losses import Losses
from rearl_jax.data.checks.unit_checks import require_period
from rearl_jax.data.files.columnar import read_columns
from rearl_jax.data.files.folder import only_parquet
from rearl_jax.data.formats.ngsim_pairs import runs_of
from rearl_jax.data.problems import bad_recording, source_row
from rearl_jax.data.schema import Recording, RecordingInfo, validate

FRAME_RATE = 10.0
LICENCE = "Apache-2.0"
ATTRIBUTION = (
    "U.S. Federal Highway Administration, To-21-426-modeling-HV-interactions-with-inconspicuous-ACC-equipped-vehicles, "
    "https://github.com/usdot-fhwa-stol"
)
PERSON = "person"
"""Label of tracks: identity of the follower within a run; None for leaders."""
LENGTH = 5.0  # m, assumed by the source for all vehicles: its gap is the distance of the centres minus this
LEADERS = {"CAV": "ACC", "HV": "person"}
_NUMBERS = "pair follower_id leader_id t_s y_f_m v_f_mps a_f_mps2 y_l_m v_l_mps a_l_mps2".split()
_TEXTS = ("recording", "group")
COLUMNS = (*_TEXTS, *_NUMBERS)
"""Columns by which a file is recognised."""
_MAX_ID = 1e9

find_pairs = partial(only_parquet, wanted=f"the folder with the one file of FHWA's pairs, columns {', '.join(COLUMNS)}")
"""The Parquet file of pairs in the folder; MissingInputError if there is none, or more than one."""


def pairs_recordings(path: Path) -> dict[str, str]:
    """Recording id -> run of the table, such as fhwa_run1 -> run1."""
    return {f"fhwa_{run}": run for run in runs_of(path, "recording", "pair", COLUMNS)}


def read_pairs(path: Path, recording: str, run: str, policy: DataConfig) -> Recording:
    """The pairs of one run.

    Raises:
        BadRecordingError: A pair has several followers or leaders, no row states a place, or a row breaks the schema.
    """
    pairs = read_columns(path, _NUMBERS, _TEXTS, only=("recording", run))
    info = RecordingInfo(
        id=recording,
        frame_rate=FRAME_RATE,
        lane_count={1: 1},
        road_length=0.0,
        source="FHWA TO-21-426, freeway leader-follower pairs",
        licence=LICENCE,
        attribution=ATTRIBUTION,
        labels=("leader", PERSON),
        notes=(
            "leader-follower pairs only: not every vehicle of a lane, no lanes, no lateral position",
            f"vehicle length {LENGTH:g} m assumed by the source",
        ),
        file=f"{path} ({run})",
        columns={"track_id": "pair", "frame": "t_s", "time": "t_s", "position": "y_f_m", "x": "y_f_m"}
        | {"speed": "v_f_mps", "acceleration": "a_f_mps2", "leader": "group", PERSON: "follower_id"},
    )
    _require_pairs(pairs, info)
    require_period(pairs["t_s"].to_numpy(np.float64), pairs["pair"].to_numpy(), 1.0 / FRAME_RATE, info.file, "t_s")
    table, dropped = validate(_members(pairs, run), info, policy, Losses())
    # From the rows that are left, because a bad row must not change the length of the road.
    return Recording(replace(info, road_length=float(table["position"].to_numpy().max()) + LENGTH), table, dropped)


def _require_pairs(pairs: pd.DataFrame, info: RecordingInfo) -> None:
    """Raise BadRecordingError unless every row names its pair, a pair has one follower, leader and group, and places
    are stated.
    """
    for name in ("y_f_m", "y_l_m"):
        if not np.isfinite(pairs[name].to_numpy(np.float64, na_value=np.nan)).any():
            remedy = "write the places of the vehicles there"
            raise bad_recording("no-values", "the column has no values", remedy, info.file or info.id, column=name)
    for name in ("pair", "follower_id", "leader_id"):
        values = pairs[name].to_numpy(np.float64, na_value=np.nan)
        bad = ~((values >= 0) & (values < _MAX_ID) & (values == np.rint(values)))
        _stop_at(bad, pairs, name, "not-a-number", "a vehicle or pair has no number", "write a whole number", info)
    known = pairs["group"].isin(list(LEADERS)).to_numpy()
    wanted = f"write one of {', '.join(LEADERS)}"
    _stop_at(~known, pairs, "group", "group-unknown", "the kind of the leader is not stated", wanted, info)
    for name in ("follower_id", "leader_id", "group"):
        bad = (pairs[name] != pairs.groupby("pair")[name].transform("first")).to_numpy()
        text = f"a pair has several values of {name}"
        _stop_at(bad, pairs, name, "pair-contradicts", text, "give the parts numbers of their own", info)


def _stop_at(
    bad: np.ndarray, pairs: pd.DataFrame, column: str, code: str, text: str, remedy: str, info: RecordingInfo
) -> None:
    """Raise BadRecordingError for the first marked row, if there is one."""
    if bad.any():
        raise bad_recording(code, text, remedy, info.file, column=column, row=source_row(pairs, bad))


def _members(pairs: pd.DataFrame, run: str) -> pd.DataFrame:
    """Rows of followers, then of leaders, in columns of the schema."""
    pair = pairs["pair"].to_numpy(np.int64)
    person = f"{run}_" + pairs["follower_id"].astype(np.int64).astype(str)
    parts = []
    for mark, track, leader in (("f", 2 * pair, 2 * pair + 1), ("l", 2 * pair + 1, np.nan)):
        position = pairs[f"y_{mark}_m"].astype(np.float64)
        part = {
            "track_id": track,
            "frame": np.rint(pairs["t_s"].to_numpy(np.float64) * FRAME_RATE),
            "direction": 1,
            "x": position,
            "y": 0.0,
            "position": position,
            "speed": pairs[f"v_{mark}_mps"].astype(np.float64),
            "acceleration": pairs[f"a_{mark}_mps2"].astype(np.float64),
            "length": LENGTH,
            "vehicle_class": "car",
            "leader_id": leader,
            "leader": [LEADERS[group] for group in pairs["group"]] if mark == "f" else None,
            PERSON: person if mark == "f" else None,
        }
        parts.append(pd.DataFrame(part, index=pairs.index))
    return pd.concat(parts)
