"""One small piece of traffic, written in every format the package reads: what the fuzzers begin with.

Two lanes of four vehicles whose speeds swing, so that positions, speeds, accelerations and gaps agree as in a sound
recording. A recording is a dictionary of tables by file name, in the columns and units of its source.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from rearl_jax.data.schema import COLUMNS
from rearl_jax.data.tables.canonical import METADATA

FEET = 1.0 / 0.3048
N_FRAMES = 40
LANE = 3.7  # m


Column = list[str] | pa.Array
"""Cells of a text file as they are written, or a column of a Parquet file."""


@dataclass
class Source:
    """The files of one recording.

    Attributes:
        tables: Columns by file name and name.
        texts: Other files, as text.
        metadata: Schema metadata of the Parquet tables, by file name.
        heads: What stands above the names of columns in text tables, by file name.
        delimiters: What separates fields, by file name; a comma where it is not stated.
    """

    tables: dict[str, dict[str, Column]]
    texts: dict[str, str] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    heads: dict[str, str] = field(default_factory=dict)
    delimiters: dict[str, str] = field(default_factory=dict)

    def copy(self) -> "Source":
        """One that can be changed: columns may be replaced, their cells not."""
        tables = {name: dict(columns) for name, columns in self.tables.items()}
        metadata = {name: dict(texts) for name, texts in self.metadata.items()}
        return replace(self, tables=tables, texts=dict(self.texts), metadata=metadata)

    def files(self) -> dict[str, bytes]:
        """Content of every file."""
        found = {name: text.encode() for name, text in self.texts.items()}
        for name, columns in self.tables.items():
            if name.endswith(".parquet"):
                found[name] = _parquet(columns, self.metadata.get(name, {}))
            else:
                text = _text(name, columns, self.delimiters.get(name, ","))
                found[name] = (self.heads.get(name, "") + text).encode()
        return found


def source(tables: dict[str, pd.DataFrame], **other) -> Source:
    """The same from frames."""
    return Source({name: _columns(name, frame) for name, frame in tables.items()}, **other)


def _columns(name: str, frame: pd.DataFrame) -> dict[str, Column]:
    if name.endswith(".parquet"):
        table = pa.Table.from_pandas(frame, preserve_index=False)
        return {column: table[column].combine_chunks() for column in table.column_names}
    return {str(column): ["" if value != value else str(value) for value in frame[column].tolist()] for column in frame}


def _text(name: str, columns: dict[str, Column], delimiter: str) -> str:
    rows = zip(*columns.values(), strict=False)
    if name.endswith(".txt"):
        return "\n".join(map(" ".join, rows))
    return "\n".join([delimiter.join(columns), *map(delimiter.join, rows), ""])


def _parquet(columns: dict[str, Column], metadata: dict[str, str]) -> bytes:
    n_rows = min(map(len, columns.values()), default=0)
    table = pa.table({name: column[:n_rows] for name, column in columns.items()})
    sink = pa.BufferOutputStream()
    pq.write_table(table.replace_schema_metadata(metadata), sink, compression="none")
    return sink.getvalue().to_pybytes()


def traffic(rate: float) -> pd.DataFrame:
    """Eight vehicles in columns of the canonical schema [m, s]; the last of each lane is a truck.

    Args:
        rate: Frames per second [1/s].
    """
    frame = np.arange(N_FRAMES)
    t = frame / rate
    rows = []
    for i in range(8):
        lane, rank = i % 2, i // 2
        length, width = (12.0, 2.5) if rank == 3 else (4.4 + 0.1 * rank, 1.8)
        mean, swing, omega, phase = 14.0 + 4.0 * lane, 1.5, 1.6, 0.8 * rank + lane
        speed = mean + swing * np.sin(omega * t - phase)
        position = 150.0 - 25.0 * rank + mean * t - swing / omega * (np.cos(omega * t - phase) - np.cos(phase))
        # The last but one of the left lane moves over to the right one.
        aside = np.clip((t - 1.0) / 1.5, 0.0, 1.0) * LANE if (lane, rank) == (0, 2) else np.zeros_like(t)
        lateral = LANE * (lane + 0.5) + aside
        rows.append(
            pd.DataFrame(
                {
                    "track_id": i + 1,
                    "frame": frame + 3,
                    "direction": 1,
                    "x": position,
                    "y": lateral,
                    "position": position,
                    "lateral": lateral,
                    "lane": np.floor(lateral / LANE).astype(np.int64),
                    "speed": speed,
                    "acceleration": swing * omega * np.cos(omega * t - phase),
                    "length": length,
                    "width": width,
                    "vehicle_class": "truck" if rank == 3 else "car",
                    "leader_id": float(i - 1) if rank else np.nan,
                }
            )
        )
    return pd.concat(rows, ignore_index=True)


def highd() -> Source:
    """The highD format at 25 frames per second; vehicles of both directions."""
    here = traffic(25.0)
    left = here["track_id"] % 2 == 1  # the left lane of `traffic` becomes the direction to the left
    road = 400.0
    centre = np.where(left, road - here["position"], here["position"])
    y = np.where(left, 20.0 - here["lateral"], 25.0 + here["lateral"])
    lane = np.where(left, 3 - here["lane"], 5 + here["lane"])
    sign = np.where(left, -1.0, 1.0)
    leader = here["leader_id"].fillna(0).astype(np.int64)
    tracks = pd.DataFrame(
        {
            "frame": here["frame"],
            "id": here["track_id"],
            "x": (centre - here["length"] / 2).round(3),
            "y": (y - here["width"] / 2).round(3),
            "width": here["length"],
            "height": here["width"],
            "xVelocity": (sign * here["speed"]).round(3),
            "yVelocity": 0.0,
            "xAcceleration": (sign * here["acceleration"]).round(3),
            "yAcceleration": 0.0,
            "precedingId": leader,
            "laneId": lane.astype(np.int64),
        }
    )
    ids = np.arange(1, 9)
    meta = pd.DataFrame(
        {
            "id": ids,
            "numFrames": N_FRAMES,
            "class": np.where(ids > 6, "Truck", "Car"),
            "drivingDirection": np.where(ids % 2 == 1, 1, 2),
        }
    )
    recording = pd.DataFrame(
        {
            "id": [1],
            "frameRate": [25.0],
            "locationId": [1],
            "speedLimit": [33.33],
            "upperLaneMarkings": ["12.60;16.30;20.00"],
            "lowerLaneMarkings": ["25.00;28.70;32.40"],
        }
    )
    return source({"01_tracks.csv": tracks, "01_tracksMeta.csv": meta, "01_recordingMeta.csv": recording})


def published(name: str) -> Source:
    """A published NGSIM table in feet, with a header (.csv) or without (.txt)."""
    here = traffic(10.0)
    table = pd.DataFrame(
        {
            "Vehicle_ID": here["track_id"],
            "Frame_ID": here["frame"],
            "Total_Frames": N_FRAMES,
            "Global_Time": 1118846979700 + 100 * here["frame"],
            "Local_X": (here["lateral"] * FEET).round(3),
            "Local_Y": ((here["position"] + here["length"] / 2) * FEET).round(3),
            "Global_X": 6451137.6,
            "Global_Y": 1873344.9,
            "v_Length": (here["length"] * FEET).round(2),
            "v_Width": (here["width"] * FEET).round(2),
            "v_Class": np.where(here["vehicle_class"] == "truck", 3, 2),
            "v_Vel": (here["speed"] * FEET).round(3),
            "v_Acc": (here["acceleration"] * FEET).round(3),
            "Lane_ID": here["lane"] + 1,
            "Preceding": here["leader_id"].fillna(0).astype(np.int64),
            "Following": 0,
            "Space_Headway": 0.0,
            "Time_Headway": 0.0,
        }
    )
    if name.endswith(".csv"):
        table["Location"] = "us-101"
    return source({name: table})


def us101() -> Source:
    """The shipped table of US-101 in its own columns."""
    here = traffic(10.0)
    table = pd.DataFrame(
        {
            "period": np.int8(0),
            "vehicle_id": here["track_id"].astype(np.int32),
            "frame": here["frame"].astype(np.int32),
            "x_m": here["lateral"].astype(np.float32),
            "y_m": here["position"].astype(np.float32),
            "lane_est": (here["lane"] + 1).astype(np.int8),
            "speed_mps": here["speed"].astype(np.float32),
            "accel_mps2": here["acceleration"].astype(np.float32),
        }
    )
    return source({"us101_lane_changers.parquet": table})


def i80() -> Source:
    """Leader-follower pairs."""
    return source({"pairs.parquet": _pairs()})


def i80_lateral() -> Source:
    """Leader-follower pairs with lateral positions."""
    pairs = _pairs().rename(columns={"t_s": "frame"}).drop(columns="run")
    own_length = pairs["follower"].map(_pair_length)
    return source(
        {
            "pairs.parquet": pairs.assign(
                frame=(10.0 * pairs["frame"]).round().astype(np.int64),
                x_f_m=LANE * (pairs["lane"] - 0.5),
                length_f_m=own_length,
                width_f_m=1.8,
                class_f=2,
                leader_width_m=1.9,
                class_l=2,
            )
        }
    )


def _pairs() -> pd.DataFrame:
    here = traffic(10.0)
    parts = []
    for leader, follower in ((1, 3), (3, 5), (2, 4), (4, 6), (6, 8)):
        ahead, behind = (here[here["track_id"] == vehicle].reset_index(drop=True) for vehicle in (leader, follower))
        parts.append(
            pd.DataFrame(
                {
                    "run": "0400pm-0415pm",
                    "follower": follower,
                    "leader": leader,
                    "t_s": ahead["frame"] / 10.0,
                    "y_f_m": behind["position"] + _pair_length(follower) / 2,
                    "v_f_mps": behind["speed"],
                    "a_f_mps2": behind["acceleration"],
                    "y_l_m": ahead["position"] + _pair_length(leader) / 2,
                    "v_l_mps": ahead["speed"],
                    "a_l_mps2": ahead["acceleration"],
                    "leader_length_m": _pair_length(leader),
                    "lane": (ahead["lane"] + 1).astype(np.int64),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def _pair_length(vehicle: int) -> float:
    return 4.3 + 0.1 * vehicle


def openacc() -> Source:
    """A platoon of four vehicles."""
    here = traffic(10.0)
    members = (2, 4, 6, 8)
    parts = []
    for place, vehicle in enumerate(members, 1):
        own = here[here["track_id"] == vehicle].reset_index(drop=True)
        gap: np.ndarray | float = np.nan
        if place < len(members):
            behind = here[here["track_id"] == members[place]].reset_index(drop=True)
            gap = (own["position"] - behind["position"] - 4.5).to_numpy()
        parts.append(
            pd.DataFrame(
                {
                    "file": "run_1",
                    "t_s": 30.0 + (own["frame"] - 3) / 10.0,
                    "pos": np.int8(place),
                    "speed_mps": own["speed"],
                    "gap_to_follower_m": gap,
                }
            )
        )
    return source({"platoons.parquet": pd.concat(parts, ignore_index=True)})


INFO = (
    '[{"id": "made_07", "frame_rate": 10.0, "lane_count": {"1": 2}, "road_length": 400.0, "source": "made by hand", '
    '"licence": "CC0", "attribution": "nobody", "generated": false, "speed_limit": 33.3, '
    '"lane_markings": {"1": [0.0, 3.7, 7.4]}, "notes": ["one"]}]'
)


def canonical(name: str, *, described: bool) -> Source:
    """A canonical table, with or without what is known about the recording."""
    here = traffic(10.0)
    here.insert(0, "recording", "made_07")
    here.insert(3, "time", (here["frame"] - here["frame"].min()) / 10.0)
    here = here[[column.name for column in COLUMNS]]
    if not described:
        return source({name: here})
    if name.endswith(".csv"):
        return source({name: here}, texts={f"{name}.info.json": INFO})
    return source({name: here}, metadata={name: {f"rearl_jax.{METADATA}": INFO}})
