"""`rearl prepare FILE` where a column could be misread in silence: it is refused, or what is not certain is said."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from rearl_jax.data.survey.task import run
from tests.data.survey_tables import truth
from tests.data.table_files import read_table, write_table
from tests.refusal import refused


@pytest.fixture
def rows() -> pd.DataFrame:
    """Times, ids, positions and speeds under short names, and what else tables add."""
    return truth().rename(columns={"track_id": "id", "position": "x", "lateral": "y"}).round(3)


def _found(path: Path, table: Any, **options) -> dict:
    table.to_csv(path, index=False, **options)
    return run(str(path))


def _taken(found: dict) -> dict:
    return {one["canonical"]: (source, one["unit"]) for source, one in found["columns"].items()}


def _read(path: Path, columns: dict, **keys) -> pd.DataFrame:
    return read_table(path, columns=columns, **keys).table


SHORT = ["time", "id", "x", "speed"]


@pytest.mark.parametrize(("end", "name", "ahead"), [("front", "x_front", 0.5), ("rear", "rear position", -0.5)])
def test_positions_of_front_or_rear_become_those_of_the_centre(rows, tmp_path, end, name, ahead):
    table = rows[["time", "id", "speed", "length"]].assign(**{name: rows["x"] + ahead * rows["length"]})
    found = _found(tmp_path / "a.csv", table)
    assert _taken(found)[end] == (name, None)
    read = _read(tmp_path / "a.csv", {"track_id": "id", end: name})
    np.testing.assert_allclose(read["position"], rows["x"], atol=1e-9)
    with refused("column-shared", key=f"data.columns.{end}"):
        _read(tmp_path / "a.csv", {"track_id": "id", end: name, "position": "speed", "speed": "length"})


@pytest.mark.parametrize("ending", ["csv", "parquet"])
@pytest.mark.parametrize("mark", ["-", "N/A", "#DIV/0!", "NULL"])
def test_numbers_with_many_marks_of_unknown_values_are_numbers(rows, tmp_path, ending, mark):
    table = rows[[*SHORT, "acceleration"]].astype({"acceleration": str})
    table.loc[table.index % 8 == 3, "acceleration"] = mark
    path = write_table(table, tmp_path / f"a.{ending}")
    found = run(str(path))
    assert _taken(found)["acceleration"] == ("acceleration", None)
    assert "acceleration" not in found["refused"]
    read = _read(path, {"track_id": "id", "position": "x"})
    expected = rows["acceleration"].mask(rows.index % 8 == 3).to_numpy(np.float32)
    np.testing.assert_array_equal(read["acceleration"].to_numpy(np.float32), expected)


def test_boxes_of_a_picture_are_not_feet(rows, tmp_path):
    table = rows[SHORT].assign(width=rows["length"], height=rows["width"])
    found = _found(tmp_path / "a.csv", table)
    assert _taken(found)["length"] == ("width", None)
    assert _taken(found)["speed"] == ("speed", None)
    assert any("rear: x" in doubt for doubt in found["doubts"])
    found = _found(tmp_path / "a.csv", table.drop(columns="height"))
    assert "width" in found["refused"]
    assert _taken(found)["speed"] == ("speed", None)
    found = _found(tmp_path / "a.csv", rows[SHORT].assign(length=rows["length"], width=rows["length"] + 2.0))
    assert "width" in found["refused"]
    table = rows[SHORT].assign(length_m=rows["width"], width_m=rows["length"])
    assert {"length_m", "width_m"} <= set(_found(tmp_path / "a.csv", table)["refused"])


@pytest.mark.parametrize("with_lateral", [True, False])
def test_the_side_that_lanes_count_from_is_asked_for(rows, tmp_path, with_lateral):
    table = rows[[*SHORT, "y"]] if with_lateral else rows[SHORT]
    found = _found(tmp_path / "a.csv", table.assign(laneId=rows["lane"] + 1))
    (doubt,) = [doubt for doubt in found["doubts"] if "from the right" in doubt]
    assert ("lateral: -m, lane: -from 2" if with_lateral else "{lane: -from 2}") in doubt
    canonical = truth()[["track_id", "time", "position", "speed", "lane", "lateral", "length"]]
    assert _found(tmp_path / "a.csv", canonical)["doubts"] == []


def test_reversed_lateral_positions_count_from_the_left_edge(rows, tmp_path):
    table = rows[SHORT].assign(y=20.0 - rows["y"], lane=2 - rows["lane"])
    table.to_csv(tmp_path / "a.csv", index=False)
    columns = {"track_id": "id", "position": "x", "lateral": "y"}
    read = _read(tmp_path / "a.csv", columns, units={"lateral": "-m", "lane": "-from 2"})
    np.testing.assert_allclose(read["lateral"], rows["y"], atol=0.2)
    assert read["lane"].tolist() == rows["lane"].tolist()
    read = _read(tmp_path / "a.csv", columns | {"lane": None}, units={"lateral": "-m"})
    np.testing.assert_allclose(read["lateral"], rows["y"], atol=0.4)


def test_a_plane_in_which_the_road_is_turned_is_refused(rows, tmp_path):
    c, s = np.cos(0.17), np.sin(0.17)
    turned = rows.assign(x=rows["x"] * c + rows["y"] * s, y=rows["x"] * s - rows["y"] * c)
    with refused("wrong-units", column="x"):
        _found(tmp_path / "a.csv", turned[[*SHORT, "y"]])


@pytest.mark.parametrize("name", ["x_px", "x [pixel]", "pixels x"])
def test_pixels_are_no_feet(rows, tmp_path, name):
    table = rows[["time", "id"]].assign(**{name: 3.3 * rows["x"], "speed_kmh": 3.6 * rows["speed"]})
    with refused("column-missing", column="position"):
        _found(tmp_path / "a.csv", table)


def test_times_of_day_of_several_days_are_several_recordings(rows, tmp_path):
    moments = pd.Timestamp("2024-05-31T08:00:00") + pd.to_timedelta(rows["time"], unit="s")
    table = rows[["id", "x", "speed"]].assign(clock=moments.dt.strftime("%H:%M:%S.%f"))
    later = table.assign(id=table["id"] + 90, x=table["x"] + 7.0)
    both = pd.concat([table.assign(day="2024-05-30"), later.assign(day="2024-05-31")])
    found = _found(tmp_path / "a.csv", both)
    assert _taken(found)["recording"] == ("day", None)
    assert [(one["id"], one["vehicles"]) for one in found["recordings"]] == [("2024-05-30", 5), ("2024-05-31", 5)]
    assert "recording" not in _taken(_found(tmp_path / "a.csv", table.assign(day="2024-05-30")))


@pytest.mark.parametrize(
    ("header", "options"),
    [
        ("s,-,m,km/h\n", {}),
        ("[s];[];[m];[km/h]\n", {"sep": ";", "decimal": ","}),
        ("(s)\t(-)\t(m)\t(kmh)\n", {"sep": "\t"}),
    ],
)
def test_a_line_of_units_below_the_names_states_the_units(rows, tmp_path, header, options):
    names, _, below = rows[SHORT].assign(speed=3.6 * rows["speed"]).to_csv(index=False, **options).partition("\n")
    path = tmp_path / "a.csv"
    path.write_text(f"{names}\n{header}{below}", encoding="utf-8")
    found = run(str(path))
    assert _taken(found)["speed"][1] == "km/h"
    assert found["recordings"][0]["rows"] == len(rows)


@pytest.mark.parametrize(
    "above", ["Drone 3, Monday\nRoad: A9; lanes: 2\n\n", "% made by a logger\n% units: SI, time in s\n", "// a\n"]
)
def test_text_above_the_names_is_passed_over(rows, tmp_path, above):
    path = tmp_path / "a.csv"
    path.write_text(above + rows[SHORT].to_csv(index=False), encoding="utf-8")
    assert run(str(path))["recordings"][0]["rows"] == len(rows)


def test_french_names_offsets_from_utc_and_quoted_decimal_commas(rows, tmp_path):
    moments = pd.Timestamp("2024-05-31T08:00:00+02:00") + pd.to_timedelta(rows["time"], unit="s")
    table = pd.DataFrame(
        {
            "Horodatage": moments.astype(str),
            "Véhicule": rows["id"],
            "Voie": rows["lane"] + 1,
            "Abscisse (m)": rows["x"].astype(str).str.replace(".", ","),
            "Vitesse (km/h)": (3.6 * rows["speed"]).round(3).astype(str).str.replace(".", ","),
            "Longueur (m)": rows["length"].round(1).astype(str).str.replace(".", ","),
        }
    )
    found = _found(tmp_path / "a.csv", table, encoding="latin-1")
    assert _taken(found) == {
        "track_id": ("Véhicule", None),
        "time": ("Horodatage", None),
        "position": ("Abscisse (m)", None),
        "speed": ("Vitesse (km/h)", "km/h"),
        "length": ("Longueur (m)", None),
        "lane": ("Voie", "from 1"),
    }
    assert found["recordings"][0]["frame_rate"] == 10.0


def test_what_no_key_can_read_is_named(rows, tmp_path, capsys):
    wide = rows.pivot_table(index="time", columns="id", values=["x", "speed"])
    wide.columns = [f"{name}{vehicle}" for name, vehicle in wide.columns]
    with refused("column-missing", column="track_id"):
        _found(tmp_path / "a.csv", wide.reset_index())
    assert "columns of single vehicles" in " ".join(capsys.readouterr().out.split())
    on_globe = rows[["time", "id", "speed"]].assign(lat=48.0 + 1e-6 * rows["x"], lon=11.0 + 1e-6 * rows["x"])
    with refused("column-missing", column="position"):
        _found(tmp_path / "a.csv", on_globe)
    assert "lat, lon" in " ".join(capsys.readouterr().out.split())
    rows.to_json(tmp_path / "a.json", orient="records")
    with refused("not-a-table"):
        run(str(tmp_path / "a.json"))


@pytest.fixture
def two_carriageways(rows) -> pd.DataFrame:
    """The rows, and the same again on the other carriageway."""
    other = rows.assign(id=rows["id"] + 10, leader_id=rows["leader_id"] + 10 * (rows["leader_id"] > 0), direction=2)
    return pd.concat([rows.assign(direction=1), other], ignore_index=True)


@pytest.mark.parametrize("wrong", [["length", "width"], ["x", "y", "speed", "acceleration", "length", "width"]])
def test_one_carriageway_in_feet_makes_no_table_in_feet(two_carriageways, tmp_path, wrong):
    assert _taken(_found(tmp_path / "a.csv", two_carriageways))["length"] == ("length", None)
    spoiled = two_carriageways.copy()
    spoiled.loc[spoiled["direction"] == 2, wrong] /= 0.3048
    with refused("wrong-units", column="length") as caught:
        _found(tmp_path / "a.csv", spoiled)
    assert "only in direction 2" in caught.value.problem.fault


@pytest.mark.parametrize("names", [(1, -1), (0, 1), ("N", "S")])
def test_two_carriageways_of_other_names_do_not_become_one(two_carriageways, tmp_path, names):
    table = two_carriageways.assign(direction=two_carriageways["direction"].map(dict(zip((1, 2), names, strict=True))))
    with refused("column-missing", column="direction"):
        _found(tmp_path / "a.csv", table)


def test_a_table_that_would_lose_many_rows_is_not_read(rows, tmp_path):
    lines = rows[SHORT].to_csv(index=False).splitlines()
    half = len(lines) // 2
    mixed = [*lines[:half], *(line.replace(",", ";") for line in lines[half:])]
    (tmp_path / "a.csv").write_text("\n".join(mixed), encoding="utf-8")
    with refused("line-broken", row=half):
        run(str(tmp_path / "a.csv"))


def test_a_column_that_cannot_be_taken_says_why(rows, tmp_path):
    words = rows[SHORT].assign(x=rows["x"].map(lambda x: f"1.{x:06.2f}".replace(".", "'")))
    with refused("column-missing", column="position") as caught:
        _found(tmp_path / "a.csv", words.rename(columns={"x": "position"}))
    assert "holds no numbers" in caught.value.problem.fault
    twice = rows[[*SHORT, "length"]].set_axis([*SHORT, "speed"], axis=1)
    with refused("column-missing", column="speed") as caught:
        _found(tmp_path / "a.csv", twice)
    assert "occur twice: speed" in caught.value.problem.fault
