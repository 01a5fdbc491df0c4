"""Stated leaders: those that cannot be leaders are faults, and leaders of some vehicles do not speak for all."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.data.checks.leaders import next_in_lane, notes_on_leaders, wrong_leader
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.schema import validate
from rearl_jax.data.vehicle_rows import ABSENT, VehicleRows
from rearl_jax.discovery.read.surroundings import look_around
from tests.refusal import refused

STOP = DataConfig()
DROP_ROW = DataConfig(on_bad=BadRows.drop_row)
INFO = RecordingInfo("made", 10.0, {1: 2, 2: 2}, 300.0, "hand", "none", "nobody", file="made.csv")


def _stating(rows, **leaders):
    """The rows with one leader for each vehicle that is named, such as v1=3."""
    named = {int(name[1:]): leader for name, leader in leaders.items()}
    return rows.assign(leader_id=[named.get(track, np.nan) for track in rows["track_id"]])


def _on_other_carriageway(rows):
    return rows.assign(direction=np.where(rows["track_id"] == 1, 2, 1))


@pytest.mark.parametrize(
    ("spoil", "row", "words"),
    [
        (lambda t: _stating(t, v1=1, v2=2, v3=3), 1, "is itself"),
        (lambda t: _stating(t, v2=2), 101, "is itself"),
        (lambda t: _stating(t, v1=3), 1, "drives behind"),
        (lambda t: _stating(t, v2=1), 101, "in another lane"),
        (lambda t: _stating(_on_other_carriageway(t), v3=1), 201, "on the other carriageway"),
    ],
)
def test_a_leader_that_cannot_be_one_stops_and_can_be_left_out(vehicle_rows, spoil, row, words):
    spoiled = spoil(vehicle_rows)
    with refused("wrong-leader", file="made.csv", column="leader_id", row=row) as caught:
        validate(spoiled, INFO, STOP)
    problem = caught.value.problem
    assert words in problem.fault
    assert f"vehicle {spoiled['track_id'][row - 1]}" in problem.fault
    if spoiled["leader_id"].isna().any():
        table, dropped = validate(spoiled, INFO, DROP_ROW)
        assert dropped == {"wrong_leader": 100, "tracks": 1}
        assert len(table) == 200


def test_a_leader_left_out_in_a_few_frames_cuts_the_track(vehicle_rows):
    spoiled = vehicle_rows.copy()
    spoiled.loc[240:242, "leader_id"] = 3
    table, dropped = validate(spoiled, INFO, DROP_ROW)
    assert dropped == {"wrong_leader": 3, "gap_cuts": 1}
    assert (np.diff(table["frame"])[np.diff(table["track_id"]) == 0] == 1).all()


def test_zero_that_stands_for_none_and_is_an_id_stops(vehicle_rows):
    from_zero = vehicle_rows.assign(track_id=vehicle_rows["track_id"] - 1, leader_id=0)
    with refused("wrong-leader", column="leader_id", row=1):
        validate(from_zero, INFO, STOP)
    with refused("wrong-leader", column="leader_id", row=101):
        validate(_stating(from_zero, v1=0, v2=0), INFO, STOP)


def test_a_leader_may_be_in_another_lane_while_lanes_change(vehicle_rows):
    early = _stating(vehicle_rows.assign(leader_id=np.nan))
    early.loc[100:109, "leader_id"] = 1
    table, _ = validate(early, INFO, STOP)
    assert wrong_leader(table, INFO, STOP) is None
    early.loc[100:110, "leader_id"] = 1
    assert wrong_leader(validate(early.assign(leader_id=np.nan), INFO, STOP)[0], INFO, STOP) is None
    with refused("wrong-leader", row=101):
        validate(early, INFO, STOP)


def test_leaders_of_few_vehicles_do_not_hide_those_that_lanes_tell(vehicle_rows):
    """Vehicles 4 and 5 follow 2 and 3; only 3 states its leader, which is one row in three with somebody ahead."""
    behind = vehicle_rows[vehicle_rows["track_id"] >= 2].copy()
    behind = behind.assign(track_id=behind["track_id"] + 2, position=behind["position"] - 30.0, x=behind["x"] - 30.0)
    rows = pd.concat([_stating(vehicle_rows, v3=1), _stating(behind)], ignore_index=True)
    table, _ = validate(rows, INFO, STOP)
    around = look_around(table, table["speed"].to_numpy())
    leader = np.where(around.leader == NO_VEHICLE, NO_VEHICLE, table["track_id"].to_numpy()[around.leader])
    for track, ahead in ((1, NO_VEHICLE), (2, NO_VEHICLE), (3, 1), (4, 2), (5, 3)):
        assert set(leader[table["track_id"] == track]) == {ahead}
    (note,) = notes_on_leaders(table)
    assert "33%" in note
    stated, _ = validate(_stating(rows, v3=1, v4=2), INFO, STOP)
    around = look_around(stated, stated["speed"].to_numpy())
    assert set(around.leader[stated["track_id"] == 5]) == {NO_VEHICLE}
    assert notes_on_leaders(stated) == []


def test_a_leader_that_is_no_vehicle_is_noted_and_does_not_hide_others(vehicle_rows):
    table, _ = validate(vehicle_rows.assign(leader_id=-1), INFO, STOP)
    (note,) = notes_on_leaders(table)
    assert "-1" in note
    around = look_around(table, table["speed"].to_numpy())
    assert (around.leader[table["track_id"] == 3] != NO_VEHICLE).all()


def test_a_vehicle_between_a_driver_and_the_stated_leader_is_noted(vehicle_rows):
    between = vehicle_rows[vehicle_rows["track_id"] == 1].assign(track_id=4, leader_id=1.0)
    between = between.assign(position=between["position"] - 20.0, x=between["x"] - 20.0, speed=20.0)
    table, _ = validate(pd.concat([vehicle_rows, between], ignore_index=True), INFO, STOP)
    (note,) = notes_on_leaders(table)
    assert "100 of 200" in note


def test_rows_are_found_for_ids_whose_products_would_overflow(vehicle_rows):
    large = vehicle_rows.assign(track_id=vehicle_rows["track_id"] + 2**52, leader_id=float(2**52 + 1))
    table, _ = validate(large.assign(leader_id=large["leader_id"].where(large["track_id"] == 2**52 + 3)), INFO, STOP)
    leaders = VehicleRows(table).leaders(table)
    np.testing.assert_array_equal(leaders, np.r_[np.full(200, ABSENT), np.arange(100)])
    np.testing.assert_array_equal(leaders, next_in_lane(table))
    assert VehicleRows(table).rows(7, np.arange(3)).tolist() == [ABSENT] * 3
    assert VehicleRows(table.iloc[:0]).rows(7, np.arange(3)).tolist() == [ABSENT] * 3


def test_without_lanes_lateral_positions_tell_who_drives_beside(vehicle_rows):
    rows = vehicle_rows.drop(columns="lane")
    validate(_stating(rows, v3=1), INFO, STOP)
    with refused("wrong-leader", row=201):
        validate(_stating(rows, v3=2), INFO, STOP)
