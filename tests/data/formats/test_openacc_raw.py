"""OpenACC's runs as published: the same platoons as from the condensed table, drivers that switch, damaged files."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.formats import openacc_raw
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.problems import MissingInputError
from tests.data.formats import openacc_files
from tests.refusal import refused

T = openacc_files.T
TABLE = openacc_files.columns()
TEXT = openacc_files.run_of(TABLE)


def read(root, on_bad: BadRows = BadRows.stop):
    return list(iterate_recordings(DataConfig(DataFormat.openacc, str(root), on_bad=on_bad)))


def test_a_run_is_read_as_the_condensed_table_of_the_same_rows_is(tmp_path):
    (run,) = read(openacc_files.write(tmp_path, TEXT))
    parts = [
        pd.DataFrame(
            {"file": "run", "t_s": TABLE["Time"], "pos": k, "speed_mps": TABLE[f"Speed{k}"]}
            | {"gap_to_follower_m": TABLE.get(f"IVS{k}", np.full_like(T, np.nan)), "model": "M"}
        )
        for k in (1, 2, 3, 4)
    ]
    folder = tmp_path / "condensed"
    folder.mkdir()
    pd.concat(parts).to_parquet(folder / "platoons.parquet", index=False)
    (expected,) = read(folder)
    assert run.info.id == "openacc_Vicolungo_part1"
    assert run.info.source == "OpenACC, Vicolungo"
    assert run.dropped == {}
    assert len(run.table) == 4 * len(T)
    shared = [name for name in expected.table if name not in ("recording", "model")]
    pd.testing.assert_frame_equal(run.table[shared], expected.table[shared])
    assert run.labels.loc[2].tolist() == ["TESLA_MODEL3", "1", "S"]


def test_gaps_are_between_bumpers_or_a_note_says_they_seem_not_to_be(tmp_path):
    (run,) = read(openacc_files.write(tmp_path, TEXT))
    assert any("4.8 m further apart" in note and "between bumpers" in note for note in run.info.notes)
    wrong = {
        name: values + openacc_files.LENGTH if name.startswith("IVS") else values for name, values in TABLE.items()
    }
    (run,) = read(openacc_files.write(tmp_path, openacc_files.run_of(wrong)))
    assert any("0.0 m further apart" in note and "those of receivers" in note for note in run.info.notes)


@pytest.mark.parametrize(
    ("acc", "setting", "expected"),
    [
        ("1", "shortest", ("1", "shortest")),
        ("0", "none", ("0", None)),
        ("2", "SL", (None, "mixed")),
        ("", "S,S,M", (None, "mixed")),
    ],
)
def test_what_the_file_says_of_all_cars_is_a_label(tmp_path, acc, setting, expected):
    (run,) = read(openacc_files.write(tmp_path, openacc_files.run_of(TABLE, acc, setting)))
    found = run.labels[["acc", "setting"]].astype(object)
    assert {tuple(None if pd.isna(value) else value for value in row) for row in found.to_numpy()} == {expected}


def test_a_driver_who_switches_begins_another_track(tmp_path):
    words = np.where(T < 12.0, "ACC", "Human").astype(object)
    words[50:55] = ""  # half a second without an entry
    always = ["ACC"] * len(T)
    text = openacc_files.run_of(openacc_files.columns(drivers={2: words, 3: always}), acc="2")
    (run,) = read(openacc_files.write(tmp_path, text))
    labels = run.labels
    assert labels.loc[2, "acc"] == "1"
    later = labels[(labels["model"] == "TESLA_MODEL3") & (labels["acc"] == "0")]
    assert len(labels) == 5
    assert len(later) == 1
    assert labels.loc[3, "acc"] == "1"
    assert labels.loc[[1, 4], "acc"].isna().all()
    table = run.table
    assert table.loc[table["track_id"] == 2, "time"].max() == pytest.approx(11.9)
    followed = table[(table["track_id"] == 3) & (table["time"] >= 12.0)]
    assert set(followed["leader_id"]) == {later.index[0]}
    assert any("1 switches" in note for note in run.info.notes)


def test_unknown_words_for_drivers_stop_or_are_counted(tmp_path):
    words = ["ACC"] * len(T)
    words[100:130] = ["XYZ"] * 30
    openacc_files.write(tmp_path, openacc_files.run_of(openacc_files.columns(drivers={2: words})))
    with refused("driver-unknown", row=101):
        read(tmp_path)
    (run,) = read(tmp_path, BadRows.drop_row)
    assert run.dropped["driver_unknown"] == 30
    assert len(run.labels) == 6  # unknown from 1 s after the last word on


def _renamed(old: str, new: str) -> str:
    return TEXT.replace(old, new, 1)


@pytest.mark.parametrize(
    ("text", "code", "fields"),
    [
        pytest.param(_renamed("Time,", "Tme,"), "not-a-table", {}, id="header"),
        pytest.param(_renamed("Vehicle_order", "Order"), "column-missing", {"column": "Vehicle_order"}, id="order"),
        pytest.param(_renamed(",AUDI_A4", ""), "vehicle-unnamed", {}, id="unnamed"),
        pytest.param(_renamed("ACC,1", "ACC,7"), "label-unusable", {"column": "ACC"}, id="acc"),
        pytest.param(TEXT.replace("IVS", "IVX"), "column-missing", {"column": "IVS1"}, id="gaps"),
        pytest.param(TEXT[: len(TEXT) - 150], "line-broken", {"row": len(T)}, id="cut"),
        pytest.param("", "file-empty", {}, id="empty"),
        pytest.param("\n".join(TEXT.splitlines()[:6]), "no-rows", {}, id="no-rows"),
        pytest.param(
            _renamed("\n5370.3,", "\n5370.3x,"), "value-unreadable", {"column": "Time", "row": 4}, id="number"
        ),
        pytest.param(_renamed("IVS2", "IVS1"), "column-twice", {"column": "IVS1"}, id="twice"),
    ],
)
def test_damaged_files_are_refused(tmp_path, text, code, fields):
    openacc_files.write(tmp_path, text)
    with refused(code, **fields):
        read(tmp_path)


@pytest.mark.parametrize(("name", "factor"), [("Speed", 3.6), ("IVS", 3.28), ("Time", 1000.0)])
def test_other_units_are_refused(tmp_path, name, factor):
    table = {c: values * factor if c.rstrip("1234") == name else values for c, values in TABLE.items()}
    openacc_files.write(tmp_path, openacc_files.run_of(table))
    with refused("wrong-units"):
        read(tmp_path, BadRows.drop_row)


@pytest.mark.parametrize("place", [10, len(T) - 1])
def test_a_line_of_other_bytes_is_a_broken_one(tmp_path, place):
    path = openacc_files.write(tmp_path, TEXT) / "Vicolungo" / "part1.csv"
    lines = path.read_bytes().splitlines(keepends=True)
    lines[6 + place] = b"53\xff\xc3"
    path.write_bytes(b"".join([*lines[: 7 + place], b"\n", *lines[7 + place :]]))
    with refused("line-broken", row=place + 1):
        read(tmp_path)
    (run,) = read(tmp_path, BadRows.drop_row)
    assert run.dropped["broken_line"] == 1


def _in_units(speed: str, gap: str, time: str) -> str:
    """The run with speeds in km/h, gaps in ft and times in ms, and these ends of names."""
    scales = {"Speed": (3.6, speed), "IVS": (1.0 / 0.3048, gap), "Time": (1000.0, time), "Lat": (1.0, " [deg]")}
    table = {}
    for name, values in TABLE.items():
        scale, end = scales.get(name.rstrip("1234"), (1.0, ""))
        table[name + end] = scale * np.asarray(values)
    return openacc_files.run_of(table)


@pytest.mark.parametrize("units", [(" (km/h)", " (ft)", " (ms)"), ("[KMH]", " [ feet ]", "[ms]")])
def test_units_in_the_names_of_columns_are_converted(tmp_path, units):
    (expected,) = read(openacc_files.write(tmp_path, TEXT))
    openacc_files.write(tmp_path, _in_units(*units))
    assert openacc_raw.is_run(tmp_path / "Vicolungo" / "part1.csv")
    (run,) = read(tmp_path)
    pd.testing.assert_frame_equal(run.table, expected.table)
    assert run.info.notes == expected.info.notes


def test_an_unknown_unit_in_the_name_of_a_column_is_an_error(tmp_path):
    openacc_files.write(tmp_path, _renamed("Speed2", "Speed2 (furlong/day)"))
    with refused("unit-unknown", column="Speed2 (furlong/day)"):
        read(tmp_path, BadRows.drop_row)


@pytest.mark.parametrize("name", ["Speed4 m/s", "Speed4_mps", "speed4", "Velocity4", "Speed04"])
def test_a_vehicle_with_columns_and_no_speed_is_an_error(tmp_path, name):
    path = openacc_files.write(tmp_path, _renamed("Speed4", name)) / "Vicolungo" / "part1.csv"
    with refused("column-missing", file=str(path), column="Speed4") as caught:
        read(tmp_path, BadRows.drop_row)
    assert "E4, N4, Lon4, Lat4 and no Speed4" in caught.value.problem.message


def test_commas_of_a_spreadsheet_behind_the_rows_do_not_matter(tmp_path):
    head, rows = TEXT.splitlines()[:6], TEXT.splitlines()[6:]
    openacc_files.write(tmp_path, "\n".join([*head, *(f"{row},," for row in rows)]))
    (run,) = read(tmp_path)
    assert len(run.table) == 4 * len(T)


def test_a_folder_without_runs_names_what_is_wanted(tmp_path):
    with refused("recordings-missing", MissingInputError):
        read(tmp_path)


def test_times_between_whole_frames_are_frames_too(tmp_path):
    openacc_files.write(tmp_path, TEXT)
    (expected,) = read(tmp_path)
    shifted = {**TABLE, "Time": np.round(np.asarray(TABLE["Time"]) + 0.05, 2)}
    openacc_files.write(tmp_path, openacc_files.run_of(shifted))
    (run,) = read(tmp_path)
    assert run.dropped == {}
    np.testing.assert_allclose(run.table["position"], expected.table["position"])


def test_empty_lines_around_the_names_of_columns_do_not_matter(tmp_path):
    openacc_files.write(tmp_path, TEXT.replace("\nTime", "\n\nTime").replace("\n5370.0,", "\n\n5370.0,"))
    (run,) = read(tmp_path)
    assert len(run.table) == 4 * len(T)


@pytest.mark.parametrize(("delimiter", "mark"), [(";", ","), (";", "."), ("\t", ",")])
def test_a_copy_with_another_delimiter_says_the_same(tmp_path, delimiter, mark):
    openacc_files.write(tmp_path, TEXT)
    (expected,) = read(tmp_path)
    openacc_files.write(tmp_path, TEXT.replace(",", delimiter).replace(".", mark))
    assert openacc_raw.is_run(tmp_path / "Vicolungo" / "part1.csv")
    (run,) = read(tmp_path)
    pd.testing.assert_frame_equal(run.table, expected.table)


def _without(*numbers: int, n: int = 5) -> str:
    """A run of n vehicles, some of which have no columns."""
    table = openacc_files.columns(n)
    gone = tuple(f"{name}{k}" for k in numbers for name in ("Speed", "E", "N", "Lon", "Lat", "IVS"))
    gone += tuple(f"IVS{k - 1}" for k in numbers)
    return openacc_files.run_of({name: values for name, values in table.items() if name not in gone}, n=n)


def test_a_vehicle_without_columns_is_named_and_nobody_follows_across_it(tmp_path):
    """A file as in ZalaZone, in which the leader and others of the order have no columns."""
    openacc_files.write(tmp_path, _without(3))
    front, back = read(tmp_path)
    assert (front.info.id, back.info.id) == ("openacc_Vicolungo_part1_1to2", "openacc_Vicolungo_part1_4to5")
    assert set(back.labels["model"]) == {"AUDI_A4", "MAZDA_3"}
    assert (front.table["track_id"].unique().tolist(), back.table["track_id"].unique().tolist()) == ([1, 2], [4, 5])
    for part in (front, back):
        assert sum("3 (BMW_I3)" in note for note in part.info.notes) == 1
    openacc_files.write(tmp_path, _without(5))
    (run,) = read(tmp_path)
    assert sum("5 (MAZDA_3)" in note for note in run.info.notes) == 1


def test_vehicles_without_a_gap_between_them_are_named(tmp_path):
    table = {name: values for name, values in openacc_files.columns(4).items() if name != "IVS2"}
    openacc_files.write(tmp_path, openacc_files.run_of(table))
    for part in read(tmp_path):
        assert sum("2 and 3" in note for note in part.info.notes) == 1
    openacc_files.write(tmp_path, TEXT)
    (run,) = read(tmp_path)
    assert not any("paired" in note for note in run.info.notes)


DISTINCT = openacc_files.columns(faster=0.3)
"""Vehicles that do not swing alike."""


def _exchanged(one: str, other: str) -> str:
    return openacc_files.run_of({**DISTINCT, one: DISTINCT[other], other: DISTINCT[one]})


@pytest.mark.parametrize(
    ("text", "code"),
    [
        pytest.param(_exchanged("IVS1", "IVS2"), "wrong-leader", id="gaps"),
        pytest.param(_exchanged("Speed2", "Speed3"), "wrong-units", id="speeds"),
        pytest.param(
            openacc_files.run_of({**DISTINCT, "IVS2": 3.28 * DISTINCT["IVS2"]}), "wrong-units", id="one in ft"
        ),
    ],
)
def test_columns_of_another_pair_are_refused(tmp_path, text, code):
    openacc_files.write(tmp_path, text)
    with refused(code, column="IVS"):
        read(tmp_path, BadRows.drop_row)


def test_a_speed_with_another_clock_is_noted(tmp_path):
    openacc_files.write(tmp_path, openacc_files.run_of({**DISTINCT, "Speed1": np.roll(DISTINCT["Speed1"], 80)}))
    (run,) = read(tmp_path)
    assert ["vehicles 1 and 2" in note for note in run.info.notes if "clocks" in note] == [True]
    openacc_files.write(tmp_path, openacc_files.run_of(DISTINCT))
    (run,) = read(tmp_path)
    assert not any("clocks" in note for note in run.info.notes)


def test_whole_numbers_above_the_table_may_have_a_fraction_of_0(tmp_path):
    (run,) = read(openacc_files.write(tmp_path, openacc_files.run_of(TABLE, acc="1.0")))
    assert set(run.table["acc"]) == {"1"}


def test_a_single_gap_between_other_points_is_noted(tmp_path):
    table = {**TABLE, "IVS2": TABLE["IVS2"] - openacc_files.LENGTH}
    (run,) = read(openacc_files.write(tmp_path, openacc_files.run_of(table)))
    assert [note for note in run.info.notes if "vehicles 2 and 3 are" in note and "IVS2" in note]
    (sound,) = read(openacc_files.write(tmp_path, TEXT))
    assert not [note for note in sound.info.notes if "most others" in note]
