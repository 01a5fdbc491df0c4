"""The canonical schema: every fault stops with file, column, row and remedy, or is counted."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.schema import COLUMNS, validate
from rearl_jax.data.units import SI_FACTOR, to_si
from rearl_jax.data.vehicle_classes import class_of
from tests.data.made_rows import with_values
from tests.refusal import refused

INFO = RecordingInfo(
    id="made_01",
    frame_rate=10.0,
    lane_count={1: 2},
    road_length=300.0,
    source="made by hand",
    licence="none",
    attribution="nobody",
    file="made.csv",
    columns={"speed": "v_Vel"},
)
STOP = DataConfig()
DROP_ROW = DataConfig(on_bad=BadRows.drop_row)
DROP_TRACK = DataConfig(on_bad=BadRows.drop_track)


def test_a_sound_table_passes_with_the_columns_and_types_of_the_schema(vehicle_rows):
    shuffled_tracks = vehicle_rows.iloc[np.r_[200:300, 0:200]]
    table, dropped = validate(shuffled_tracks, INFO, STOP)
    assert dropped == {}
    assert {name: str(dtype) for name, dtype in table.dtypes.items()} == {c.name: c.dtype for c in COLUMNS}
    assert len(table) == 300
    assert table[["track_id", "frame"]].equals(table[["track_id", "frame"]].sort_values(["track_id", "frame"]))
    assert set(table["recording"]) == {"made_01"}
    np.testing.assert_allclose(table["time"], (table["frame"] - 7) / 10.0, atol=1e-12)
    assert table["leader_id"].isna().sum() == 200


def test_unknown_nullable_columns_may_be_missing(vehicle_rows):
    nullable = [c.name for c in COLUMNS if c.nullable]
    assert nullable == ["lateral", "lane", "acceleration", "width", "leader_id"]
    table, _ = validate(vehicle_rows.drop(columns=nullable), INFO, STOP)
    assert table[nullable].isna().all().all()
    assert str(table["lane"].dtype) == "Int8"


def _at(table: pd.DataFrame, row: int, **values: object) -> pd.DataFrame:
    return with_values(table, row, **values).infer_objects()


def _moved(table: pd.DataFrame, columns: tuple[str, ...], by: float) -> pd.DataFrame:
    later = (table["track_id"] == 1) & (table["frame"] > 47)
    return table.assign(**{name: table[name] + by * later for name in columns})


def _rows(*parts: slice | int):
    return lambda table: table.iloc[np.r_[parts]].reset_index(drop=True)


def _late(table: pd.DataFrame, row: int) -> pd.DataFrame:
    late = np.where(np.arange(len(table)) == row, 0.06, 0.0)
    return table.assign(time=table["frame"] / INFO.frame_rate + late)


def _cell(name: str, value: object):
    return lambda table: _at(table, 41, **{name: value})


# Fault: how it is made, column and first row (1 = first) of the problem, what it says of the value, key of the count,
# rows that drop_row removes (None: the track is cut instead).
FAULTS = {
    "nan speed": (_cell("speed", np.nan), "v_Vel", 42, "nan", "not_finite", 1),
    "infinite x": (_cell("x", np.inf), "x", 42, "inf", "not_finite", 1),
    "infinite acceleration": (_cell("acceleration", np.inf), "acceleration", 42, "inf", "not_finite", 1),
    "nan track": (_cell("track_id", np.nan), "track_id", 42, "nan", "not_finite", 1),
    "unknown class": (_cell("vehicle_class", "tram"), "vehicle_class", 42, "tram", "unknown_class", 1),
    "no class": (_cell("vehicle_class", None), "vehicle_class", 42, "", "unknown_class", 1),
    "duplicate": (_rows(slice(0, 42), 41, slice(42, 300)), "frame", 43, "frame 48", "duplicate", 1),
    "unsorted": (_rows(slice(0, 40), 41, 40, slice(42, 300)), "frame", 42, "frame 48", "unsorted", 1),
    "negative speed": (_cell("speed", -0.5), "v_Vel", 42, "-0.5 m/s", "out_of_range", 1),
    "negative length": (_cell("length", -4.5), "length", 42, "-4.5 m", "out_of_range", 1),
    "zero length": (_cell("length", 0.0), "length", 42, "0 m", "out_of_range", 1),
    "late": (lambda t: _late(t, 41), "time", 42, "frame 48", "wrong_time", 1),
    "lane beyond the road": (_cell("lane", 2), "lane", 42, "lane 2", "lane_out_of_range", 1),
    "negative lane": (_cell("lane", -1), "lane", 42, "lane -1", "lane_out_of_range", 1),
    "lane beyond int8": (_cell("lane", 300), "lane", 42, "lane 300", "lane_out_of_range", 1),
    "no such direction": (_cell("direction", 2), "direction", 42, "direction 2", "wrong_direction", 1),
    "gap": (lambda t: t.drop(index=[41, 42, 43]), "frame", 45, "47 and 51", "gap", None),
    "jump": (lambda t: _moved(t, ("x", "position"), 3.0), "position", 42, "5.00 m", "jump", None),
    "sideways": (lambda t: _moved(t, ("y", "lateral"), 3.5), "lateral", 42, "3.50 m", "jump", None),
    "on the ground": (lambda t: _moved(t, ("x",), 3.0), "x", 42, "5.00 m", "jump", None),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_stops_with_file_column_row_and_remedy(vehicle_rows, fault):
    spoil, column, row, value, name, _ = FAULTS[fault]
    with refused(name.replace("_", "-"), file="made.csv", column=column, row=row) as caught:
        validate(spoil(vehicle_rows), INFO, STOP)
    problem = caught.value.problem
    assert value in problem.fault
    assert "data.on_bad=drop_row" in problem.remedy
    for part in ("made.csv", f"column {column}", f"data row {row}", problem.fault, problem.remedy):
        assert part in str(caught.value)


@pytest.mark.parametrize("fault", FAULTS)
def test_drop_row_leaves_out_the_row_cuts_the_track_and_counts(vehicle_rows, fault):
    spoil, _, _, _, name, n_rows = FAULTS[fault]
    spoiled = spoil(vehicle_rows)
    table, dropped = validate(spoiled, INFO, DROP_ROW)
    if n_rows is None:
        assert dropped == {f"{name}_cuts": 1}
        assert len(table) == len(spoiled)
    else:
        expected = {name: n_rows}
        # Removing a sound frame leaves a hole, removing a copy does not.
        if name != "duplicate":
            expected["gap_cuts"] = 1
        assert dropped == expected
        assert len(table) == len(spoiled) - n_rows
    n_tracks = 3 if name == "duplicate" else 4
    assert table["track_id"].nunique() == n_tracks
    _assert_canonical(table)


@pytest.mark.parametrize("fault", FAULTS)
def test_drop_track_leaves_out_the_vehicle_and_counts(vehicle_rows, fault):
    spoil, _, _, _, name, n_rows = FAULTS[fault]
    spoiled = spoil(vehicle_rows)
    table, dropped = validate(spoiled, INFO, DROP_TRACK)
    if fault == "nan track":  # the row belongs to nobody; its track is left with a hole
        assert dropped == {"not_finite": 1, "gap": 99, "tracks": 1}
    else:
        assert dropped == {name: int((spoiled["track_id"] == 1).sum()), "tracks": 1}
    assert set(table["track_id"]) == {2, 3}
    _assert_canonical(table)


def _assert_canonical(table: pd.DataFrame) -> None:
    track, frame = table["track_id"].to_numpy(), table["frame"].to_numpy()
    same = track[1:] == track[:-1]
    assert (np.diff(frame)[same] == 1).all()
    assert (np.diff(track)[~same] > 0).all()
    again, dropped = validate(table, INFO, STOP)
    assert dropped == {}
    pd.testing.assert_frame_equal(again, table)


@pytest.mark.parametrize(
    ("column", "factor", "unit"),
    [
        ("speed", 3.6, "km/h"),
        ("speed", 1.0 / 0.3048, "ft/s"),
        ("speed", 1.0 / 0.44704, "mph"),
        ("position", 1.0 / 0.3048, "ft"),
        ("position", 100.0, "cm"),
        ("position", -1.0, "reverse"),
        ("x", 1.0 / 0.3048, "in m"),
        ("length", 1.0 / 0.3048, "to m"),
        ("width", 1.0 / 0.3048, "to m"),
        ("lateral", 1.0 / 0.3048, "in m"),
        ("lateral", -1.0, "to the right"),
    ],
)
@pytest.mark.parametrize("policy", [STOP, DROP_ROW])
def test_a_wrong_unit_stops_whatever_the_policy(vehicle_rows, column, factor, unit, policy):
    with refused("wrong-units", column=INFO.columns.get(column, column)) as caught:
        validate(vehicle_rows.assign(**{column: vehicle_rows[column] * factor}), INFO, policy)
    problem = caught.value.problem
    assert unit in problem.remedy
    assert problem.row is not None
    assert "drop_row" not in str(caught.value)


def test_a_factor_of_no_unit_leaves_open_which_column_is_wrong(vehicle_rows):
    with refused("wrong-units", column=INFO.columns["speed"]) as caught:
        validate(vehicle_rows.assign(position=vehicle_rows["position"] * 1.7), INFO, STOP)
    assert "1.700 times" in caught.value.problem.fault


def test_a_table_all_in_feet_is_found_although_it_agrees_with_itself(vehicle_rows):
    feet = vehicle_rows.copy()
    metric = ["x", "y", "position", "lateral", "speed", "length", "width"]
    feet[metric] /= 0.3048
    with refused("wrong-units", column="length", row=1):
        validate(feet, INFO, STOP)
    feet[metric] = to_si(feet[metric].to_numpy(), "ft")
    assert validate(feet, INFO, STOP)[1] == {}


def test_time_in_ms_and_acceleration_in_ft_per_s2_are_found(vehicle_rows):
    with refused("wrong-units", column="time", row=1):
        validate(vehicle_rows.assign(time=vehicle_rows["frame"] * 100.0), INFO, STOP)
    wild = vehicle_rows.assign(acceleration=np.where(vehicle_rows["frame"] % 2, 11.0, -11.0))
    with refused("wrong-units", column="acceleration", row=1):
        validate(wild, INFO, STOP)


def test_noise_of_video_tracking_is_no_fault(vehicle_rows):
    rng = np.random.default_rng(3)
    noisy = vehicle_rows.copy()
    noisy["position"] += rng.normal(0.0, 0.3, len(noisy))
    noisy["x"] = noisy["position"]
    noisy["speed"] += rng.normal(0.0, 0.5, len(noisy))
    assert np.abs(np.diff(noisy["position"])[:99] - 2.0).max() > 0.5
    assert validate(noisy, INFO, STOP)[1] == {}


def test_a_missing_column_and_an_empty_table_stop(vehicle_rows):
    with refused("column-missing", column="speed"):
        validate(vehicle_rows.drop(columns="speed"), INFO, DROP_ROW)
    with refused("no-rows"):
        validate(vehicle_rows.iloc[:0], INFO, DROP_ROW)


def test_text_and_fractions_where_numbers_belong_stop(vehicle_rows):
    with refused("not-a-number", column="v_Vel", row=6):
        validate(_at(vehicle_rows, 5, speed="fast"), INFO, DROP_ROW)
    with refused("not-a-number", column="frame", row=1):
        validate(_at(vehicle_rows, 0, frame=7.5), INFO, DROP_ROW)


def test_numbers_written_as_text_are_read(vehicle_rows):
    table, _ = validate(vehicle_rows.astype({"speed": str, "track_id": str}), INFO, STOP)
    pd.testing.assert_frame_equal(table, validate(vehicle_rows, INFO, STOP)[0])


def test_dropping_everything_stops(vehicle_rows):
    with refused("no-row-left", column="vehicle_class"):
        validate(vehicle_rows.assign(vehicle_class="tram"), INFO, DROP_ROW)


def test_conversion_factors():
    assert to_si(np.array([1.0, 2.0]), "ft").tolist() == [0.3048, 0.6096]
    assert to_si(np.array([36.0]), "km/h")[0] == pytest.approx(10.0, rel=1e-15)
    assert SI_FACTOR["mph"] == pytest.approx(SI_FACTOR["ft"] * 5280 / 3600, rel=1e-15)


@pytest.mark.parametrize("word", ["Car", "CAR", " car ", "passenger-car", "Passenger_Car", "auto", "van"])
def test_words_for_a_car_are_understood(vehicle_rows, word):
    words = vehicle_rows["vehicle_class"].where(vehicle_rows["vehicle_class"] != "car", word)
    for column in (words, words.astype("category")):
        table, _ = validate(vehicle_rows.assign(vehicle_class=column), INFO, STOP)
        assert (table["vehicle_class"] == "car").sum() == 200
        assert (table["vehicle_class"] == "truck").sum() == 100


@pytest.mark.parametrize(
    ("word", "name"),
    [
        ("Cars", "car"),
        ("Pick-up", "car"),
        ("Truck/Bus", "truck"),
        ("Buses", "Buses"),
        ("bus", "truck"),
        ("tram", "tram"),
    ],
)
def test_words_for_classes_are_known_in_any_spelling(word, name):
    assert class_of(word) == name
