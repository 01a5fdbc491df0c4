"""Notes on what is read without a fault: overlaps, and lanes that do not fit lateral positions."""

import numpy as np
import pandas as pd
import pytest

from tests.data.table_files import read_rows


def _notes(rows):
    return read_rows(rows.assign(time=rows["frame"] / 10.0)).info.notes[1:]


def test_sound_rows_need_no_note(vehicle_rows):
    assert _notes(vehicle_rows) == ()


@pytest.mark.parametrize("without", [[], ["lane"]])
def test_vehicles_inside_each_other_are_counted(vehicle_rows, without):
    close = vehicle_rows.assign(leader_id=np.nan)
    close.loc[close["track_id"] == 3, ["position", "x"]] += 38.0
    close.loc[close["track_id"] == 2, ["position", "x"]] += 200.0
    (note,) = _notes(close.drop(columns=without))
    gap = 2.0 + 0.2 * np.arange(100) - 8.25
    assert note.startswith(f"{(gap < 0).sum()} of 100 rows overlap")


def test_vehicles_of_one_lane_are_in_it_without_saying_so(vehicle_rows):
    own = vehicle_rows[vehicle_rows["track_id"] == 1].drop(columns=["lane", "lateral", "leader_id"])
    twin = pd.concat([own, own.assign(track_id=4)], ignore_index=True)
    (note,) = _notes(twin)
    assert note.startswith("100 of 100 rows overlap")
    stated = twin.assign(leader_id=np.where(twin["track_id"] == 4, 77, np.nan))  # tells who is ahead
    assert not any("overlap" in note for note in _notes(stated))
    behind = own.assign(track_id=4, position=own["position"] - 20.0, x=own["x"] - 20.0)
    assert _notes(pd.concat([own, behind], ignore_index=True)) == ()


def test_a_few_negative_lateral_positions_are_noted(vehicle_rows):
    few = vehicle_rows.drop(columns="lane")
    for name in ("lateral", "y"):
        few.loc[few["track_id"] == 1, name] = np.linspace(-0.8, 1.8, 100)
    (note,) = _notes(few)
    assert note.startswith("direction 1: lateral is negative in 12 rows")


def test_lateral_positions_far_right_of_their_lanes_are_noted(vehicle_rows):
    (note,) = _notes(vehicle_rows.assign(lateral=vehicle_rows["lateral"] + 7.0, y=vehicle_rows["y"] + 7.0))
    assert "further to the right" in note


def test_a_vehicle_beside_its_lane_is_counted(vehicle_rows):
    others = vehicle_rows[vehicle_rows["track_id"] != 3].assign(leader_id=np.nan)
    further = others.assign(track_id=others["track_id"] + 10, position=others["position"] + 60.0, x=others["x"] + 60.0)
    beside = others[others["track_id"] == 1].assign(track_id=30, lateral=5.25, y=5.25)
    beside = beside.assign(position=beside["position"] + 30.0, x=beside["x"] + 30.0)
    assert _notes(pd.concat([others, further], ignore_index=True)) == ()
    (note,) = _notes(pd.concat([others, further, beside], ignore_index=True))
    assert note.startswith("direction 1: 1 vehicles are a lane beside")


def test_vehicles_that_all_begin_abreast_are_noted(vehicle_rows):
    own = vehicle_rows[vehicle_rows["track_id"] == 1].assign(leader_id=np.nan).drop(columns=["lane", "lateral"])
    parts = [own.assign(track_id=track, position=own["position"] + 0.1 * track) for track in range(1, 14)]
    begun, inside = "all 13 vehicles begin at the same time", " rows overlap"
    assert [begun in note or inside in note for note in _notes(pd.concat(parts, ignore_index=True))] == [True, True]
    (note,) = _notes(pd.concat(parts[:12], ignore_index=True))
    assert inside in note


def test_an_acceleration_that_never_changes_is_noted_where_speeds_do(vehicle_rows):
    braking = vehicle_rows.copy()
    own = braking["track_id"] == 2
    time = np.arange(100) / 10.0
    braking.loc[own, "speed"] = 22.0 - 0.5 * time
    braking.loc[own, "position"] = braking.loc[own, "x"] = 40.0 + 22.0 * time - 0.25 * time**2
    (note,) = _notes(braking)
    assert note.startswith("acceleration is 0 m/s^2 in every row")
    braking.loc[own, "acceleration"] = -0.5
    assert _notes(braking) == ()


def test_vehicles_that_change_class_or_length_are_counted(vehicle_rows):
    own = vehicle_rows["track_id"] == 2
    flips = own & (vehicle_rows["frame"] % 2 == 0)
    (note,) = _notes(vehicle_rows.assign(vehicle_class=vehicle_rows["vehicle_class"].mask(flips, "truck")))
    assert note == "1 vehicles change their class"
    (note,) = _notes(vehicle_rows.assign(length=vehicle_rows["length"].mask(flips, 6.0)))
    assert note == "1 vehicles change their length by more than 1 m"
    assert _notes(vehicle_rows.assign(length=vehicle_rows["length"].mask(flips, 4.7))) == ()


def test_cars_as_long_as_trucks_are_counted(vehicle_rows):
    cars = vehicle_rows.assign(vehicle_class="car", length=4.5)
    one = cars["track_id"] == 2
    (note,) = _notes(cars.assign(length=cars["length"].mask(one, 14.4)))
    assert note.startswith("1 of 3 cars are longer than 9.8 m")
    assert _notes(cars.assign(length=cars["length"].mask(one, 6.9))) == ()


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_speeds_that_fall_in_one_frame_are_counted(vehicle_rows, value):
    unknown = (vehicle_rows["track_id"] == 2) & vehicle_rows["frame"].isin([30, 60])
    rows = vehicle_rows.drop(columns="acceleration")
    (note,) = _notes(rows.assign(speed=rows["speed"].mask(unknown, value)))
    assert note.startswith(f"speeds fall to {value:g} m/s 2 times in one frame, from up to 22.0 m/s")


def test_a_vehicle_that_drives_long_after_all_others_is_noted(vehicle_rows):
    late = vehicle_rows["frame"] + 12_000 * (vehicle_rows["track_id"] == 2)
    (note,) = _notes(vehicle_rows.assign(frame=late))
    assert note.startswith("no vehicle is recorded for 1190 s, between 2 vehicles and 1 others")


def test_cars_that_are_too_short_are_noted(vehicle_rows):
    twin = vehicle_rows[vehicle_rows["track_id"] == 2].assign(track_id=4, position=vehicle_rows["position"] + 60.0)
    rows = pd.concat([vehicle_rows, twin.assign(x=twin["position"])], ignore_index=True)
    (note,) = _notes(rows.assign(length=rows["length"].mask(rows["track_id"] == 2, 1.4)))
    assert note.startswith("1 of 3 cars are shorter")


@pytest.mark.parametrize("name", ["Leader_ID", "leader", "leader_id [-]", "Preceding"])
def test_a_column_that_is_not_read_for_its_name_is_noted(timed_rows, name):
    (note,) = _notes(timed_rows.rename(columns={"leader_id": name}))
    assert f"leader_id: {name}" in note


@pytest.mark.parametrize("factor", [0.96, 1.0, 1.04])
def test_a_frame_rate_that_is_slightly_wrong_is_noted(vehicle_rows, factor):
    notes = _notes(vehicle_rows.assign(speed=factor * vehicle_rows["speed"]))
    assert [f"{1.0 / factor:.3f} times" in note for note in notes] == ([] if factor == 1.0 else [True])
