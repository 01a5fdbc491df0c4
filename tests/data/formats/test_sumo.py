"""SUMO's floating car data: fronts, lanes and links become one road; damaged and foreign files are refused."""

import gzip
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.formats import sumo_fcd
from rearl_jax.data.recordings import count_recordings, is_generated
from rearl_jax.problems import InvalidInputError, MissingInputError
from tests.data.formats import sumo_files
from tests.data.formats.sumo_files import read
from tests.refusal import refused

ROWS = sumo_files.rows()
TEXT = sumo_files.xml_of(ROWS)


def test_fronts_become_centres_on_one_road_and_lanes_count_from_the_left(tmp_path):
    recording = read(sumo_files.write(tmp_path, TEXT))
    table, info = recording.table, recording.info
    raw = pd.DataFrame(ROWS)
    on_road = raw[~raw["lane"].str.match(r"ramp|:j_0")]
    assert info.id == "sumo_fcd"
    assert info.generated
    assert is_generated(DataConfig(DataFormat.sumo, str(tmp_path)))
    assert recording.dropped == {"other_road": len(raw) - len(on_road)}
    assert recording.dropped["other_road"] > 20
    assert (info.frame_rate, info.lane_count, info.speed_limit) == (2.0, {1: 3}, 33.33)
    assert any("main, exit" in note for note in info.notes)
    merged = table.merge(on_road, left_on=["vehicle", "time"], right_on=["id", "time"], suffixes=("", "_raw"))
    assert len(merged) == len(table) == len(on_road)
    length = np.where(merged["type"] == "lkw", 12.5, 5.0)
    np.testing.assert_array_equal(merged["length"], length)
    assert set(merged.loc[merged["length"] == 12.5, "vehicle_class"]) == {"truck"}
    # x is the sum of the edges' lengths, which the reader does not know.
    np.testing.assert_allclose(merged["position"], merged["x_raw"] - length / 2, atol=0.05)
    np.testing.assert_allclose(merged["x"], merged["x_raw"] - length / 2)
    n_lanes = np.where(merged["lane_raw"].str.startswith("exit"), 3, 2)
    np.testing.assert_array_equal(merged["lane"], n_lanes - 1 - merged["lane_raw"].str[-1].astype(int))
    assert table.groupby("vehicle", observed=True)["track_id"].nunique().max() == 1


@pytest.mark.parametrize("name", ["fcd.xml.gz", "fcd.csv", "fcd.parquet"])
def test_other_files_of_the_same_rows_give_the_same_table(tmp_path, name):
    expected = read(sumo_files.write(tmp_path, TEXT)).table
    (tmp_path / "fcd.xml").unlink()
    if name.endswith(".gz"):
        (tmp_path / name).write_bytes(gzip.compress(TEXT.encode()))
    elif name.endswith(".csv"):
        # SUMO writes a line for persons, too, whose columns of vehicles are empty.
        (tmp_path / name).write_text(sumo_files.csv_of(ROWS) + ";".join(["50.0"] + 8 * [""]) + "\n")
    else:
        rows = pd.DataFrame(ROWS).rename(columns=lambda name: "timestep_time" if name == "time" else f"vehicle_{name}")
        rows.to_parquet(tmp_path / name, index=False)
    pd.testing.assert_frame_equal(read(tmp_path).table, expected)


def test_the_beginning_of_a_table_is_searched_for_elements_once(tmp_path, monkeypatch):
    searched = []
    monkeypatch.setattr(sumo_fcd, "root_of", lambda path: searched.append(path))
    read(sumo_files.write(tmp_path, sumo_files.csv_of(ROWS), "fcd.csv"))
    assert searched == [tmp_path / "fcd.csv"]


def test_without_types_and_network_what_is_assumed_is_said(tmp_path):
    recording = read(sumo_files.write(tmp_path, TEXT, beside=False))
    assert set(recording.table["length"]) == {4.5}
    assert set(recording.table["vehicle_class"]) == {"car", "truck"}  # by the names of the types
    notes = " ".join(recording.info.notes)
    assert "lkw, pkw: 4.5 m assumed" in notes or "pkw, lkw: 4.5 m assumed" in notes
    assert "lanes are counted by the vehicles" in notes
    assert recording.info.speed_limit is None


def test_a_vehicle_that_comes_back_is_another_track(tmp_path):
    """Left out for some steps on a link that is no part of the road."""
    rows = [dict(row) for row in ROWS]
    for row in rows:
        if row["id"] == "flow.0" and 10.0 <= row["time"] < 12.0:
            row["lane"] = "car_park_0"
    recording = read(sumo_files.write(tmp_path, sumo_files.xml_of(rows)))
    of_vehicle = recording.table[recording.table["vehicle"] == "flow.0"]
    assert of_vehicle["track_id"].nunique() == 2
    assert any("1 times a vehicle came back" in note for note in recording.info.notes)


def test_laps_of_a_ring_are_tracks_of_their_own(tmp_path):
    """Two vehicles drive round a ring of 400 m in two edges."""
    rows = []
    for step in range(120):
        for i in range(3):
            place = (20.0 * STEP_S * step + 40.0 * i) % 400.0
            edge = "north" if place < 250.0 else "south"
            pos = place - (0.0 if edge == "north" else 250.0)
            angle = 2.0 * np.pi * place / 400.0
            radius = 400.0 / (2.0 * np.pi)
            place_on_ground = {"x": radius * np.sin(angle), "y": radius * np.cos(angle)}
            heading = {"angle": 90.0 + np.rad2deg(angle), "type": "pkw", "speed": 20.0}
            rows.append({"time": STEP_S * step, "id": f"v{i}", **place_on_ground, **heading})
            rows[-1] |= {"pos": round(pos, 2), "lane": f"{edge}_0"}
    recording = read(sumo_files.write(tmp_path, sumo_files.xml_of(rows)))
    assert recording.dropped == {}
    assert recording.table["track_id"].nunique() > 6
    assert recording.info.road_length == pytest.approx(400.0, abs=11.0)
    steps = recording.table.groupby("track_id")["position"].diff().dropna()
    np.testing.assert_allclose(steps, 10.0, atol=0.02)


STEP_S = sumo_files.STEP


def _without(attribute: str) -> str:
    return TEXT.replace(f" {attribute}=", f" {attribute}_=")


@pytest.mark.parametrize(
    ("text", "code", "fields"),
    [
        pytest.param(_without("pos"), "column-missing", {"column": "pos"}, id="column"),
        pytest.param(_without("angle"), "column-missing", {"column": "angle"}, id="angle"),
        pytest.param(TEXT[: len(TEXT) // 2], "line-broken", {}, id="cut"),
        pytest.param(TEXT.replace("</timestep>", "</timestop>", 1), "not-xml", {}, id="not-xml"),
        pytest.param(TEXT.replace("<vehicle", "<vehikle", 1), "element-unknown", {}, id="element"),
        pytest.param(sumo_files.HEAD + "</fcd-export>", "no-rows", {}, id="no-rows"),
        pytest.param("", "line-broken", {}, id="empty"),
        pytest.param(TEXT.replace('speed="23', 'speed="2,3', 1), "value-unreadable", {"column": "speed"}, id="number"),
        pytest.param(TEXT.replace('pos="12.6"', "", 1), "not-finite", {"column": "pos"}, id="no-value"),
    ],
)
def test_damaged_files_are_refused(tmp_path, text, code, fields):
    sumo_files.write(tmp_path, text)
    with refused(code, **fields):
        read(tmp_path)


def test_a_file_that_was_cut_off_is_read_up_to_there(tmp_path):
    sumo_files.write(tmp_path, TEXT[: len(TEXT) * 9 // 10])
    recording = read(tmp_path, BadRows.drop_row)
    assert recording.dropped["broken_line"] == 1
    assert len(recording.table) > 0.8 * len(ROWS)
    assert any("what came after is not known" in note for note in recording.info.notes)


def test_a_damaged_row_does_not_move_the_others(tmp_path):
    expected = read(sumo_files.write(tmp_path, TEXT)).table
    rows = [dict(row) for row in ROWS]
    next(row for row in rows if row["id"] == "flow.1" and row["time"] == 20.0)["pos"] = -3.0
    table = read(sumo_files.write(tmp_path, sumo_files.xml_of(rows)), BadRows.drop_row).table
    table, expected = (t[t["vehicle"] == "flow.2"].reset_index(drop=True) for t in (table, expected))
    pd.testing.assert_frame_equal(table, expected)


def test_a_speed_that_stands_for_none_is_named_and_moves_no_other_vehicle(tmp_path):
    expected = read(sumo_files.write(tmp_path, TEXT)).table
    rows = [row | {"speed": -1073741824.0} if row["id"] == "flow.1" and row["time"] > 20.0 else row for row in ROWS]
    sumo_files.write(tmp_path, sumo_files.xml_of(rows))
    place = next(n for n, row in enumerate(rows) if row["speed"] < 0.0)
    with refused("out-of-range", column="speed", row=place + 1):
        read(tmp_path)
    table = read(tmp_path, BadRows.drop_row).table
    table, expected = (t[t["vehicle"] == "flow.2"].reset_index(drop=True) for t in (table, expected))
    pd.testing.assert_series_equal(table["position"], expected["position"])


@pytest.mark.parametrize(("attribute", "factor"), [("speed", 3.6), ("pos", 3.28), ("time", 1000.0), ("x", 1e-5)])
def test_other_units_are_refused(tmp_path, attribute, factor):
    rows = [row | {attribute: row[attribute] * factor} for row in ROWS]
    sumo_files.write(tmp_path, sumo_files.xml_of(rows))
    with pytest.raises(InvalidInputError) as caught:
        read(tmp_path, BadRows.drop_row)
    assert caught.value.problem.code in ("wrong-units", "bad-time")


def test_a_missing_row_is_a_gap(tmp_path):
    text = TEXT.splitlines()
    del text[next(i for i, line in enumerate(text) if 'id="flow.2"' in line and i > 200)]
    sumo_files.write(tmp_path, "\n".join(text))
    with refused("gap"):
        read(tmp_path)


@pytest.mark.parametrize(
    "root", ["tripinfos", "detector", "instantE1", "snapshot", "SSMLog", "full-export", "trajectories"]
)
def test_other_outputs_of_sumo_are_passed_over_and_foreign_files_are_not(tmp_path, root):
    sumo_files.write(tmp_path, TEXT)
    (tmp_path / "e1.xml").write_text(f"<{root}/>")
    assert count_recordings(DataConfig(DataFormat.sumo, str(tmp_path))) == 1
    (tmp_path / "other.xml").write_text("<html/>")
    with refused("not-a-table"):
        count_recordings(DataConfig(DataFormat.sumo, str(tmp_path)))


def test_a_folder_without_floating_car_data_names_what_is_wanted(tmp_path):
    (tmp_path / "road.net.xml").write_text(sumo_files.NET)
    with refused("recordings-missing", MissingInputError):
        read(tmp_path)


@pytest.mark.parametrize("copy", [sumo_files.NET, sumo_files.TYPES], ids=["network", "types"])
def test_a_second_copy_of_a_file_beside_changes_nothing(tmp_path, copy):
    expected = read(sumo_files.write(tmp_path, TEXT))
    (tmp_path / "copy.xml").write_text(copy)
    recording = read(tmp_path)
    assert recording.info == expected.info
    pd.testing.assert_frame_equal(recording.table, expected.table)


@pytest.mark.parametrize(
    ("other", "code"),
    [
        (sumo_files.NET.replace('<lane id="exit_2" speed="33.33"/>', ""), "edge-contradicts"),
        (sumo_files.NET.replace('id="main_0" speed="33.33"', 'id="main_0" speed="27.78"'), "edge-contradicts"),
        (sumo_files.TYPES.replace("12.5", "18.75"), "type-contradicts"),
    ],
    ids=["lanes", "limit", "length"],
)
def test_files_beside_that_contradict_each_other_are_refused(tmp_path, other, code):
    sumo_files.write(tmp_path, TEXT)
    path = tmp_path / "zz.xml"
    path.write_text(other)
    with refused(code, file=str(path)):
        read(tmp_path)


@pytest.mark.parametrize("slow", [0, 1])
def test_the_limit_of_an_edge_is_that_of_its_fastest_lane(tmp_path, slow):
    sumo_files.write(tmp_path, TEXT)
    net = sumo_files.NET
    for edge in ("main", "exit"):
        net = net.replace(f'id="{edge}_{slow}" speed="33.33"', f'id="{edge}_{slow}" speed="22.22"')
        net = net.replace(f'id="{edge}_2" speed="33.33"', f'id="{edge}_2" speed="22.22"')
    (tmp_path / "road.net.xml").write_text(net)
    assert read(tmp_path).info.speed_limit == 33.33


@pytest.mark.parametrize("word", ["nan", "inf", "fast"])
def test_a_limit_that_is_not_a_number_is_refused(tmp_path, word):
    sumo_files.write(tmp_path, TEXT)
    path = tmp_path / "road.net.xml"
    path.write_text(sumo_files.NET.replace("33.33", word, 1))
    with refused("value-unreadable", column="speed", file=str(path)):
        read(tmp_path)


SIMULATION = """
import json, sys, warnings
warnings.simplefilter("ignore")
import libsumo
libsumo.start(["sumo", "-n", "t.net.xml", "-r", "t.rou.xml", "--step-length", "0.5", "--no-step-log",
               "--fcd-output", "fcd.xml", "--fcd-output.acceleration"])
said = []
for step in range(120):
    libsumo.simulationStep()
    for name in libsumo.vehicle.getIDList():
        vehicle = libsumo.vehicle
        said.append([libsumo.simulation.getTime() - 0.5, name, vehicle.getDistance(name), vehicle.getLength(name),
                     vehicle.getSpeed(name), vehicle.getLaneIndex(name), vehicle.getRoadID(name)])
libsumo.close()
json.dump(said, open("said.json", "w"))
"""


def test_a_real_simulation_has_the_values_that_libsumo_says(tmp_path):
    """A road of 2 km with two lanes, cars and trucks, in two edges; netconvert and libsumo make it."""
    pytest.importorskip("sumo")
    nodes = "".join(f'<node id="{name}" x="{x}" y="0"/>' for name, x in zip("abc", (0, 900, 2000), strict=True))
    edges = "".join(f'<edge id="{a}{b}" from="{a}" to="{b}" numLanes="2" speed="33.3"/>' for a, b in ("ab", "bc"))
    flows = "".join(
        f'<flow id="{kind}" type="{kind}" route="r" begin="0" end="60" vehsPerHour="{n}" departLane="best" '
        'departSpeed="max"/>'
        for kind, n in (("pkw", 1500), ("lkw", 300))
    )
    types = sumo_files.TYPES.removesuffix("</routes>") + '<route id="r" edges="ab bc"/>' + flows + "</routes>"
    for name, text in (("t.nod.xml", f"<nodes>{nodes}</nodes>"), ("t.edg.xml", f"<edges>{edges}</edges>")):
        (tmp_path / name).write_text(text)
    (tmp_path / "t.rou.xml").write_text(types)
    netconvert = Path(sys.executable).with_name("netconvert")
    words = [str(netconvert), "-n", "t.nod.xml", "-e", "t.edg.xml", "-o", "t.net.xml"]
    subprocess.run(words, cwd=tmp_path, check=True, capture_output=True)
    subprocess.run([sys.executable, "-c", SIMULATION], cwd=tmp_path, check=True, capture_output=True)
    recording = read(tmp_path)
    said = pd.DataFrame(
        json.loads((tmp_path / "said.json").read_text()),
        columns=["time", "vehicle", "driven", "size", "said_speed", "index", "edge"],
    )
    table = recording.table.astype({"vehicle": str})
    merged = table.merge(said, on=["vehicle", "time"])
    assert len(merged) == len(table) > 1000
    assert recording.dropped == {}
    assert recording.info.lane_count == {1: 2}
    assert set(merged["size"]) == {5.0, 12.5}
    np.testing.assert_array_equal(merged["length"], merged["size"])
    moved = merged["position"] - merged.groupby("vehicle")["position"].transform("first")
    np.testing.assert_allclose(moved, merged["driven"], atol=0.02)
    assert merged["driven"].max() > 1500.0
    np.testing.assert_allclose(merged["speed"], merged["said_speed"], atol=0.006)
    np.testing.assert_array_equal(merged["lane"], 1 - merged["index"])
    assert merged["edge"].str.startswith(":").any()


def test_places_within_the_lane_become_lateral_positions(tmp_path):
    found = [row | {"posLat": round(0.4 * np.sin(0.05 * number), 2)} for number, row in enumerate(ROWS)]
    table = read(sumo_files.write(tmp_path, sumo_files.xml_of(found))).table
    left = (table["lane"] + 0.5).to_numpy(np.float64) * 3.2 - table["lateral"].to_numpy()
    first = [row["posLat"] for row in found if row["id"] == "flow.0"]
    np.testing.assert_allclose(left[table["vehicle"] == "flow.0"], first, atol=1e-9)
    (tmp_path / "road.net.xml").write_text(sumo_files.NET.replace('id="main_0"', 'id="main_0" width="2.9"'))
    assert read(tmp_path).table["lateral"].isna().all()
