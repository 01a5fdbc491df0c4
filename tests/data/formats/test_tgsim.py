"""TGSIM: a road that bends, lanes by their places, several runs, and files that are damaged."""

from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks.sensor_layouts import LANE_WIDTH, tgsim_rows, traffic
from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.recordings import iterate_recordings
from tests.data.made_rows import with_values
from tests.refusal import refused


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    return pd.concat([tgsim_rows(vehicle) for vehicle in islice(traffic(10.0), 24)], ignore_index=True)


@pytest.fixture
def read(tmp_path: Path):
    def read(rows: pd.DataFrame, on_bad: BadRows = BadRows.stop, name: str = "I294_L1_final.csv"):
        rows.to_csv(tmp_path / name, index=False)
        return list(iterate_recordings(DataConfig(DataFormat.tgsim, str(tmp_path), on_bad=on_bad)))

    return read


def test_a_bent_road_becomes_straight(rows, read):
    (recording,) = read(rows)
    info, table = recording.info, recording.table
    assert (info.id, info.frame_rate, info.lane_count) == ("tgsim_i294l1_1", 10.0, {1: 3, 2: 3})
    assert recording.dropped == {}
    assert len(table) == len(rows)
    assert info.road_length == pytest.approx(640.0, rel=0.01)
    # In the plane the outermost vehicles of one lane are more than 100 m apart across the road.
    assert np.ptp(rows.loc[rows["lane-kf"] == 1, "yloc-kf"]) > 100.0
    for (_, lane), lateral in table.groupby(["direction", "lane"])["lateral"]:
        assert lateral.median() == pytest.approx(LANE_WIDTH * (lane + 0.5), abs=0.1)
    step = table.groupby("track_id")["position"].diff()
    np.testing.assert_allclose(step.dropna(), 0.1 * table["speed"][step.notna()], atol=0.3, rtol=0.05)
    assert set(table["automated"].groupby(table["track_id"], observed=True).first()[[3, 4]]) == {"yes", "no"}
    assert set(table["vehicle_class"]) == {"car", "truck"}


def test_lane_changes_stay_lane_changes(rows, read):
    (recording,) = read(rows)
    own = recording.table[recording.table["track_id"] == 7]
    assert own["lane"].tolist() == sorted(own["lane"])
    assert own["lane"].nunique() == 2
    assert own["lateral"].iloc[-1] - own["lateral"].iloc[0] == pytest.approx(LANE_WIDTH, abs=0.2)


def test_the_portal_writes_other_names_and_no_order(rows, read):
    other = rows.rename(columns=lambda name: name.replace("-", "_")).sample(frac=1.0, random_state=0)
    (here,), (there,) = read(rows), read(other)
    np.testing.assert_allclose(here.table["position"], there.table["position"], atol=1e-6)
    np.testing.assert_array_equal(here.table["lane"], there.table["lane"])


def test_runs_are_recordings_of_their_own(rows, read):
    later = rows[rows["id"] > 1].assign(**{"run-index": 2, "time": rows["time"] + 50.0})
    first, second = read(pd.concat([rows, later]))
    assert [first.info.id, second.info.id] == ["tgsim_i294l1_1", "tgsim_i294l1_2"]
    assert [len(first.table), len(second.table)] == [len(rows), len(later)]


def test_rows_without_a_run_are_named_or_counted(rows, read):
    unnamed = ((rows["id"] == 5) | ((rows["id"] == 7) & (rows["time"] > 12.0))).to_numpy()
    changed = rows.assign(**{"run-index": rows["run-index"].astype("Int64").mask(unnamed)})
    with refused("not-finite", column="run-index", row=int(np.argmax(unnamed)) + 1):
        read(changed)
    for on_bad in (BadRows.drop_row, BadRows.drop_track):
        (recording,) = read(changed, on_bad)
        assert recording.dropped == {"not_finite": unnamed.sum(), "tracks": 1}
        assert len(recording.table) == len(rows) - unnamed.sum()


def test_a_file_in_which_no_row_states_its_run_is_named(rows, read):
    changed = rows.assign(**{"run-index": ""})
    with refused("not-finite", column="run-index", row=1):
        read(changed)
    with refused("no-row-left", column="run-index"):
        read(changed, BadRows.drop_row)


def test_lanes_are_ranked_by_place_whatever_their_numbers(rows, read):
    numbers = rows["lane-kf"].map({1: 5, 2: 4, 3: 9, -1: 30, -2: 20, -3: 10})
    (recording,) = read(rows.assign(**{"lane-kf": numbers}))
    (sound,) = read(rows)
    np.testing.assert_array_equal(recording.table["lane"], sound.table["lane"])
    assert any("5, 4, 9" in note for note in recording.info.notes)


def test_a_mirrored_plane_is_turned_by_the_oncoming_traffic(rows, read):
    (mirrored,), (sound,) = read(rows.assign(**{"yloc-kf": 900.0 - rows["yloc-kf"]})), read(rows)
    np.testing.assert_allclose(mirrored.table["lateral"], sound.table["lateral"], atol=1e-6)


def test_codes_of_i395_are_classes(rows, read):
    codes = np.where(rows["type-most-common"] == "large-vehicle", 2, 1)
    codes[rows["id"] == 3] = 4
    other = rows.assign(**{"type-most-common": codes}).drop(columns=["av", "run-index"])
    (recording,) = read(other, name="I395-final.csv")
    assert recording.info.id == "tgsim_i395"
    assert (recording.table["vehicle_class"] == "truck").sum() == (codes == 2).sum()
    assert set(recording.table.loc[recording.table["automated"] == "yes", "track_id"]) == {3}


def test_a_ramp_that_leaves_is_counted(rows, read):
    leaving = rows["id"] == 1
    shift = np.where(leaving, 0.05 * np.maximum(rows["time"] - 8.0, 0.0) ** 2 * 4.0, 0.0)
    ramp = rows.assign(
        **{"lane-kf": np.where(leaving & (rows["time"] > 8.0), 7, rows["lane-kf"]), "yloc-kf": rows["yloc-kf"] + shift}
    )
    (recording,) = read(ramp, BadRows.drop_row)
    assert recording.dropped["off_road"] == (ramp["lane-kf"] == 7).sum()


@pytest.mark.parametrize(
    ("change", "code", "fields"),
    [
        (lambda t: t.drop(columns="speed-kf"), "column-missing", {"column": "speedkf"}),
        (lambda t: t.assign(**{"speed-kf": 3.6 * t["speed-kf"]}), "wrong-units", {"column": "speed-kf"}),
        (lambda t: t.assign(**{"xloc-kf": t["xloc-kf"] / 0.3048, "yloc-kf": t["yloc-kf"] / 0.3048}), "wrong-units", {}),
        (lambda t: t.assign(time=1000.0 * t["time"]), "wrong-units", {"column": "time"}),
        (lambda t: t.assign(**{"length-smoothed": t["length-smoothed"] / 0.3048}), "wrong-units", {}),
        (lambda t: t.iloc[:0], "no-rows", {}),
        (lambda t: with_values(t, 40, **{"xloc-kf": -9999.0}), "out-of-range", {"row": 41}),
        (lambda t: with_values(t, 40, **{"yloc-kf": np.nan}), "not-finite", {"row": 41}),
        (lambda t: with_values(t, 40, **{"lane-kf": 99}), "lane-out-of-range", {"row": 41, "column": "lane-kf"}),
        (lambda t: with_values(t, 40, **{"type-most-common": "boat"}), "unknown-class", {"row": 41}),
        (lambda t: with_values(t, 40, id=np.nan), "not-finite", {"row": 41, "column": "id"}),
        (lambda t: t.drop(index=range(40, 44)), "gap", {}),
        (lambda t: t.rename(columns={"speed-kf": "speed_kf_x"}), "format-unsupported", {"column": "speed_kf_x"}),
        (lambda t: t[["time", "id"]], "not-a-table", {}),
        (lambda t: t.assign(**{"xloc-kf": 1.0, "yloc-kf": 2.0}), "no-motion", {}),
    ],
)
def test_a_fault_is_named(rows, read, change, code, fields):
    with refused(code, **fields):
        read(change(rows))


def test_a_vehicle_that_drives_backwards_in_its_lane_is_named(rows, read):
    own = (rows["id"] == 5).to_numpy()
    turned = rows.copy()
    turned.loc[own, ["xloc-kf", "yloc-kf"]] = rows.loc[own, ["xloc-kf", "yloc-kf"]].to_numpy()[::-1]
    with refused("wrong-direction", row=int(np.argmax(own)) + 1):
        read(turned)
    (recording,) = read(turned, BadRows.drop_row)
    assert recording.dropped["wrong_direction"] == own.sum()


def test_a_cut_line_is_named_or_counted(rows, tmp_path, read):
    read(rows)
    path = tmp_path / "I294_L1_final.csv"
    path.write_bytes(path.read_bytes()[:-30])
    with refused("line-broken", row=len(rows)):
        list(iterate_recordings(DataConfig(DataFormat.tgsim, str(tmp_path))))
    (recording,) = iterate_recordings(DataConfig(DataFormat.tgsim, str(tmp_path), on_bad=BadRows.drop_row))
    assert recording.dropped["broken_line"] == 1


def test_an_empty_file_is_named(tmp_path):
    (tmp_path / "a.csv").touch()
    with refused("file-empty"):
        list(iterate_recordings(DataConfig(DataFormat.tgsim, str(tmp_path))))


def test_times_between_whole_frames_are_frames_too(rows, read):
    (expected,) = read(rows)
    (recording,) = read(rows.assign(time=(rows["time"] + 0.05).round(2)))
    steps = recording.table.groupby("track_id")["frame"].diff().dropna()
    assert (steps == 1).all()
    np.testing.assert_array_equal(recording.table["lane"], expected.table["lane"])
    with refused("duplicate", column="time", row=len(rows) + 1):
        read(pd.concat([rows, rows.iloc[:1]]))


def test_automated_vehicles_are_also_known_by_a_number(rows, read):
    (expected,) = read(rows)
    (recording,) = read(rows.assign(av=(rows["av"] == "yes").astype(int)))
    assert recording.table["automated"].tolist() == expected.table["automated"].tolist()
    assert set(recording.table["automated"]) == {"yes", "no"}


def test_units_in_the_names_of_columns_are_converted_and_no_run_is_lost(rows, read):
    (expected,) = read(rows)
    scales = {"xloc-kf": (" [ft]", 1 / 0.3048), "yloc-kf": ("(m)", 1.0), "speed-kf": (" (km/h)", 3.6)}
    scales |= {"length-smoothed": ("[cm]", 100.0), "time": (" [ms]", 1000.0), "run-index": (" [-]", 1)}
    other = rows.assign(**{name: rows[name] * factor for name, (_, factor) in scales.items()})
    (found,) = read(other.rename(columns={name: f"{name}{unit}" for name, (unit, _) in scales.items()}))
    assert found.info.id == expected.info.id
    pd.testing.assert_frame_equal(found.table, expected.table, rtol=1e-6)


def test_an_unknown_unit_in_the_name_of_a_column_stops(rows, read):
    with refused("unit-unknown", column="speed-kf (furlong/h)"):
        read(rows.rename(columns={"speed-kf": "speed-kf (furlong/h)"}))


def test_a_vehicle_in_a_run_of_its_own_stops(rows, read):
    strange = (rows["id"] == 7).to_numpy()
    with refused("recording-contradicts", column="run-index", row=int(np.argmax(strange)) + 1):
        read(rows.assign(**{"run-index": rows["run-index"].mask(strange, 2)}))


@pytest.mark.parametrize("number", [0, -999])
def test_a_number_for_no_lane_is_no_ramp(rows, read, number):
    unknown = np.arange(len(rows)) % 97 == 50
    changed = rows.assign(**{"lane-kf": rows["lane-kf"].mask(unknown, number)})
    with refused("lane-out-of-range", column="lane-kf", row=51):
        read(changed)
    (recording,) = read(changed, BadRows.drop_row)
    assert recording.dropped["lane_out_of_range"] == unknown.sum()
    assert "off_road" not in recording.dropped


def test_places_that_stand_for_none_do_not_lengthen_the_road(rows, read):
    (expected,) = read(rows)
    unknown = np.arange(len(rows)) % 97 == 50
    changed = rows.assign(**{name: rows[name].mask(unknown, 0.0) for name in ("xloc-kf", "yloc-kf")})
    with refused("out-of-range", column="xloc-kf", row=51):
        read(changed)
    (recording,) = read(changed, BadRows.drop_row)
    assert recording.dropped["out_of_range"] == unknown.sum()
    assert recording.info.road_length == pytest.approx(expected.info.road_length, abs=1.0)


def test_scattered_rows_in_another_run_stop(rows, read):
    strange = np.arange(len(rows)) % 97 == 50
    with refused("recording-contradicts", column="run-index", row=51):
        read(rows.assign(**{"run-index": rows["run-index"].mask(strange, 2)}), BadRows.drop_row)


def test_times_in_whole_seconds_stop_instead_of_losing_most_rows(rows, read):
    with refused("times-too-coarse", column="time"):
        read(rows.assign(time=rows["time"].round()), BadRows.drop_row)


def test_minus_1_is_no_class(rows, read):
    unknown = np.arange(len(rows)) % 97 == 50
    with refused("unknown-class", column="type-most-common", row=51):
        read(rows.assign(**{"type-most-common": rows["type-most-common"].mask(unknown, "-1")}))
