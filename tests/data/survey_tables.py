"""Tables of unknown layout, in the styles of public ones, of one stretch of made traffic whose truth is known."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd


def truth(rate: float = 10.0, n_vehicles: int = 5, seconds: float = 8.0) -> pd.DataFrame:
    """Vehicles on two lanes that speed up and slow down, in canonical columns and SI units; 5 follows 3 follows 1."""
    frame = np.arange(round(seconds * rate))
    time = frame / rate
    rows = []
    for track in range(1, n_vehicles + 1):
        lane, phase = (track + 1) % 2, 0.4 * track
        speed = 20.0 - 2.0 * lane + 2.0 * np.sin(0.5 * time + phase)
        acceleration = np.cos(0.5 * time + phase)
        position = 160.0 - 30.0 * track + (20.0 - 2.0 * lane) * time - 4.0 * np.cos(0.5 * time + phase)
        rows.append(
            pd.DataFrame(
                {
                    "track_id": track,
                    "frame": frame,
                    "time": time,
                    "position": position,
                    "lateral": 3.6 * (lane + 0.5) + 0.2 * np.sin(time),
                    "lane": lane,
                    "speed": speed,
                    "acceleration": acceleration,
                    "length": 12.0 if track == 5 else 4.4 + 0.1 * track,
                    "width": 2.5 if track == 5 else 1.8,
                    "vehicle_class": "truck" if track == 5 else "car",
                    "leader_id": track - 2 if track > 2 else 0,
                }
            )
        )
    return pd.concat(rows, ignore_index=True)


def _milliseconds(rows: pd.DataFrame) -> np.ndarray:
    return (1000.0 * rows["time"].to_numpy()).round().astype("timedelta64[ms]")


def detector_feet(path: Path) -> None:
    """Feet, ft/s, ms since 1970, lanes from 1, as in tables of the U.S. DOT; sorted by time."""
    rows = truth()
    table = pd.DataFrame(
        {
            "veh_id": rows["track_id"],
            "epoch_ms": (1_118_846_980_200 + rows["time"] * 1000).round().astype(int),
            "local_x": (rows["lateral"] / 0.3048).round(3),
            "local_y": (rows["position"] / 0.3048).round(3),
            "v_vel": (rows["speed"] / 0.3048).round(2),
            "v_acc": (rows["acceleration"] / 0.3048).round(2),
            "v_length": (rows["length"] / 0.3048).round(1),
            "v_width": (rows["width"] / 0.3048).round(1),
            "lane_id": rows["lane"] + 1,
            "preceding": rows["leader_id"],
        }
    )
    table.sort_values(["epoch_ms", "veh_id"]).to_csv(path, index=False)


def drone_kmh(path: Path) -> None:
    """Semicolons, decimal commas, km/h, German names in Windows-1252, dates and times of day."""
    rows = truth(25.0)
    moments = pd.DatetimeIndex(np.datetime64("2024-05-31T08:00:00") + _milliseconds(rows))
    table = pd.DataFrame(
        {
            "Fahrzeug": rows["track_id"].map(lambda number: f"Fzg {number:03d}"),
            "Zeitstempel": moments.strftime("%d.%m.%Y %H:%M:%S,%f").str[:-3],
            "Position [m]": rows["position"].round(3),
            "Geschwindigkeit [km/h]": (rows["speed"] * 3.6).round(3),
            "Länge [m]": rows["length"],
            "Fahrstreifen": rows["lane"],
            "Fahrzeugtyp": rows["vehicle_class"].replace({"car": "PKW", "truck": "LKW"}),
        }
    )
    table.to_csv(path, index=False, sep=";", decimal=",", encoding="cp1252")


def frames_only(path: Path) -> None:
    """Frames at 30 per second and no times, tabs, boxes in the image of the camera in m."""
    rows = truth(30.0)
    table = pd.DataFrame(
        {
            "frameNum": rows["frame"] + 1001,
            "carId": rows["track_id"] + 70,
            "carCenterX_px": (rows["position"] * 9.7).round(1),
            "xCenter": rows["position"].round(3),
            "yCenter": rows["lateral"].round(3),
            "xVelocity": rows["speed"].round(3),
            "xAcceleration": rows["acceleration"].round(3),
            "laneId": rows["lane"] + 1,
        }
    )
    table.to_csv(path, index=False, sep="\t")


def simulation_blanks(path: Path) -> None:
    """Fields between blanks below comments, ids with a dot, as simulators write them."""
    rows = truth(2.0, seconds=40.0)
    names = rows["track_id"].map(lambda number: f"flow_0.{number}")
    lines = [
        f"{time:8.2f} {name:>12} {lane:>3} {position:10.3f} {speed:8.3f}"
        for time, name, lane, position, speed in zip(
            rows["time"], names, rows["lane"], rows["position"], rows["speed"], strict=True
        )
    ]
    text = ["# run of Monday", "#    time  vehicle lane pos speed", *lines]
    path.write_text("\n".join(text) + "\n", encoding="utf-8")


def corridor_uuid(path: Path) -> None:
    """Hexadecimal ids, seconds since 1970, westbound positions that fall, in feet; compressed."""
    rows = truth(25.0)
    table = pd.DataFrame(
        {
            "timestamp": (1_669_812_600.04 + rows["time"]).round(2),
            "object_id": rows["track_id"].map(lambda number: f"637af{number:019x}"),
            "x_position": (300_000.0 - rows["position"] / 0.3048).round(3),
            "y_position": (rows["lateral"] / 0.3048).round(3),
            "velocity": (rows["speed"] / 0.3048).round(3),
            "length": (rows["length"] / 0.3048).round(2),
            "width": (rows["width"] / 0.3048).round(2),
            "class": rows["vehicle_class"],
        }
    )
    table.to_csv(path, index=False, compression="gzip")


def probe_mph(path: Path) -> None:
    """Speeds in miles per hour, distances in feet, times of day at 1 Hz, UTF-16 with tabs, as spreadsheets export."""
    rows = truth(1.0, seconds=60.0)
    moments = pd.DatetimeIndex(np.datetime64("2023-03-01T07:30:00") + _milliseconds(rows))
    table = pd.DataFrame(
        {
            "Vehicle No.": rows["track_id"],
            "Time": moments.strftime("%I:%M:%S %p"),
            "Distance (ft)": (rows["position"] / 0.3048).round(1),
            "Speed (mph)": (rows["speed"] / 0.44704).round(2),
        }
    )
    table.to_csv(path, index=False, sep="\t", encoding="utf-16")


def camera_json_style(path: Path) -> None:
    """Camel case, milliseconds without a name that says so, huge ids, bars, every fifth frame."""
    rows = truth(5.0, seconds=16.0)
    table = pd.DataFrame(
        {
            "objectId": rows["track_id"] + 2**61,
            "frameIndex": rows["frame"] * 5,
            "t": (rows["time"] * 1000).round().astype(int),
            "posX": rows["position"].round(3),
            "posY": (-rows["lateral"]).round(3),
            "speed": (rows["speed"] * 3.6).round(2),
            "objectClass": rows["vehicle_class"].str.upper(),
        }
    )
    table.to_csv(path, index=False, sep="|")


def nameless(path: Path) -> None:
    """Names that tell nothing: vehicles, clock, position and speed show in the values alone."""
    rows = truth(20.0)
    table = pd.DataFrame(
        {
            "c1": rows["time"].round(2),
            "c2": rows["track_id"],
            "c3": rows["speed"].round(3),
            "c4": rows["position"].round(3),
        }
    )
    table.to_csv(path, index=False)


def parquet_runs(path: Path) -> None:
    """Parquet of two runs whose ids begin anew, durations as times, canonical names for some columns."""
    rows = truth()
    both = pd.concat([rows.assign(run="morning"), rows.assign(run="noon", speed=rows["speed"])], ignore_index=True)
    both.loc[len(rows) :, "position"] += 3.0
    table = pd.DataFrame(
        {
            "run": both["run"],
            "vehicle_id": both["track_id"].astype("int32"),
            "time": pd.to_timedelta(both["time"].to_numpy(), unit="s"),
            "s": both["position"],
            "v": both["speed"].astype("float32"),
            "width": 99.0,
            "lane": both["lane"].astype("int8"),
        }
    )
    table.to_parquet(path)


def already_canonical(path: Path) -> None:
    """Canonical names and units, without what follows from others."""
    truth().to_csv(path, index=False)


TABLES: dict[str, Callable[[Path], None]] = {
    "detector_feet.csv": detector_feet,
    "drone_kmh.csv": drone_kmh,
    "frames_only.tsv": frames_only,
    "simulation_blanks.txt": simulation_blanks,
    "corridor_uuid.csv.gz": corridor_uuid,
    "probe_mph.txt": probe_mph,
    "camera_json_style.dat": camera_json_style,
    "nameless.csv": nameless,
    "parquet_runs.parquet": parquet_runs,
    "already_canonical.csv": already_canonical,
}
"""Ten tables: file name, and the function that writes it."""
