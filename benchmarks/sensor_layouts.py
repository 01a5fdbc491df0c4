"""Writers of large files in the layouts of recordings, for measurements of readers: write_NAME(path, n_bytes).

All write the same synthetic traffic: lanes of vehicles whose speeds oscillate, on a slightly curved road.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd

ROAD_LENGTH = 640.0
"""Length of the road [m]."""
RADIUS = 1500.0
"""Radius of its curve [m]."""
LANE_WIDTH = 3.6
"""Lane width [m]."""
FOOT = 0.3048
"""Length of a foot [m]."""
MEDIAN = 4.0
"""Width between the two carriageways [m]."""
HEADWAY = 2.4
"""Time between two vehicles of a lane [s]."""
SWING = 60.0
"""Period of the oscillation of the speeds [s]."""


@dataclass(frozen=True)
class Vehicle:
    """One vehicle that drives through.

    Attributes:
        number: Number of the vehicle, from 1, in the order of their first rows.
        direction: 2 along the road, 1 against it.
        lane: Lane in every row, counted from the left from 0.
        time: Time of every row [s], a multiple of the time between two frames.
        along: Distance of the centre along the driving direction [m].
        lateral: Distance of the centre from the left edge of the carriageway [m].
        speed: Speed [m/s].
        acceleration: Acceleration [m/s^2].
        length: Length [m].
        width: Width [m].
        is_truck: Whether the vehicle is a truck.
    """

    number: int
    direction: int
    lane: np.ndarray
    time: np.ndarray
    along: np.ndarray
    lateral: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    length: float
    width: float
    is_truck: bool


def traffic(rate: float, *, n_lanes: int = 3, directions: tuple[int, ...] = (2, 1)) -> Iterator[Vehicle]:
    """Vehicles without end, in the order in which they enter.

    Args:
        rate: Frames per second [1/s].
        n_lanes: Lanes of each carriageway.
        directions: Carriageways.
    """
    number, swing = 0, 2.0 * np.pi / SWING
    while True:
        for direction in directions:
            for lane in range(n_lanes):
                mean_speed = 30.0 - 3.0 * lane
                enters = HEADWAY * (number // (n_lanes * len(directions))) + 0.4 * lane + 0.2 * direction
                number += 1
                time = np.arange(np.ceil(enters * rate), np.ceil((enters + 60.0) * rate)) / rate
                along = _driven(time, mean_speed, swing) - _driven(np.array([enters]), mean_speed, swing)
                inside = along < ROAD_LENGTH
                time, along = time[inside], along[inside]
                change = 1.0 if number % 7 == 0 and lane + 1 < n_lanes else 0.0
                rank = lane + change * np.clip((along - 300.0) / 100.0, 0.0, 1.0)
                truck = number % 5 == 0
                yield Vehicle(
                    number=number,
                    direction=direction,
                    lane=np.floor(rank + 0.5).astype(np.int64),
                    time=time,
                    along=along,
                    lateral=LANE_WIDTH * (rank + 0.5),
                    speed=mean_speed * (1.0 + 0.2 * np.sin(swing * time)),
                    acceleration=mean_speed * 0.2 * swing * np.cos(swing * time),
                    length=14.0 if truck else 4.6,
                    width=2.5 if truck else 1.9,
                    is_truck=truck,
                )


def _driven(time: np.ndarray, mean_speed: float, swing: float) -> np.ndarray:
    """Integral over time [m] of the speed mean_speed (1 + 0.2 sin(swing time))."""
    return mean_speed * (time - 0.2 / swing * np.cos(swing * time))


def on_plane(vehicle: Vehicle, *, y_down: bool, turned: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """Positions [m] on a map, or with `y_down` in a picture; the road is turned by the angle `turned` [rad]."""
    ahead = vehicle.direction == 2
    along_road = vehicle.along if ahead else ROAD_LENGTH - vehicle.along
    offset = (0.5 * MEDIAN + vehicle.lateral) * (1.0 if ahead else -1.0)
    angle = along_road / RADIUS
    # The right side of the road is where y grows in a picture.
    x, y = RADIUS * np.sin(angle) - offset * np.sin(angle), RADIUS * (1.0 - np.cos(angle)) + offset * np.cos(angle)
    x, y = np.cos(turned) * x - np.sin(turned) * y, np.sin(turned) * x + np.cos(turned) * y
    return 100.0 + x, (100.0 + y) * (1.0 if y_down else -1.0)


def tgsim_rows(vehicle: Vehicle, run: int = 1) -> pd.DataFrame:
    """Rows in the columns of TGSIM's I-90/I-94 tables; lanes of the other carriageway have negative numbers."""
    x, y = on_plane(vehicle, y_down=True)
    sign = 1 if vehicle.direction == 2 else -1
    return pd.DataFrame(
        {
            "id": vehicle.number,
            "time": vehicle.time.round(1),
            "xloc-kf": x.round(3),
            "yloc-kf": y.round(3),
            "lane-kf": sign * (vehicle.lane + 1),
            "speed-kf": vehicle.speed.round(3),
            "acceleration-kf": vehicle.acceleration.round(3),
            "length-smoothed": vehicle.length,
            "width-smoothed": vehicle.width,
            "type-most-common": "large-vehicle" if vehicle.is_truck else "small-vehicle",
            "av": "yes" if vehicle.number == 3 else "no",
            "run-index": run,
        }
    )


def write_tgsim(path: Path, n_bytes: int) -> None:
    """Writes a table of TGSIM, about `n_bytes` long."""
    with path.open("w", encoding="utf-8") as file:
        vehicles = traffic(10.0)
        header = True
        while file.tell() < n_bytes:
            rows = pd.concat([tgsim_rows(vehicle) for vehicle in islice(vehicles, 12)])
            rows.to_csv(file, index=False, header=header)
            header = False


def i24_document(vehicle: Vehicle, begin: float = 1669123200.0, mile: float = 60.0) -> dict:
    """A document of I-24 MOTION: the rear in feet from mile 0, y_position from the middle of the road."""
    sign = 1 if vehicle.direction == 2 else -1
    along = vehicle.along if sign > 0 else ROAD_LENGTH - vehicle.along
    x = (along - 0.5 * sign * vehicle.length) / FOOT + 5280.0 * mile
    y = 12.0 + 12.0 * vehicle.lateral / LANE_WIDTH
    time = begin + vehicle.time
    return {
        "_id": {"$oid": f"{vehicle.number:024x}"},
        "timestamp": time.tolist(),
        "first_timestamp": time[0],
        "last_timestamp": time[-1],
        "x_position": x.tolist(),
        "y_position": (-sign * y).tolist(),
        "starting_x": x[0],
        "ending_x": x[-1],
        "length": vehicle.length / FOOT,
        "width": vehicle.width / FOOT,
        "height": 5.0,
        "direction": sign,
        "coarse_vehicle_class": 4 if vehicle.is_truck else 0,
        "fine_vehicle_class": -1,
        "merged_ids": [[{"$oid": f"{vehicle.number:024x}"}]],
        "road_segment_ids": [-1],
        "flags": [],
    }


def write_i24(path: Path, n_bytes: int) -> None:
    """Writes an array of documents of I-24 MOTION, about `n_bytes` long."""
    with path.open("w", encoding="utf-8") as file:
        for number, vehicle in enumerate(traffic(25.0, n_lanes=4)):
            file.write(",\n" if number else "[")
            file.write(json.dumps(i24_document(vehicle)))
            if file.tell() >= n_bytes:
                break
        file.write("]\n")


def exid_rows(vehicle: Vehicle, rate: float = 25.0) -> pd.DataFrame:
    """Rows in the columns of exiD; a lanelet ends at the middle of the road, where another one begins."""
    x, y = on_plane(vehicle, y_down=False)
    half = (vehicle.along > 0.5 * ROAD_LENGTH).astype(int)
    lanelet = 1000 * vehicle.direction + 100 * half + vehicle.lane
    offset = vehicle.lateral - LANE_WIDTH * (vehicle.lane + 0.5)
    n = len(vehicle.time)
    return pd.DataFrame(
        {
            "recordingId": 0,
            "trackId": vehicle.number,
            "frame": np.rint(rate * vehicle.time).astype(np.int64),
            "trackLifetime": np.arange(n),
            "xCenter": x.round(5),
            "yCenter": y.round(5),
            "heading": 30.0,
            "width": vehicle.width,
            "length": vehicle.length,
            "xVelocity": 0.0,
            "yVelocity": 0.0,
            "xAcceleration": 0.0,
            "yAcceleration": 0.0,
            "lonVelocity": vehicle.speed.round(5),
            "latVelocity": 0.0,
            "lonAcceleration": vehicle.acceleration.round(5),
            "latAcceleration": 0.0,
            "traveledDistance": vehicle.along.round(5),
            "latLaneCenterOffset": offset.round(5).astype(str),
            "laneWidth": str(LANE_WIDTH),
            # Where a lane begins, two lanelets overlap.
            "laneletId": np.where(np.arange(n) == 0, [f"{number};7" for number in lanelet], lanelet.astype(str)),
            "laneChange": np.concatenate([[0], np.abs(np.diff(vehicle.lane))]),
            "lonLaneletPos": vehicle.along.round(5).astype(str),
            "laneletLength": str(0.5 * ROAD_LENGTH),
            **dict.fromkeys(("leadDHW", "leadDV", "leadTHW", "leadTTC"), ""),
            **dict.fromkeys(("leadId", "rearId", "leftLeadId", "leftRearId", "leftAlongsideId"), -1),
            **dict.fromkeys(("rightLeadId", "rightRearId", "rightAlongsideId"), -1),
            "odrRoadId": 1,
            "odrSectionNo": 0,
            "odrLaneId": -1 - vehicle.lane,
        }
    )


def exid_meta(vehicle: Vehicle, rate: float = 25.0) -> dict:
    """Row of NN_tracksMeta.csv."""
    first = round(rate * float(vehicle.time[0]))
    return {
        "recordingId": 0,
        "trackId": vehicle.number,
        "initialFrame": first,
        "finalFrame": first + len(vehicle.time) - 1,
        "numFrames": len(vehicle.time),
        "width": vehicle.width,
        "length": vehicle.length,
        "class": "truck" if vehicle.is_truck else "car",
    }


def write_exid(path: Path, n_bytes: int) -> None:
    """Writes NN_tracks.csv of exiD, about `n_bytes` long, and the two other files beside it.

    Args:
        path: The file, whose name ends in _tracks.csv.
        n_bytes: Length of the file.
    """
    vehicles, meta = traffic(25.0), []
    with path.open("w", encoding="utf-8") as file:
        while file.tell() < n_bytes:
            block = list(islice(vehicles, 6))
            pd.concat([exid_rows(vehicle) for vehicle in block]).to_csv(file, index=False, header=not meta)
            meta += [exid_meta(vehicle) for vehicle in block]
    name = path.name.removesuffix("_tracks.csv")
    pd.DataFrame(meta).to_csv(path.with_name(f"{name}_tracksMeta.csv"), index=False)
    info = {"recordingId": 0, "locationId": 0, "frameRate": 25, "speedLimit": -1, "weekday": "monday"}
    pd.DataFrame([info]).to_csv(path.with_name(f"{name}_recordingMeta.csv"), index=False)


PNEUMA_BEGIN = (37.98, 23.735)
"""Latitude and longitude where the street of `write_pneuma` begins [deg]."""
_DEGREE = (110_995.0, 87_860.0)
"""Lengths of a degree of latitude and of longitude at `PNEUMA_BEGIN` [m]; World Geodetic System 1984."""


def pneuma_stretch(margin: float = 40.0, n_lanes: int = 3) -> tuple[float, ...]:
    """data.stretch for the middle of the street of `write_pneuma`.

    Args:
        margin: Distance of its ends from those of the street [m].
        n_lanes: Lanes.
    """
    middle = np.full(2, 0.5 * n_lanes * LANE_WIDTH)
    latitude, longitude = (values.tolist() for values in _on_globe(np.array([margin, ROAD_LENGTH - margin]), middle))
    return latitude[0], longitude[0], latitude[1], longitude[1], n_lanes * LANE_WIDTH, float(n_lanes)


def _on_globe(along: np.ndarray, lateral: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Latitude and longitude [deg] of points on a street that goes to the north-east; positions in m."""
    east, north = 0.8 * along + 0.6 * lateral, 0.6 * along - 0.8 * lateral
    return PNEUMA_BEGIN[0] + north / _DEGREE[0], PNEUMA_BEGIN[1] + east / _DEGREE[1]


def pneuma_line(vehicle: Vehicle) -> str:
    """The row of a vehicle, without the end of its line; direction 1 drives against the street beside it."""
    ahead = vehicle.direction == 2
    along = vehicle.along if ahead else ROAD_LENGTH - vehicle.along
    lateral = vehicle.lateral if ahead else -MEDIAN - vehicle.lateral
    latitude, longitude = _on_globe(along, lateral)
    columns = (latitude, longitude, 3.6 * vehicle.speed, vehicle.acceleration, 0.0 * vehicle.speed, vehicle.time)
    forms = ("{:.6f}", "{:.6f}", "{:.4f}", "{:.4f}", "{:.4f}", "{:.6f}")
    cells = [
        form.format(value) for moment in zip(*columns, strict=True) for form, value in zip(forms, moment, strict=True)
    ]
    kind = "Bus" if vehicle.is_truck else "Taxi" if vehicle.number % 3 == 0 else "Car"
    mean = 3.6 * float(np.mean(vehicle.speed))
    return "; ".join([str(vehicle.number), kind, f"{np.ptp(vehicle.along):.2f}", f"{mean:.6f}", *cells]) + "; "


PNEUMA_HEADER = "track_id; type; traveled_d; avg_speed; lat; lon; speed; lon_acc; lat_acc; time"


def write_pneuma(path: Path, n_bytes: int) -> None:
    """Writes a file of pNEUMA, about `n_bytes` long; `pneuma_stretch` names its street."""
    with path.open("w", encoding="utf-8") as file:
        file.write(PNEUMA_HEADER + "\n")
        for vehicle in traffic(25.0):
            file.write(pneuma_line(vehicle) + "\n")
            if file.tell() >= n_bytes:
                break
