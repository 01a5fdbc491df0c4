"""Reader of NGSIM I-80 leader-follower pairs with lateral positions, widths and classes: raw NGSIM in SI units.

One recording, 4:00 to 4:15 pm. The frames are those of NGSIM, so all pairs share one clock. Only followers have a
lateral position; a vehicle that is only a leader has none.

Source: NGSIM I-80, DOI 10.21949/1504477.
"""

from pathlib import Path

import numpy as np

from rearl_jax.config.data import DataConfig
from rearl_jax.data.files.columnar import column_names, read_columns
from rearl_jax.data.files.folder import only_parquet
from rearl_jax.data.formats.ngsim import ATTRIBUTION, CLASSES, FRAME_RATE, LANES, LICENCE
from rearl_jax.data.formats.ngsim_pairs import joined_pairs
from rearl_jax.data.problems import bad_recording, require_columns
from rearl_jax.data.schema import Recording, RecordingInfo

RECORDING = "i80_0400"

_OF_BOTH = "follower leader frame lane".split()
_OF_FOLLOWER = "x_f_m y_f_m v_f_mps a_f_mps2 length_f_m width_f_m class_f".split()
_OF_LEADER = "y_l_m v_l_mps a_l_mps2 leader_length_m leader_width_m class_l".split()
COLUMNS = (*_OF_BOTH, *_OF_FOLLOWER, *_OF_LEADER)
"""Columns by which a file is recognised, all of numbers."""


def find_lateral(root: Path) -> Path:
    """The Parquet file of pairs in the folder; MissingInputError if there is none, or more than one."""
    return only_parquet(root, f"the folder with the one file of leader-follower pairs, columns {', '.join(COLUMNS)}")


def lateral_recordings(path: Path) -> dict[str, None]:
    """The one recording of the table."""
    require_columns(column_names(path), COLUMNS, path)
    return {RECORDING: None}


def read_lateral(path: Path, recording: str, part: None, policy: DataConfig) -> Recording:
    """The vehicles of all pairs; gaps to the leader are those of the source.

    The source states the position y of the front, so the centre is at y - length / 2.
    """
    rows = read_columns(path, COLUMNS)
    info = RecordingInfo(
        id=recording,
        frame_rate=FRAME_RATE,
        lane_count={1: LANES["i80"]},
        road_length=0.0,
        source="NGSIM I-80, leader-follower pairs with lateral positions",
        licence=LICENCE,
        attribution=ATTRIBUTION,
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
