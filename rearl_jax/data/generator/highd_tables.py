"""Observed tracks as the three tables of highD, with its columns, conventions and image coordinates.

Measured values are floats rounded to two decimals, as highD writes them; counts and identifiers are integers.

Source: highD format (Krajewski et al. 2018, www.highd-dataset.com). Its conventions:

- x and y are the upper left corner of the bounding box, width is the extent of the box along x.
- The id 0 means that there is no vehicle.
- dhw is the difference of x of the two vehicles, ttc = dhw / (v - v_preceding). While the gap opens, ttc is negative.
- Without a preceding vehicle, dhw, thw and ttc are 0. The minima of a track without any preceding vehicle are -1.
"""

from typing import NamedTuple

import numpy as np

from rearl_jax.data.generator.camera import Tracks
from rearl_jax.data.generator.plan import RecordingPlan
from rearl_jax.data.generator.road import LOWER, UPPER
from rearl_jax.data.generator.traffic import FRAME

# Rows are sorted by one number: FRAME_STRIDE * frame + LANE_STRIDE * lane + position [m]. It is unambiguous for up to
# 19 lanes and positions below 1,000 m.
FRAME_STRIDE, LANE_STRIDE = 2.0e4, 1.0e3
NO_VALUE = -1.0
"""What highD writes if a value does not exist."""


Table = dict[str, np.ndarray]


class Sizes(NamedTuple):
    """Class, length and width [m] of the vehicles of a recording, arrays over vehicles."""

    is_truck: np.ndarray
    length: np.ndarray
    width: np.ndarray


def highd_tables(
    plan: RecordingPlan, tracks: Tracks, vehicles: Sizes, direction: np.ndarray, camera_length: float
) -> tuple[Table, Table, Table]:
    """The tables tracks, tracksMeta and recordingMeta of one recording.

    `vehicles` and `direction`, LOWER or UPPER, are those of all vehicles; `camera_length` is what the camera sees [m].
    """
    # highD numbers vehicles by their first frame, and those with the same first frame by position.
    begin = np.flatnonzero(np.diff(tracks.vehicle, prepend=-1))
    n_rows = np.diff(np.append(begin, len(tracks.vehicle)))
    rank = np.lexsort((tracks.position[begin], tracks.frame[begin]))
    number = np.empty(len(begin), dtype=np.int64)
    number[rank] = np.arange(1, len(begin) + 1)
    track_id = np.repeat(number, n_rows)
    order = np.argsort(track_id, kind="stable")
    tracks = Tracks(*(column[order] for column in vars(tracks).values()))
    rows = _tracks_table(plan, tracks, track_id[order], vehicles, direction[tracks.vehicle], camera_length)
    meta = _tracks_meta(rows, vehicles, direction, tracks.vehicle)
    return rows, meta, _recording_meta(plan, meta)


def _tracks_table(
    plan: RecordingPlan,
    tracks: Tracks,
    track_id: np.ndarray,
    vehicles: Sizes,
    direction: np.ndarray,
    camera_length: float,
) -> Table:
    # The upper carriageway is the lower one turned by 180 degrees: x and y both change sign.
    sign = np.where(direction == UPPER, -1.0, 1.0)
    length, width = vehicles.length[tracks.vehicle], vehicles.width[tracks.vehicle]
    centre_x = np.where(direction == LOWER, tracks.position, camera_length - tracks.position)
    centre_y = plan.section.image_y(direction, tracks.lateral)
    lane_id = plan.section.lane_id(centre_y)
    x, x_velocity = _rounded(centre_x - 0.5 * length), _rounded(sign * tracks.speed)
    neighbours = _neighbour_rows(tracks, lane_id, direction, length)
    ids = {name: np.where(row >= 0, track_id[row], 0) for name, row in neighbours.items()}
    preceding = neighbours["precedingId"]
    has_preceding = preceding >= 0
    dhw = np.where(has_preceding, np.abs(x[preceding] - x), 0.0)
    speed = np.abs(x_velocity)
    closing = speed - np.where(has_preceding, np.abs(x_velocity[preceding]), 0.0)
    # A hundredth is the resolution of the file: smaller speeds and speed differences cannot be distinguished from 0.
    ttc = dhw / np.where(np.abs(closing) < 0.01, 0.01, closing)
    return {
        "frame": tracks.frame,
        "id": track_id,
        "x": x,
        "y": _rounded(centre_y - 0.5 * width),
        "width": _rounded(length),
        "height": _rounded(width),
        "xVelocity": x_velocity,
        "yVelocity": _rounded(sign * tracks.lateral_speed),
        "xAcceleration": _rounded(sign * tracks.acceleration),
        "yAcceleration": _rounded(sign * tracks.lateral_acceleration),
        "frontSightDistance": _rounded(camera_length - tracks.position),
        "backSightDistance": _rounded(tracks.position),
        "dhw": _rounded(dhw),
        "thw": _rounded(dhw / np.maximum(speed, 0.01)),
        "ttc": _rounded(np.where(has_preceding, ttc, 0.0)),
        "precedingXVelocity": _rounded(np.where(has_preceding, x_velocity[preceding], 0.0)),
        **ids,
        "laneId": lane_id,
    }


def _neighbour_rows(
    tracks: Tracks, lane_id: np.ndarray, direction: np.ndarray, length: np.ndarray
) -> dict[str, np.ndarray]:
    """Row of every neighbour in the same frame; -1 if there is none.

    A neighbour is alongside if its bounding box overlaps the own one along the road.
    """
    group = tracks.frame * FRAME_STRIDE + lane_id * LANE_STRIDE
    order = np.argsort(group + tracks.position, kind="stable")
    keys = (group + tracks.position)[order]
    groups = group[order]
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))

    def row_at(index: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """Rows at these places in the sorted order; -1 where the row is of another frame or lane than wanted."""
        inside = np.clip(index, 0, len(order) - 1)
        return np.where((inside == index) & (groups[inside] == wanted), order[inside], -1)

    found = {"precedingId": row_at(place + 1, group), "followingId": row_at(place - 1, group)}
    to_left = np.where(direction == UPPER, 1, -1)
    for side, step in (("left", to_left), ("right", -to_left)):
        wanted = group + step * LANE_STRIDE
        index = np.searchsorted(keys, wanted + tracks.position)
        ahead, behind = row_at(index, wanted), row_at(index - 1, wanted)

        def overlaps(row: np.ndarray) -> np.ndarray:
            distance = np.abs(tracks.position[row] - tracks.position)
            return (row >= 0) & (distance < 0.5 * (length[row] + length))

        beside_ahead, beside_behind = overlaps(ahead), overlaps(behind)
        found[f"{side}PrecedingId"] = np.where(beside_ahead, row_at(index + 1, wanted), ahead)
        found[f"{side}AlongsideId"] = np.where(beside_ahead, ahead, np.where(beside_behind, behind, -1))
        found[f"{side}FollowingId"] = np.where(beside_behind, row_at(index - 2, wanted), behind)
    return found


def _tracks_meta(rows: Table, vehicles: Sizes, direction: np.ndarray, vehicle: np.ndarray) -> Table:
    begin = np.flatnonzero(np.diff(rows["id"], prepend=0))
    n_frames = np.diff(np.append(begin, len(rows["id"])))
    end = begin + n_frames - 1
    speed, x = np.abs(rows["xVelocity"]), rows["x"]
    of_track = vehicle[begin]

    def smallest(name: str) -> np.ndarray:
        """Smallest positive value of each track; NO_VALUE if there is none."""
        values = rows[name]
        lowest = np.minimum.reduceat(np.where(values > 0.0, values, np.inf), begin)
        return np.where(np.isfinite(lowest), lowest, NO_VALUE)

    changed = np.diff(rows["laneId"], prepend=rows["laneId"][0]) != 0
    changed[begin] = False
    return {
        "id": rows["id"][begin],
        "width": _rounded(vehicles.length[of_track]),
        "height": _rounded(vehicles.width[of_track]),
        "initialFrame": rows["frame"][begin],
        "finalFrame": rows["frame"][end],
        "numFrames": n_frames,
        "class": np.where(vehicles.is_truck[of_track], "Truck", "Car"),
        "drivingDirection": direction[of_track],
        "traveledDistance": _rounded(np.abs(x[end] - x[begin])),
        "minXVelocity": _rounded(np.minimum.reduceat(speed, begin)),
        "maxXVelocity": _rounded(np.maximum.reduceat(speed, begin)),
        "meanXVelocity": _rounded(np.add.reduceat(speed, begin) / n_frames),
        "minDHW": _rounded(smallest("dhw")),
        "minTHW": _rounded(smallest("thw")),
        "minTTC": _rounded(smallest("ttc")),
        "numLaneChanges": np.add.reduceat(changed.astype(np.int64), begin),
    }


def _recording_meta(plan: RecordingPlan, meta: Table) -> Table:
    n_vehicles = len(meta["id"])
    n_trucks = int(np.sum(meta["class"] == "Truck"))
    limit = plan.section.speed_limit
    values = {
        "id": plan.id,
        "frameRate": round(1.0 / FRAME),
        "locationId": plan.section.location,
        "speedLimit": NO_VALUE if limit is None else limit,
        "month": plan.month,
        "weekDay": plan.week_day,
        "startTime": plan.start_time,
        "duration": plan.duration,
        "totalDrivenDistance": meta["traveledDistance"].sum(),
        "totalDrivenTime": FRAME * meta["numFrames"].sum(),
        "numVehicles": n_vehicles,
        "numCars": n_vehicles - n_trucks,
        "numTrucks": n_trucks,
        "upperLaneMarkings": _joined(plan.section.markings(UPPER)),
        "lowerLaneMarkings": _joined(plan.section.markings(LOWER)),
    }
    columns = {name: np.array([value]) for name, value in values.items()}
    return {name: _rounded(column) if column.dtype.kind == "f" else column for name, column in columns.items()}


def _rounded(values: np.ndarray) -> np.ndarray:
    """The values, rounded to two decimals, the resolution of the file."""
    return np.rint(100.0 * values) / 100.0


def _joined(markings: np.ndarray) -> str:
    return ";".join(f"{y:.2f}" for y in markings)
