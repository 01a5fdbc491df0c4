"""Columns of one carriageway, single vehicles and placeholders: what a median over all rows hides is found."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.schema import validate
from tests.data.made_rows import car_rows
from tests.refusal import refused

STOP = DataConfig()
DROP_ROW = DataConfig(on_bad=BadRows.drop_row)
INFO = RecordingInfo("made", 25.0, {1: 2, 2: 2}, 300.0, "hand", "none", "nobody", file="made.csv")


@pytest.fixture
def braking() -> pd.DataFrame:
    """Vehicles 1 to 3 on carriageway 1 and 4 to 6 on 2, 4 s at 25 Hz, of changing speed and acceleration."""
    time = np.arange(100) / 25.0
    parts = []
    for track in range(1, 7):
        acceleration = np.cos(1.5 * time + track)
        speed = 15.0 + np.sin(1.5 * time + track) / 1.5
        position = 30.0 * (track % 3) + 15.0 * time - np.cos(1.5 * time + track) / 1.5**2
        parts.append(car_rows(track, position, speed, acceleration, lane=track % 2, direction=1 + (track > 3)))
    rows = pd.concat(parts, ignore_index=True)
    assert validate(rows, INFO, STOP)[1] == {}
    return rows


def _scaled(rows: pd.DataFrame, where: pd.Series, **factors: float) -> pd.DataFrame:
    return rows.assign(**{name: rows[name].where(~where, rows[name] * factor) for name, factor in factors.items()})


@pytest.mark.parametrize(
    ("column", "factor"),
    [
        ("position", -1.0),
        ("position", 3.28084),
        ("speed", 3.6),
        ("speed", 1 / 3.6),
        ("speed", 0.0),
        ("x", 3.28084),
        ("length", 3.28084),
        ("width", 3.28084),
        ("lateral", 3.28084),
        ("acceleration", -1.0),
        ("acceleration", 3.28084),
    ],
)
@pytest.mark.parametrize("side", [1, 2])
@pytest.mark.parametrize("policy", [STOP, DROP_ROW])
def test_one_carriageway_in_another_unit_stops_whatever_the_policy(braking, column, factor, side, policy):
    spoiled = _scaled(braking, braking["direction"] == side, **{column: factor})
    with refused("wrong-units") as caught:
        validate(spoiled, INFO, policy)
    problem = caught.value.problem
    assert problem.column in {column, "speed"}
    assert f"direction {side}" in problem.fault
    assert (problem.row - 1) // 300 == side - 1


@pytest.mark.parametrize(
    ("column", "factor"),
    [("position", -1.0), ("speed", 0.0), ("speed", 3.6), ("speed", 0.3048), ("x", 3.28084), ("acceleration", -1.0)],
)
def test_one_vehicle_that_moves_otherwise_stops_or_is_left_out(braking, column, factor):
    spoiled = _scaled(braking, braking["track_id"] == 3, **{column: factor})
    with refused("wrong-motion", row=201) as caught:
        validate(spoiled, INFO, STOP)
    assert caught.value.problem.column == ("speed" if column == "position" else column)
    assert "vehicle 3" in caught.value.problem.fault
    table, dropped = validate(spoiled, INFO, DROP_ROW)
    assert dropped == {"wrong_motion": 100, "tracks": 1}
    assert sorted(table["track_id"].unique()) == [1, 2, 4, 5, 6]


def test_a_vehicle_that_stands_or_jumps_once_does_not_move_otherwise(braking):
    stands = braking.copy()
    here = stands["track_id"] == 3
    rng = np.random.default_rng(0)
    place = stands["position"].where(~here, 50.0 + rng.normal(0.0, 0.05, 600))
    stands = stands.assign(position=place, x=place)
    stands.loc[here, ["speed", "acceleration"]] = 0.0
    assert validate(stands, INFO, STOP)[1] == {}
    later = here & (braking["frame"] >= 50)
    jumps = braking.assign(position=braking["position"] + 90.0 * later, x=braking["x"] + 90.0 * later)
    assert validate(jumps, INFO, DROP_ROW)[1] == {"jump_cuts": 1}


@pytest.mark.parametrize(("rate", "size", "is_jump"), [(10.0, 1.9, False), (10.0, 2.1, True), (25.0, 0.9, True)])
def test_a_jump_is_bounded_per_time_and_not_per_frame(braking, rate, size, is_jump):
    info = RecordingInfo("made", rate, {1: 2, 2: 2}, 300.0, "hand", "none", "nobody")
    time = braking["frame"] / rate
    still = braking.assign(speed=15.0, acceleration=0.0, position=15.0 * time, x=15.0 * time)
    later = (still["track_id"] == 3) & (still["frame"] >= 50)
    moved = still.assign(position=still["position"] + size * later, x=still["x"] + size * later)
    assert validate(moved, info, DROP_ROW)[1] == ({"jump_cuts": 1} if is_jump else {})


# Where lanes and lateral positions count from


def test_lanes_that_count_from_one_stop(braking):
    three_lanes = replace(INFO, lane_count={1: 3, 2: 3})
    with refused("wrong-origin", column="lane", row=1) as caught:
        validate(braking.assign(lane=braking["lane"] + 1), three_lanes, STOP)
    assert "subtract 1" in caught.value.problem.remedy
    one_side = braking.assign(lane=braking["lane"] + (braking["direction"] == 2))
    with refused("wrong-origin", column="lane", row=301):
        validate(one_side, three_lanes, STOP)


def test_a_left_lane_that_nobody_uses_is_no_fault(braking):
    shifted = braking.assign(lane=braking["lane"] + 1, lateral=braking["lateral"] + 3.5, y=braking["y"] + 3.5)
    assert validate(shifted, replace(INFO, lane_count={1: 3, 2: 3}), STOP)[1] == {}


def test_lateral_positions_left_of_the_road_stop(braking):
    with refused("wrong-origin", column="lateral", row=1):
        validate(braking.drop(columns="lane").assign(lateral=-braking["lateral"]), INFO, STOP)
    with refused("wrong-origin", column="lateral", row=1):
        validate(braking.assign(lateral=braking["lateral"] - 7.0), INFO, STOP)
    middle = braking.drop(columns="lane").assign(lateral=1.0 + 1.75 - braking["lateral"])  # positive to the left
    with refused("wrong-origin", column="lateral"):
        validate(middle.drop(columns="y").assign(y=middle["lateral"]), INFO, STOP)


# Placeholders


@pytest.mark.parametrize(
    ("column", "value", "code"),
    [
        ("lane", -1, "lane-out-of-range"),
        ("lane", 99, "lane-out-of-range"),
        ("acceleration", -9999.0, "out-of-range"),
        ("acceleration", 999.0, "out-of-range"),
        ("speed", -1.0, "out-of-range"),
        ("speed", -999.0, "out-of-range"),
        ("length", -1.0, "out-of-range"),
        ("width", 9999.0, "out-of-range"),
        ("position", -9999.0, "out-of-range"),
        ("x", 99999.0, "out-of-range"),
        ("y", -9999.0, "out-of-range"),
        ("lateral", -9999.0, "out-of-range"),
    ],
)
@pytest.mark.parametrize("share", [0.04, 0.4])
def test_a_placeholder_is_named_and_can_be_left_out(braking, column, value, code, share):
    unknown = (braking["frame"] >= 30) & (braking["frame"] < 30 + 100 * share)
    spoiled = braking.astype({column: float})
    spoiled.loc[unknown, column] = value
    with refused(code, column=column, row=31) as caught:
        validate(spoiled, INFO, STOP)
    assert f"{value:g}" in caught.value.problem.fault
    table, dropped = validate(spoiled, INFO, DROP_ROW)
    assert dropped == {code.replace("-", "_"): int(unknown.sum()), "gap_cuts": 6}
    assert len(table) == 600 - unknown.sum()


def test_an_unknown_column_written_as_a_placeholder_is_named(braking):
    with refused("out-of-range", column="acceleration", row=1):
        validate(braking.assign(acceleration=-9999.0), INFO, STOP)
    with refused("lane-out-of-range", column="lane", row=1):
        validate(braking.assign(lane=-1), INFO, STOP)


@pytest.mark.parametrize(("value", "n_rows"), [(16.1, 30), (-16.1, 30), (12.7, 30), (16.1, 7)])
def test_one_acceleration_beyond_all_others_is_a_placeholder_also_in_a_few_rows(braking, value, n_rows):
    unknown = (braking["track_id"] == 4) & (braking["frame"] < n_rows)
    rows = braking.assign(acceleration=braking["acceleration"].mask(unknown, value))
    with refused("out-of-range", column="acceleration", row=301):
        validate(rows, INFO, STOP)
    assert validate(rows, INFO, DROP_ROW)[1]["out_of_range"] == unknown.sum()
    with refused("wrong-units", column="acceleration"):  # several values beyond friction are another unit
        validate(_scaled(braking, braking["track_id"] > 0, acceleration=16.0), INFO, STOP)


def test_what_a_cut_track_reveals_is_found_before_the_result_is_handed_on(braking):
    """Behind a jump the vehicle moves against its speed, but its whole track moves as its speed says."""
    time = braking["frame"] / 25.0
    forth = 8.0 * time.clip(upper=1.8)
    back = np.where(time > 1.8, 34.0 - 8.0 * (time - 1.8), 0.0)
    here = braking["track_id"] == 3
    place = braking["position"].where(~here, forth + back)
    spoiled = braking.assign(position=place, x=place, speed=braking["speed"].where(~here, 8.0))
    table, dropped = validate(spoiled.assign(acceleration=np.nan), INFO, DROP_ROW)
    assert dropped == {"jump_cuts": 1, "wrong_motion": 54, "tracks": 1}
    assert validate(table, INFO, STOP)[1] == {}


@pytest.mark.parametrize("degrees", [-10.0, 2.0, 10.0])
def test_a_road_at_an_angle_to_the_positions_is_refused(braking, degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    along, across = braking["position"], braking["lateral"]
    turned = braking.assign(position=along * c - across * s, lateral=50.0 + along * s + across * c)
    turned = turned.assign(x=turned["position"], y=turned["lateral"], lane=0)
    with refused("wrong-units", column="position"):
        validate(turned, INFO, STOP)


def test_a_change_of_lane_is_no_angle(braking):
    changing = braking["lateral"] + 3.5 * np.linspace(0.0, 1.0, 100)[braking["frame"]] * (braking["track_id"] <= 2)
    rows = braking.assign(lateral=changing, y=changing, lane=np.floor(changing / 3.5).astype(int))
    assert validate(rows, replace(INFO, lane_count={1: 3, 2: 3}), STOP)[1] == {}


def test_missing_frames_on_one_carriageway_are_no_other_unit_of_acceleration(braking):
    sparse = braking[(braking["direction"] == 1) | (braking["frame"] % 2 == 0)]
    with refused("gap", column="frame", row=303):
        validate(sparse, INFO, STOP)


def differentiated(rows: pd.DataFrame, noise: float) -> pd.DataFrame:
    """The rows with noisy positions [m], and with speeds and accelerations that are differences of them."""
    noisy = rows.assign(position=rows["position"] + np.random.default_rng(0).normal(0.0, noise, len(rows)))
    for name, source in (("speed", "position"), ("acceleration", "speed")):
        noisy[name] = noisy.groupby("track_id")[source].transform(lambda values: np.gradient(values, 1 / 25.0))
    return noisy.assign(x=noisy["position"], speed=noisy["speed"].clip(lower=0.0))


def test_noise_of_differentiated_positions_is_no_other_unit(braking):
    noisy = differentiated(braking, 0.03)
    assert np.percentile(noisy["acceleration"].abs(), 99) > 20.0
    assert validate(noisy, INFO, STOP)[1] == {}
    with refused("wrong-units", column="acceleration"):
        validate(_scaled(noisy, noisy["track_id"] > 0, acceleration=0.3048), INFO, STOP)


def test_noise_of_unsmoothed_positions_is_no_jump(braking):
    noisy = differentiated(braking, 0.2).drop(columns="acceleration")
    step = noisy.groupby("track_id")["position"].diff()
    assert (step - noisy["speed"] / 25.0).abs().max() > 20.0 / 25.0, "beyond data.max_jump"
    assert validate(noisy, INFO, STOP)[1] == {}
    jumped = noisy.assign(**{name: noisy[name] + 10.0 * (noisy["frame"] > 50) for name in ("position", "x")})
    assert validate(jumped, INFO, DROP_ROW)[1]["jump_cuts"] == 6
