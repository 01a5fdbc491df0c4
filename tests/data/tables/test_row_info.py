"""Properties of a recording from its rows: frame rates from rounded times, units of times, roads far from 0."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows
from rearl_jax.data.checks import clock
from rearl_jax.data.tables.row_info import info_of_rows
from tests.data.table_files import read_rows
from tests.refusal import refused


def _at(rows, rate, decimals=None, start=0.0):
    """The rows at another frame rate, with times that are rounded."""
    time = (rows["frame"] - rows["frame"].min()) / rate
    position = rows["track_id"] * -40.0 + 200.0 + rows["speed"] * time
    time = start + time
    return rows.assign(time=time if decimals is None else time.round(decimals), position=position, x=position)


@pytest.mark.parametrize(
    ("rate", "decimals"),
    [(30.0, 2), (30.0, 3), (25.0, 2), (25.0, 1), (10.0, 0), (12.5, 2), (29.97, None), (15.0, 1), (7.3, None), (1.0, 0)],
)
@pytest.mark.parametrize("start", [0.0, 1_620_000_000.0])
def test_rounded_times_tell_the_frame_rate(vehicle_rows, rate, decimals, start):
    recording = read_rows(_at(vehicle_rows, rate, decimals, start))
    assert recording.info.frame_rate == pytest.approx(rate, abs=1e-3 if rate == 29.97 else 0.0)
    assert len(recording.table) == 300
    is_coarse = decimals is not None and 10.0**-decimals > 1.0 / rate
    assert any("times are rounded" in note for note in recording.info.notes) == is_coarse


def test_a_damaged_length_or_position_does_not_move_the_others(vehicle_rows):
    rows = _at(vehicle_rows, 10.0)
    sound = read_rows(rows)
    rows.loc[[30, 31], "length"] = 999.0
    rows.loc[60:66, "position"] = 1e9
    recording = read_rows(rows, on_bad=BadRows.drop_row)
    assert recording.dropped["out_of_range"] == 9
    assert recording.info.road_length == sound.info.road_length
    assert recording.table["position"].iloc[0] == sound.table["position"].iloc[0]


def test_whole_seconds_cut_off_tell_the_frame_rate(vehicle_rows):
    rows = _at(vehicle_rows, 10.0)
    assert read_rows(rows.assign(time=np.floor(rows["time"]))).info.frame_rate == 10.0


def test_a_few_wrong_times_do_not_move_the_frame_rate(vehicle_rows):
    rows = _at(vehicle_rows, 30.0, 2)
    rows.loc[[0, 99, 150, 299], "time"] = 9999.0
    _, info = info_of_rows("made", rows, "made.csv", "made")
    assert info.frame_rate == 30.0


def test_jitter_makes_no_unusual_frame_rate(vehicle_rows):
    rows = _at(vehicle_rows, 25.0)
    jitter = np.random.default_rng(0).normal(0.0, 0.004, len(rows))
    assert read_rows(rows.assign(time=rows["time"] + jitter)).info.frame_rate == 25.0
    single = (1e4 + rows["time"]).astype(np.float32)
    assert read_rows(rows.assign(time=single)).info.frame_rate == 25.0


@pytest.mark.parametrize("absurd", [1e30, 2.0**63])
def test_an_absurd_time_hides_no_step(vehicle_rows, absurd):
    rows = _at(vehicle_rows, 25.0)
    rows.loc[[30, 150], "time"] = absurd
    with refused("not-finite", column="time", row=31):
        read_rows(rows)


@pytest.mark.parametrize("column", ["track_id", "frame"])
def test_a_column_that_is_empty_is_named(vehicle_rows, column):
    with refused("frame-rate-unknown", column=column):
        read_rows(_at(vehicle_rows, 25.0).assign(**{column: np.nan}))


def test_rows_that_are_there_twice_and_single_rows_are_named_without_frames(vehicle_rows):
    rows = _at(vehicle_rows, 25.0).drop(columns="frame")
    with refused("duplicate", column="frame", row=301):
        read_rows(pd.concat([rows, rows], ignore_index=True))
    with refused("frames-unknown", column="time") as caught:
        read_rows(rows.drop_duplicates("track_id"))
    assert "two rows" in caught.value.problem.fault


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9), ("min", 1 / 60), ("h", 1 / 3600)])
def test_times_in_another_unit_are_read_and_said(vehicle_rows, unit, factor):
    rows = _at(vehicle_rows, 10.0)
    found = read_rows(rows.assign(time=rows["time"] * factor))
    assert found.info.frame_rate == 10.0
    np.testing.assert_allclose(found.table["time"], read_rows(rows).table["time"], atol=1e-6)
    assert any(f"time taken to be in {unit}," in note for note in found.info.notes)
    still = rows.assign(position=200.0 - rows["track_id"] * 20.0, speed=0.0)
    if factor >= 1e3:
        assert read_rows(still.assign(x=still["position"], time=rows["time"] * factor)).info.frame_rate == 10.0


def test_a_wrong_speed_does_not_hide_the_unit_of_time(vehicle_rows):
    rows = _at(vehicle_rows, 10.0)
    with refused("wrong-units", column="speed"):
        read_rows(rows.assign(time=rows["time"] * 1e3, speed=rows["speed"] * 3.6))


def test_times_that_count_something_else_are_asked_for(vehicle_rows):
    rows = _at(vehicle_rows, 10.0)
    with refused("time-unit-unknown", column="time") as caught:
        read_rows(rows.assign(time=rows["frame"]))
    assert "data.units={time: 10/s}" in caught.value.problem.remedy
    still = rows.assign(position=200.0 - rows["track_id"] * 20.0, speed=0.0)
    with refused("time-unit-unknown", column="time") as caught:
        read_rows(still.assign(x=still["position"], time=rows["frame"]))
    assert "data.units={time: ms}" in caught.value.problem.remedy


def test_positions_in_km_are_no_times_in_ms(vehicle_rows):
    rows = _at(vehicle_rows, 10.0)
    with refused("wrong-units", column="position"):
        read_rows(rows.assign(position=rows["position"] / 1000.0))


def test_a_usual_rate_is_taken_only_within_the_uncertainty():
    assert clock.rate_of(1 / 29.5, 1e-3) == 30.0
    assert clock.rate_of(1 / 29.5, 1e-9) == 29.5
    assert clock.rate_of(1001 / 30000, 1e-8) == pytest.approx(29.97003, abs=1e-5)
    assert clock.resolution(np.array([0.0, 0.25, np.nan])) == 0.01
    assert clock.resolution(np.array([1.62e9, 1.62e9 + 0.1])) == 0.1
    assert clock.resolution(np.array([1 / 3])) == 0.0
    assert clock.period_of(*np.array([[1.0, 2.0], [0.0, 1.0], [0.0, 0.1]])) is None


@pytest.mark.parametrize("origin", [5_700_000.0, 500_000.0, 2_000.0, -5_700_000.0, -2_000.0, -400.0])
def test_a_road_begins_at_its_upstream_edge(vehicle_rows, origin):
    rows = _at(vehicle_rows, 10.0, 1)
    sound = read_rows(rows)
    moved = read_rows(rows.assign(position=rows["position"] + origin, x=rows["x"] + origin))
    least = float((sound.table["position"] - 0.5 * sound.table["length"]).min())
    np.testing.assert_allclose(moved.table["position"], sound.table["position"] - least, atol=1e-6)
    assert moved.info.road_length == pytest.approx(sound.info.road_length - least)
    assert any("subtracted from the positions" in note for note in moved.info.notes)
    assert np.abs(moved.table["x"]).max() < 1e5


def test_a_road_that_begins_near_0_and_a_broken_row_move_nothing(vehicle_rows):
    rows = _at(vehicle_rows, 10.0, 1)
    broken = rows.copy()
    broken.loc[5, "position"] = -7000.5
    table, info = info_of_rows("made", broken, "made.csv", "made")
    assert table is broken
    assert info.road_length == read_rows(rows).info.road_length


def test_lanes_beyond_every_road_do_not_count(vehicle_rows):
    rows = _at(vehicle_rows, 10.0, 1)
    _, info = info_of_rows("made", rows.assign(lane=rows["lane"].where(rows["frame"] > 9, 99)), "made.csv", "made")
    assert dict(info.lane_count) == {1: 2}
    _, info = info_of_rows("made", rows.assign(lane=rows["lane"] + 1), "made.csv", "made")
    assert any("no vehicle uses the lanes left of lane 1" in note for note in info.notes)


@pytest.mark.parametrize("rate", [12.0, 12.5, 24.0, 25.0, 30.0])
@pytest.mark.parametrize("start", [0.0, 0.37])
def test_motion_tells_a_frame_rate_that_whole_seconds_leave_open(vehicle_rows, rate, start):
    rows = vehicle_rows.groupby("track_id").head(round(4.0 * rate))
    recording = read_rows(_at(rows, rate, 0, start))
    assert recording.info.frame_rate == rate


def test_a_stated_unit_of_time_that_motion_contradicts_stops(vehicle_rows):
    rows = _at(vehicle_rows, 10.0)
    with refused("wrong-units", column="time"):
        read_rows(rows.assign(time=1000.0 * rows["time"]), units={"time": "s"})
