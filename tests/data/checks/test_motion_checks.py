"""Faults that begin within a track: found by stretches of some seconds, and what measuring brings about is none."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.schema import validate
from tests.data.made_rows import car_rows
from tests.refusal import refused

RATE = 10.0
STOP = DataConfig()
DROP_ROW = DataConfig(on_bad=BadRows.drop_row)
INFO = RecordingInfo("made", RATE, {1: 2}, 1200.0, "hand", "none", "nobody", file="made.csv")


@pytest.fixture
def waves() -> pd.DataFrame:
    """Three vehicles, 60 s at 10 Hz, of changing speed and acceleration."""
    time = np.arange(600) / RATE
    parts = []
    for track in range(1, 4):
        phase = 0.5 * time + track
        position = 40.0 * track + 13.0 * time - 8.0 * np.cos(phase)
        parts.append(car_rows(track, position, 13.0 + 4.0 * np.sin(phase), 2.0 * np.cos(phase), lane_width=3.6))
    rows = pd.concat(parts, ignore_index=True)
    assert validate(rows, INFO, STOP)[1] == {}
    return rows


def _frozen(rows: pd.DataFrame, part: pd.Series) -> pd.DataFrame:
    """The rows with positions that stand in a part of one track."""
    first = rows.index[part][0]
    places = {name: rows[name].mask(part, rows.loc[first, name]) for name in ("x", "position")}
    return rows.assign(**places)


@pytest.mark.parametrize(("column", "factor"), [("speed", 0.0), ("speed", 0.4), ("speed", 1.944), ("acceleration", -1)])
@pytest.mark.parametrize("tracks", [[2], [1, 2, 3]])
def test_a_fault_in_less_than_half_of_a_track_is_found(waves, column, factor, tracks):
    part = waves["track_id"].isin(tracks) & (waves["frame"] >= 400)
    wrong = waves.assign(**{column: waves[column].mask(part, factor * waves[column])})
    if column == "speed":
        wrong = wrong.drop(columns="acceleration")
    with refused("wrong-motion", column=column) as caught:
        validate(wrong, INFO, STOP)
    assert int(waves.index[part][0]) - 80 < caught.value.problem.row <= int(waves.index[part][0]) + 10
    table, dropped = validate(wrong, INFO, DROP_ROW)
    n_wrong = int(part.sum())
    assert n_wrong - 10 * len(tracks) <= dropped["wrong_motion"] <= n_wrong + 80 * len(tracks)
    assert len(table) + dropped["wrong_motion"] == len(waves)


@pytest.mark.parametrize("columns", [["position", "x"], ["x"]])
def test_positions_that_stand_while_the_vehicle_drives_are_found(waves, columns):
    wrong = _frozen(waves, (waves["track_id"] == 2) & (waves["frame"] >= 400))
    wrong = waves.assign(**{name: wrong[name] for name in columns})
    with refused("wrong-motion", column="speed" if "position" in columns else "x"):
        validate(wrong, INFO, STOP)


def test_what_measuring_brings_about_is_no_fault(waves):
    noise = np.random.default_rng(0).normal(size=(2, len(waves)))
    by_track = waves.groupby("track_id")
    sound = {
        "noise": waves.assign(position=waves["position"] + 0.3 * noise[0], x=waves["x"] + 0.3 * noise[1]),
        "late speeds": waves.assign(speed=by_track["speed"].shift(10).bfill()),
        "rounded speeds": waves.assign(speed=waves["speed"].round()),
        "speeds missing for a second": waves.assign(speed=waves["speed"].mask(waves["frame"].between(300, 309), 0.0)),
        "noise of accelerations": waves.assign(acceleration=waves["acceleration"] + noise[0]),
        "no accelerations for a time": waves.assign(acceleration=waves["acceleration"].mask(waves["frame"] > 400, 0.0)),
    }
    patient = DataConfig(max_jump=200.0)
    for name, rows in sound.items():
        assert (name, validate(rows, INFO, patient)[1]) == (name, {})


def test_a_stop_that_late_speeds_show_late_is_no_fault(waves):
    time = waves["frame"] / RATE
    speed = np.clip(15.0 - 5.0 * (time - 20.0), 0.0, 15.0)
    position = 100.0 * waves["track_id"] + np.cumsum(speed.to_numpy()) / RATE
    position -= position.groupby(waves["track_id"]).transform("first") - 100.0 * waves["track_id"]
    late = speed.groupby(waves["track_id"]).shift(10).bfill()
    rows = waves.assign(position=position, x=position, speed=late).drop(columns="acceleration")
    assert validate(rows, INFO, STOP)[1] == {}


def test_a_direction_that_no_road_has_is_named_and_not_taken_for_a_carriageway(waves):
    with refused("wrong-direction", column="direction", row=1):
        validate(waves.assign(direction=waves["direction"].mask(waves["frame"] % 6 == 0, -1)), INFO, STOP)
