"""SUMO's floating car data as its options and copies change it: times, coordinates, types, names of files."""

import re
import zipfile

import numpy as np
import pandas as pd
import pytest

from tests.data.formats import sumo_files
from tests.data.formats.sumo_files import read
from tests.refusal import refused

ROWS = sumo_files.rows()
TEXT = sumo_files.xml_of(ROWS)


def _clock(seconds: float) -> str:
    return f"1:{int(seconds) // 3600:02d}:{int(seconds) // 60 % 60:02d}:{seconds % 60.0:05.2f}"


@pytest.mark.parametrize("name", ["fcd.xml", "fcd.csv", "fcd.parquet"])
def test_human_readable_times_are_read(tmp_path, name):
    expected = read(sumo_files.write(tmp_path, TEXT)).table
    (tmp_path / "fcd.xml").unlink()
    rows = [row | {"time": _clock(row["time"])} for row in ROWS]
    if name == "fcd.xml":
        text = re.sub(r'timestep time="([^"]+)"', lambda found: f'timestep time="{_clock(float(found[1]))}"', TEXT)
        (tmp_path / name).write_text(text)
    elif name == "fcd.csv":
        (tmp_path / name).write_text(sumo_files.csv_of(rows))
    else:
        pd.DataFrame(rows).to_parquet(tmp_path / name, index=False)
    table = read(tmp_path).table
    assert (table["frame"] - expected["frame"] == 86400 / sumo_files.STEP).all()
    columns = [column for column in expected if column not in ("frame", "time")]
    pd.testing.assert_frame_equal(table[columns], expected[columns])
    if name == "fcd.csv":
        (tmp_path / name).write_text(sumo_files.csv_of([*rows[:4], rows[4] | {"time": "1:00:xx"}, *rows[5:]]))
        with refused("value-unreadable", column="timestep_time", row=5):
            read(tmp_path)


def test_longitude_and_latitude_become_metres(tmp_path):
    expected = read(sumo_files.write(tmp_path, TEXT)).table
    at = 111_194.9 * np.cos(np.radians(48.1)), 111_194.9  # m per degree on a sphere, within 0.4 %
    rows = [row | {"x": 11.5 + row["x"] / at[0], "y": 48.1 + row["y"] / at[1]} for row in ROWS]
    recording = read(sumo_files.write(tmp_path, sumo_files.xml_of(rows)))
    assert any("longitude and latitude" in note for note in recording.info.notes)
    for name in ("x", "y"):
        moved, known = (table[name] - table[name].iloc[0] for table in (recording.table, expected))
        np.testing.assert_allclose(moved, known, atol=0.1, rtol=0.004)
    np.testing.assert_array_equal(recording.table["position"], expected["position"])


def test_a_type_that_was_changed_for_one_vehicle_is_that_type(tmp_path):
    expected = read(sumo_files.write(tmp_path, TEXT)).table
    rows = [row | {"type": f"{row['type']}@{row['id']}"} for row in ROWS]
    recording = read(sumo_files.write(tmp_path, sumo_files.xml_of(rows)))
    for name in ("length", "vehicle_class", "type"):
        assert recording.table[name].tolist() == expected[name].tolist()
    assert any("TYPE@VEHICLE" in note for note in recording.info.notes)


@pytest.mark.parametrize("name", ["fcd.txt", "fcd.xml.zip"])
def test_xml_is_recognised_by_its_content(tmp_path, name):
    expected = read(sumo_files.write(tmp_path, TEXT)).table
    (tmp_path / "fcd.xml").unlink()
    if name.endswith(".zip"):
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            archive.writestr("fcd.xml", TEXT)
    else:
        (tmp_path / name).write_text(TEXT)
    pd.testing.assert_frame_equal(read(tmp_path / name).table, expected)


def test_a_mesoscopic_simulation_is_named(tmp_path):
    sumo_files.write(tmp_path, re.sub(r' lane="(\w+|:\w+)_\d"', r' edge="\1"', TEXT))
    with refused("format-unsupported", column="lane"):
        read(tmp_path)


@pytest.mark.parametrize("rate", [15.0, 30.0, 60.0])
def test_times_of_two_decimals_tell_the_time_step(tmp_path, rate):
    rows = []
    for step in range(150):
        for i in range(4):
            front = round(20.0 + 40.0 * i + 24.0 * step / rate, 3)
            place = {"x": front, "y": 0.0, "angle": 90.0, "type": "pkw", "speed": 24.0, "pos": front, "lane": "main_0"}
            rows.append({"time": round(step / rate, 2), "id": f"flow.{i}", **place})
    recording = read(sumo_files.write(tmp_path, sumo_files.csv_of(rows), "fcd.csv"))
    assert recording.info.frame_rate == rate
    assert len(recording.table) == len(rows)


def test_times_in_whole_seconds_are_too_coarse(tmp_path):
    rows = [row | {"time": round(float(row["time"]))} for row in sumo_files.rows()]
    sumo_files.write(tmp_path, sumo_files.xml_of(rows))
    with refused("times-too-coarse", column="time"):
        read(tmp_path)


def test_another_table_in_the_folder_is_named(tmp_path):
    sumo_files.write(tmp_path, sumo_files.csv_of(sumo_files.rows()), "fcd.csv")
    (tmp_path / "summary.csv").write_text("time;loaded\n0;1\n")
    with refused("not-a-table", file=str(tmp_path / "summary.csv")):
        read(tmp_path)
