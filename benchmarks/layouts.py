"""Files of any size in the layouts of recordings, written from synthetic traffic, for the benchmark of the readers.

A layout writes one recording of about the given size into a folder; `LAYOUTS` lists the layouts. Those of sensor data
are in `sensor_layouts`, with traffic on a curved road.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.sensor_layouts import pneuma_stretch, write_exid, write_i24, write_pneuma, write_tgsim

PERIOD = 0.1
"""Time between two frames [s]."""
ROAD = 2000.0
"""Length of the road [m]."""

_HEADWAY = 1.5  # s between two vehicles of a lane
_LINKS = ((1, 0.0), (10000, 1000.0), (2, 1010.0))  # number and beginning [m]
_BLOCK = 100_000  # rows that are turned into text at a time


def traffic(n_rows: int) -> pd.DataFrame:
    """About `n_rows` rows of vehicles on two lanes, in the order of time.

    Columns: frame, vehicle from 0, lane (0 = right), front [m], speed [m/s] (that of the step that ends at the frame),
    is_truck.
    """
    parts, total, vehicle = [], 0, 0
    while total < n_rows:
        lane, is_truck = vehicle % 2, vehicle % 10 == 4
        mean_speed = 22.0 + 6.0 * lane
        steps = np.arange(round(ROAD / (mean_speed - 1.0) / PERIOD))
        speed = mean_speed + np.sin(0.02 * steps)
        front = 20.0 + np.cumsum(np.r_[0.0, speed[1:]]) * PERIOD
        rows = np.flatnonzero(front < ROAD)
        first = round(_HEADWAY / PERIOD) * (vehicle // 2)
        identity = np.full(rows.size, vehicle), np.full(rows.size, is_truck)
        parts.append((first + rows, front[rows], speed[rows], *identity))
        total += rows.size
        vehicle += 1
    frame, front, speed, vehicles, is_truck = (np.concatenate(values) for values in zip(*parts, strict=True))
    order = np.argsort(frame, kind="stable")
    columns = {"frame": frame, "vehicle": vehicles, "lane": vehicles % 2, "front": front, "speed": speed}
    return pd.DataFrame(columns | {"is_truck": is_truck}).iloc[order].reset_index(drop=True)


def write_sumo_xml(rows: pd.DataFrame, folder: Path) -> None:
    """Floating car data of SUMO and the types beside it."""
    _write_types(folder)
    with (folder / "fcd.xml").open("w") as file:
        file.write('<?xml version="1.0" encoding="UTF-8"?>\n<fcd-export>\n    <timestep time="0.00">\n')
        now = 0
        for row in _tuples(rows):
            if row.frame != now:
                now = row.frame
                file.write(f'    </timestep>\n    <timestep time="{now * PERIOD:.2f}">\n')
            file.write(
                f'        <vehicle id="flow.{row.vehicle}" x="{row.front:.2f}" y="{3.2 * row.lane:.2f}" angle="90.00" '
                f'type="{"lkw" if row.is_truck else "pkw"}" speed="{row.speed:.2f}" pos="{row.front:.2f}" '
                f'lane="e_{row.lane}" slope="0.00"/>\n'
            )
        file.write("    </timestep>\n</fcd-export>\n")


def write_sumo_csv(rows: pd.DataFrame, folder: Path) -> None:
    """Floating car data of SUMO as tabular text, and the types beside it."""
    _write_types(folder)
    with (folder / "fcd.csv").open("w") as file:
        names = ("id", "x", "y", "angle", "type", "speed", "pos", "lane", "edge", "slope")
        file.write(";".join(["timestep_time", *(f"vehicle_{name}" for name in names)]) + "\n")
        for row in _tuples(rows):
            file.write(
                f"{row.frame * PERIOD:.2f};flow.{row.vehicle};{row.front:.2f};{3.2 * row.lane:.2f};90.00;"
                f"{'lkw' if row.is_truck else 'pkw'};{row.speed:.2f};{row.front:.2f};e_{row.lane};;0.00\n"
            )


def write_vissim(rows: pd.DataFrame, folder: Path) -> None:
    """A vehicle record of Vissim on two links and the connector between."""
    with (folder / "run.fzp").open("w") as file:
        names = ("SIMSEC", "NO", r"LANE\LINK\NO", r"LANE\INDEX", "POS", "POSLAT", "SPEED", "VEHTYPE", "LENGTH")
        file.write("$VISION\n* POS: Pos, Position [m]\n* SPEED: Speed, Speed [km/h]\n* LENGTH: Length, Length [m]\n")
        file.write(f"$VEHICLE:{';'.join(names)}\n")
        for row in _tuples(rows):
            link, begin = [link for link in _LINKS if link[1] <= row.front][-1]
            file.write(
                f"{row.frame * PERIOD:.2f};{row.vehicle + 1};{link};{row.lane + 1};{row.front - begin:.3f};0.50;"
                f"{3.6 * row.speed:.3f};{200 if row.is_truck else 100};{12.0 if row.is_truck else 4.5}\n"
            )


def write_openacc(rows: pd.DataFrame, folder: Path) -> None:
    """A run of OpenACC as published, with as many rows: five cars in single file instead of the traffic of `rows`."""
    n_cars = 5
    time = PERIOD * np.arange(len(rows) // n_cars)
    speeds = [20.0 + np.sin(0.1 * time - 0.3 * car) for car in range(n_cars)]
    moved = [np.r_[0.0, np.cumsum(0.5 * (speed[1:] + speed[:-1]))] * PERIOD for speed in speeds]
    columns = {"Time": time}
    for k in range(n_cars):
        along = moved[k] - 30.0 * k
        columns |= {f"Speed{k + 1}": speeds[k], f"Lat{k + 1}": 0.8 + 1e-7 * along, f"Lon{k + 1}": 0.15 + 1e-7 * along}
        columns |= {f"Alt{k + 1}": np.full_like(time, 228.0), f"E{k + 1}": along, f"N{k + 1}": np.zeros_like(time)}
    columns |= {f"IVS{k + 1}": 25.0 + moved[k] - moved[k + 1] for k in range(n_cars - 1)}
    with (folder / "part1.csv").open("w") as file:
        file.write("Date,9,10,2019\nVehicle_order,A,B,C,D,E\nNumber_of_vehicles,5\nACC,1\nDistance_setting,S\n")
        pd.DataFrame(columns).to_csv(file, index=False)


def write_table(rows: pd.DataFrame, folder: Path) -> None:
    """A canonical table as text, for comparison."""
    length = np.where(rows["is_truck"], 12.0, 4.5)
    position, lane = rows["front"] - 0.5 * length, 1 - rows["lane"]
    lateral = 3.5 * (lane + 0.5)
    table = {"track_id": rows["vehicle"], "frame": rows["frame"], "time": PERIOD * rows["frame"], "direction": 1}
    table |= {"x": position, "y": lateral, "position": position, "lateral": lateral, "lane": lane}
    kinds = np.where(rows["is_truck"], "truck", "car")
    table |= {"speed": rows["speed"], "length": length, "vehicle_class": kinds}
    pd.DataFrame(table).sort_values(["track_id", "frame"]).to_csv(folder / "t.csv", index=False, float_format="%.3f")


def _of_traffic(write: Callable[[pd.DataFrame, Path], None], row_bytes: float) -> Callable[[Path, int], None]:
    """Function that writes about `n_bytes` of `traffic`, with about `row_bytes` per row."""
    return lambda folder, n_bytes: write(traffic(round(n_bytes / row_bytes)), folder)


def _of_sensors(write: Callable[[Path, int], None], name: str) -> Callable[[Path, int], None]:
    """Function that writes about `n_bytes` into the file `name`."""
    return lambda folder, n_bytes: write(folder / name, n_bytes)


@dataclass(frozen=True)
class Layout:
    """Files of a format.

    Attributes:
        format: The value of data.format that reads them.
        write: Function of a folder and a size [bytes] that writes about so much into it.
        stretch: The value of data.stretch; None for formats that need none.
    """

    format: str
    write: Callable[[Path, int], None]
    stretch: tuple[float, ...] | None = None


LAYOUTS = {
    "sumo_xml": Layout("sumo", _of_traffic(write_sumo_xml, 131.0)),
    "sumo_csv": Layout("sumo", _of_traffic(write_sumo_csv, 63.0)),
    "vissim": Layout("vissim", _of_traffic(write_vissim, 44.0)),
    "openacc_raw": Layout("openacc", _of_traffic(write_openacc, 102.0)),
    "table_csv": Layout("table", _of_traffic(write_table, 69.0)),
    "tgsim": Layout("tgsim", _of_sensors(write_tgsim, "I294_L1_final.csv")),
    "i24": Layout("i24", _of_sensors(write_i24, "day.json")),
    "exid": Layout("exid", _of_sensors(write_exid, "00_tracks.csv")),
    "pneuma": Layout("pneuma", _of_sensors(write_pneuma, "20181024_d1_0830_0900.csv"), pneuma_stretch()),
}
"""Layouts by name."""


def _tuples(rows: pd.DataFrame) -> Iterator:
    for begin in range(0, len(rows), _BLOCK):
        yield from rows.iloc[begin : begin + _BLOCK].itertuples(index=False)


def _write_types(folder: Path) -> None:
    types = '<vType id="pkw" vClass="passenger" length="4.5"/><vType id="lkw" vClass="truck" length="12"/>'
    (folder / "types.rou.xml").write_text(f"<routes>{types}</routes>")
