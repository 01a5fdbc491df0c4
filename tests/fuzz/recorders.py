"""The same traffic in the layouts of drones, instrumented cars and simulators."""

import numpy as np
import pandas as pd

from tests.fuzz.traffic import LANE, N_FRAMES, Source, source, traffic


def tgsim() -> Source:
    """A table of TGSIM, whose y points down."""
    here = traffic(10.0)
    table = pd.DataFrame(
        {
            "id": here["track_id"],
            "time": (here["frame"] / 10.0).round(1),
            "xloc-kf": here["position"].round(3),
            "yloc-kf": here["lateral"].round(3),
            "lane-kf": here["lane"] + 1,
            "speed-kf": here["speed"].round(3),
            "acceleration-kf": here["acceleration"].round(3),
            "length-smoothed": here["length"],
            "width-smoothed": here["width"],
            "type-most-common": np.where(here["vehicle_class"] == "truck", "large-vehicle", "small-vehicle"),
            "av": np.where(here["track_id"] == 3, "yes", "no"),
            "run-index": 1,
        }
    )
    return source({"I294_L1_final.csv": table})


def exid() -> Source:
    """The three files of exiD, whose y points north, at 25 frames per second."""
    here = traffic(25.0)
    tracks = pd.DataFrame(
        {
            "recordingId": 0,
            "trackId": here["track_id"],
            "frame": here["frame"],
            "xCenter": here["position"].round(5),
            "yCenter": -here["lateral"].round(5),
            "width": here["width"],
            "length": here["length"],
            "lonVelocity": here["speed"].round(5),
            "lonAcceleration": here["acceleration"].round(5),
            "laneletId": 1000 + here["lane"],
            "laneChange": 0,
        }
    )
    ids = np.arange(1, 9)
    kinds = np.where(ids > 6, "truck", "car")
    meta = pd.DataFrame({"recordingId": 0, "trackId": ids, "numFrames": N_FRAMES, "class": kinds})
    recording = pd.DataFrame({"recordingId": [0], "locationId": [0], "frameRate": [25.0], "speedLimit": [33.33]})
    return source({"00_tracks.csv": tracks, "00_tracksMeta.csv": meta, "00_recordingMeta.csv": recording})


def openacc_raw() -> Source:
    """A run of four cars as OpenACC publishes it."""
    here = traffic(10.0)
    cars = [here[here["track_id"] == vehicle].reset_index(drop=True) for vehicle in (2, 4, 6, 8)]
    columns: dict[str, np.ndarray | pd.Series] = {"Time": (30.0 + np.arange(N_FRAMES) / 10.0).round(1)}
    for k, car in enumerate(cars, 1):
        columns |= {f"Speed{k}": car["speed"].round(4), f"E{k}": car["position"].round(3), f"N{k}": car["lateral"]}
    for k, (ahead, behind) in enumerate(zip(cars[:-1], cars[1:], strict=True), 1):
        columns[f"IVS{k}"] = (ahead["position"] - behind["position"] - 4.5).round(4)
    table = pd.DataFrame(columns).assign(Driver2="ACC")
    head = "Date,9,10,2019\nVehicle_order,A,B,C,D\nNumber_of_vehicles,4\nACC,1\nDistance_setting,S\n"
    return source({"part1.csv": table}, heads={"part1.csv": head})


def vissim() -> Source:
    """A vehicle record of Vissim: fronts on one link, lanes from the right."""
    here = traffic(10.0)
    table = pd.DataFrame(
        {
            "SIMSEC": (here["frame"] / 10.0).round(1),
            "NO": here["track_id"],
            r"LANE\LINK\NO": 1,
            r"LANE\INDEX": 2 - here["lane"],
            "POS": (here["position"] + here["length"] / 2).round(3),
            "POSLAT": (1.0 - here["lateral"] / LANE % 1.0).round(2),
            "SPEED": (3.6 * here["speed"]).round(3),
            "VEHTYPE": np.where(here["vehicle_class"] == "truck", 200, 100),
            "LENGTH": here["length"],
        }
    )
    head = "$VISION\n* POS: Pos, Position [m]\n* SPEED: Speed, Speed [km/h]\n* LENGTH: Length, Length [m]\n$VEHICLE:"
    return source({"run.fzp": table}, heads={"run.fzp": head}, delimiters={"run.fzp": ";"})


def sumo() -> Source:
    """SUMO's floating car data as a table: fronts, lanes from the right, and the types in a file next to it."""
    here = traffic(10.0)
    table = pd.DataFrame(
        {
            "timestep_time": (here["frame"] / 10.0).round(1),
            "vehicle_id": here["track_id"].map("flow.{}".format),
            "vehicle_x": (here["position"] + here["length"] / 2).round(2),
            "vehicle_y": -here["lateral"].round(2),
            "vehicle_angle": 90.0,
            "vehicle_type": here["vehicle_class"],
            "vehicle_speed": here["speed"].round(2),
            "vehicle_pos": (here["position"] + here["length"] / 2).round(2),
            "vehicle_lane": (1 - here["lane"]).map("e_{}".format),
        }
    )
    types = '<vType id="car" vClass="passenger" length="4.5"/><vType id="truck" vClass="truck" length="12"/>'
    texts = {"types.rou.xml": f"<routes>{types}</routes>"}
    return source({"fcd.csv": table}, texts=texts, delimiters={"fcd.csv": ";"})
