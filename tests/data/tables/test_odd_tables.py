"""Odd tables: what stands for no leader or no value, clocks past midnight, far origins, damaged rows and files."""

import gzip
import json
import re
import zipfile

import numpy as np
import pandas as pd
import pytest

from rearl_jax.cli.composition import compose_task
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.recordings import data_id, iterate_recordings
from rearl_jax.tasks import TASKS
from tests.data.table_files import read_rows, read_table, write_table
from tests.refusal import refused


@pytest.fixture
def rows(timed_rows) -> pd.DataFrame:
    return timed_rows


@pytest.mark.parametrize("nobody", [-1, 0, 9999, 65535])
def test_a_number_that_is_no_vehicle_stands_for_no_leader(rows, nobody):
    stated = rows.assign(leader_id=rows["leader_id"].fillna(nobody).astype(np.int64))
    found, expected = read_rows(stated), read_rows(rows)
    assert found.info.notes == expected.info.notes
    np.testing.assert_array_equal(found.table["leader_id"], expected.table["leader_id"])
    known = stated.assign(leader_id=stated["leader_id"].replace(nobody, 77))
    assert any("such as 77" in note for note in read_rows(known).info.notes)


def test_a_number_that_is_a_vehicle_is_its_leader(rows):
    rows = rows.replace({"track_id": {1: 0}, "leader_id": {1.0: 0.0}})
    table = read_rows(rows).table
    assert set(table.loc[table["track_id"] == 3, "leader_id"]) == {0}


@pytest.mark.parametrize("mark", ["-", "--", "?", "None", "NULL", "#DIV/0!", "1.#QNAN"])
def test_marks_of_unknown_values_are_no_numbers_and_can_be_dropped(rows, tmp_path, mark):
    rows = rows.astype({"speed": object, "width": object})
    rows.loc[120, "speed"] = mark
    rows.loc[130, "width"] = mark  # may be unknown
    rows.to_csv(tmp_path / "a.csv", index=False)
    with refused("not-finite", column="speed", row=121):
        read_table(tmp_path / "a.csv")
    assert read_table(tmp_path / "a.csv", on_bad="drop_row").dropped["not_finite"] == 1


def test_a_word_among_numbers_is_named(rows, tmp_path):
    rows = rows.astype({"speed": object})
    rows.loc[120, "speed"] = "fast"
    rows.to_csv(tmp_path / "a.csv", index=False)
    with refused("value-unreadable", column="speed", row=121, fault="'fast' is not a number"):
        read_table(tmp_path / "a.csv")


@pytest.mark.parametrize("name", ["position", "lateral"])
def test_a_placeholder_is_named_in_the_column_that_holds_it(rows, name):
    rows = rows.drop(columns=["x", "y"])
    rows.loc[120:122, name] = -9999.0
    with refused("out-of-range", column=name, row=121):
        read_rows(rows)


@pytest.mark.parametrize(("start", "form"), [("23:59:55", "%H:%M:%S.%f"), ("11:59:55", "%M:%S.%f")])
def test_times_of_day_go_on_after_midnight_and_after_the_hour(rows, start, form):
    moments = pd.Timestamp(f"2024-05-31 {start}") + pd.to_timedelta((rows["frame"] - 7) / 10.0, unit="s")
    found = read_rows(rows.drop(columns="frame").assign(time=moments.dt.strftime(form)))
    assert found.info.frame_rate == 10.0
    assert any("begins anew" in note for note in found.info.notes)
    np.testing.assert_allclose(found.table["position"], rows["position"])
    early = moments - pd.Timedelta(seconds=30)  # ends before
    found = read_rows(rows.drop(columns="frame").assign(time=early.dt.strftime(form)))
    assert not any("begins anew" in note for note in found.info.notes)


def test_lateral_positions_of_a_map_count_from_the_left_edge(rows):
    found = read_rows(rows.drop(columns=["x", "y"]).assign(lateral=rows["lateral"] + 5_700_000.0))
    np.testing.assert_allclose(found.table["lateral"], rows["lateral"], atol=1e-6)
    assert any("subtracted from the lateral positions" in note for note in found.info.notes)


def test_rows_with_further_empty_fields_are_whole(rows, tmp_path):
    head, *lines = rows.to_csv(index=False).splitlines()
    (tmp_path / "a.csv").write_text("\n".join([head, *(f"{line},," for line in lines)]), encoding="utf-8")
    found, expected = read_table(tmp_path / "a.csv").table, read_rows(rows).table
    pd.testing.assert_frame_equal(found.drop(columns="recording"), expected.drop(columns="recording"))
    (tmp_path / "a.csv").write_text("\n".join([head, *(f"{line},7" for line in lines)]), encoding="utf-8")
    with refused("line-broken", row=1):
        read_table(tmp_path / "a.csv")


def test_what_is_no_table_of_numbers_is_said_with_its_remedy(rows, tmp_path):
    path = tmp_path / "a.csv"
    head, *lines = rows.to_csv(index=False).splitlines()
    for end in ("\n", ""):
        path.write_text(head + end, encoding="utf-8")
        with refused("no-rows", file=str(path)):
            read_table(path)
    path.write_text("\n".join([head, *lines[:50], head, *lines[50:]]), encoding="utf-8")
    with refused("value-unreadable", row=51) as caught:
        read_table(path)
    assert "repeats the names" in caught.value.problem.remedy
    marked = rows.assign(position=rows["position"].map(lambda x: f"1'{x:06.2f}"))
    marked.to_csv(path, index=False)
    with refused("value-unreadable", column="position", row=1) as caught:
        read_table(path)
    assert "thousands" in caught.value.problem.remedy
    (tmp_path / "b.csv.gz").write_bytes(gzip.compress(gzip.compress(b"a,b\n1,2\n")))
    with refused("not-text", fault="the file is compressed twice"):
        read_table(tmp_path / "b.csv.gz")


def test_statements_about_other_recordings_are_not_passed_over(rows, tmp_path):
    path, beside = tmp_path / "a.csv", tmp_path / "a.csv.info.json"
    rows.to_csv(path, index=False)
    stated = {"id": "a", "frame_rate": 10.0, "lane_count": {"1": 3}, "road_length": 900.0}
    stated |= {"source": "hand", "licence": "none", "attribution": "nobody"}
    beside.write_text(json.dumps(stated), encoding="utf-8")  # one object, not a list of one
    assert read_table(path).info.road_length == 900.0
    beside.write_text(json.dumps([stated | {"id": "b"}]), encoding="utf-8")
    with refused("metadata-unusable", file=str(beside)):
        read_table(path)


def test_hidden_files_in_an_archive_are_passed_over(rows, tmp_path):
    with zipfile.ZipFile(tmp_path / "a.csv.zip", "w") as archive:
        archive.writestr("b/a.csv", rows.to_csv(index=False))
        for hidden in ("b/.DS_Store", "b/._a.csv", "__MACOSX/b/._a.csv"):
            archive.writestr(hidden, "x")
    assert len(read_table(tmp_path / "a.csv.zip").table) == len(rows)


@pytest.mark.parametrize("column", ["track_id", "leader_id"])
def test_lists_for_ids_are_named(rows, tmp_path, column):
    with refused("wrong-type", column=column):
        read_table(write_table(rows.assign(**{column: [[1]] * len(rows)}), tmp_path / "a.parquet"))


def test_an_archive_with_a_password_is_not_damaged(tmp_path):
    path = tmp_path / "a.csv.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.csv", "a,b\n1,2\n")
    content = bytearray(path.read_bytes())
    content[6] |= 1  # the flags of the entry, and of the directory, say that it is encrypted
    content[content.find(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(content)
    with refused("not-text", file=str(path)) as caught:
        read_table(path)
    assert "password" in caught.value.problem.remedy


def _with_drivers(path):
    (recording,) = iterate_recordings(DataConfig(DataFormat.table, str(path)), labels=("driver",))
    return recording


@pytest.mark.parametrize("kind", ["all", "rows", "words", "with commas"])
def test_single_quotes_enclose_fields(rows, tmp_path, kind):
    rows = rows.assign(driver="a, b" if kind == "with commas" else "ab")
    rows.to_csv(tmp_path / "a.csv", index=False)
    header, *lines = (tmp_path / "a.csv").read_text().splitlines()
    if kind in ("words", "with commas"):
        lines = [line.replace('"a, b"', "'a, b'").replace("ab", "'ab'") for line in lines]
    else:
        header, *lines = (",".join(f"'{field}'" for field in line.split(",")) for line in (header, *lines))
        header = header.replace("'", "") if kind == "rows" else header
    (tmp_path / "b.csv").write_text("\n".join([header, *lines]))
    expected, found = (_with_drivers(tmp_path / name) for name in ("a.csv", "b.csv"))
    pd.testing.assert_frame_equal(found.table.drop(columns="recording"), expected.table.drop(columns="recording"))
    pd.testing.assert_frame_equal(found.labels, expected.labels)


def test_a_field_without_an_end_beside_single_quotes_is_named(rows, tmp_path):
    path = tmp_path / "a.csv"
    rows.assign(driver="'ab'").to_csv(path, index=False)
    lines = path.read_text().splitlines()
    lines[3] = lines[3].replace("'ab'", "'" + 140_000 * "b")
    path.write_text("\n".join(lines))
    with refused("line-broken", file=str(path), line=4):
        read_table(path)


@pytest.mark.parametrize("text", ["fast, 'calm', old", "'s van"])
def test_single_quotes_within_a_text_enclose_nothing(rows, tmp_path, text):
    rows.assign(driver=text).to_csv(tmp_path / "a.csv", index=False)
    assert set(_with_drivers(tmp_path / "a.csv").labels["driver"]) == {text}


def test_a_row_that_is_there_twice_makes_no_words_of_ids(rows, tmp_path):
    stated = rows.assign(leader_id=rows["leader_id"].fillna(0).astype(np.int64))
    pd.concat([stated, stated.iloc[[50]]]).to_csv(tmp_path / "a.csv", index=False)
    found = read_table(tmp_path / "a.csv", on_bad="drop_row").table
    np.testing.assert_array_equal(found["leader_id"].isna(), read_rows(rows).table["leader_id"].isna())


@pytest.mark.parametrize("ending", ["csv", "parquet"])
@pytest.mark.parametrize("codes", [{1: "car", 2: "lkw"}, {"1": "car", "2": "truck"}])
def test_codes_of_classes_are_what_is_stated(rows, tmp_path, ending, codes):
    code = np.where(rows["track_id"] == 1, 1, 2)
    path = write_table(rows.assign(vehicle_class=code), tmp_path / f"a.{ending}")
    with refused("unknown-class", column="vehicle_class") as stopped:
        read_table(path)
    assert "data.classes={" in stopped.value.problem.remedy
    found = read_table(path, classes=codes).table
    assert set(found.loc[found["track_id"] == 1, "vehicle_class"]) == {"car"}
    assert set(found.loc[found["track_id"] != 1, "vehicle_class"]) == {"truck"}
    assert data_id(DataConfig(DataFormat.table, str(path), classes=codes)) != data_id(
        DataConfig(DataFormat.table, str(path), classes={1: "truck", 2: "truck"})
    )
    with refused("column-missing", key="data.classes"):
        read_table(path, classes=codes, columns={"vehicle_class": None})
    with refused("class-unknown", key="data.classes.2"):
        read_table(path, classes={1: "car", 2: "tank"})


def test_an_empty_class_is_what_is_stated_and_the_advice_helps(rows, tmp_path):
    path = tmp_path / "a.csv"
    rows.assign(vehicle_class=rows["vehicle_class"].mask(rows["track_id"] == 2)).to_csv(path, index=False)
    with refused("unknown-class", column="vehicle_class", row=101) as stopped:
        read_table(path)
    assert "'data.classes={nan: car}'" in stopped.value.problem.remedy
    for key in ("nan", float("nan")):
        found = read_table(path, classes={key: "truck"}).table
        assert set(found.loc[found["track_id"] == 2, "vehicle_class"]) == {"truck"}
        assert set(found.loc[found["track_id"] == 1, "vehicle_class"]) == {"car"}


@pytest.mark.parametrize("word", ["car (M1)", "Car, small: #1", "a {b}", 'say "car"', "yes"])
def test_the_advice_for_an_odd_class_can_be_typed(rows, word):
    with refused("unknown-class") as stopped:
        read_rows(rows.assign(vehicle_class=word))
    (advice,) = re.findall(r"'data\.classes=(\{.*: car\})'", stopped.value.problem.remedy)
    prepare = next(task for task in TASKS if task.words == "prepare")
    config = compose_task(prepare, ["data=table", "data.root=.", f"data.classes={advice}"], None)
    assert config.data.classes == {word: "car"}


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_the_least_integer_stands_for_an_unknown_value(rows, tmp_path, ending):
    path, least = tmp_path / f"a.{ending}", -(2**63)
    stated = rows.assign(leader_id=rows["leader_id"].fillna(least).astype(np.int64))
    found = read_table(write_table(stated, path))
    np.testing.assert_array_equal(found.table["leader_id"], read_rows(rows).table["leader_id"])
    lane = rows["lane"].where(rows.index != 120, least).astype(np.int64)
    with refused("lane-out-of-range", column="lane", row=121):
        read_table(write_table(rows.assign(lane=lane), path))
    assert read_table(path, on_bad="drop_row").dropped["lane_out_of_range"] == 1


@pytest.mark.parametrize("rounded", [np.floor, np.rint])
def test_times_too_coarse_for_frames_are_named(rows, rounded):
    coarse = rows.assign(time=rounded((rows["frame"] - 7) * 10.0 / 15.0) / 10.0, speed=1.5 * rows["speed"])
    with refused("times-too-coarse", column="time"):
        read_rows(coarse.drop(columns="frame"))
    assert read_rows(coarse).info.frame_rate == 15.0


def test_ids_that_lost_digits_are_named(rows, tmp_path):
    path = tmp_path / "a.csv"
    ids = rows["track_id"].map(lambda track: f"{1e17 + 16.0 * track:.6e}")
    rows.assign(track_id=ids).drop(columns="leader_id").to_csv(path, index=False)
    with refused("ids-rounded", column="track_id", row=101):
        read_table(path)
    own = rows["track_id"].map(lambda track: f"{track:d}.000e+17")
    rows.assign(track_id=own).drop(columns="leader_id").to_csv(path, index=False)
    assert read_table(path).table["track_id"].nunique() == 3


def test_the_vehicle_with_another_clock_is_named(rows):
    other = rows["track_id"] == 2
    with refused("wrong-units", column="time", row=101) as stopped:
        read_rows(rows.assign(time=rows["time"].where(~other, 1000.0 * rows["time"])))
    assert all(fact in stopped.value.problem.fault for fact in ("of vehicle 2 ", "ms"))


def test_times_that_go_back_are_named(rows):
    back = rows["time"].where(rows["frame"] < 60, rows["time"] - 3600.0)
    with refused("frame-rate-unknown", column="time") as stopped:
        read_rows(rows.assign(time=back))
    assert "UTC" in stopped.value.problem.remedy


def test_leaders_that_have_lost_digits_stop(rows, tmp_path):
    rows = rows.assign(track_id=2**53 + rows["track_id"], leader_id=rows["leader_id"] + float(2**53 + 2))
    with refused("ids-rounded", column="leader_id", row=201):
        read_table(write_table(rows, tmp_path / "a.parquet"))


def test_the_largest_ids_of_eight_bytes_are_read(rows, tmp_path):
    first = 2**63 - 100
    rows = rows.assign(track_id=first + rows["track_id"], leader_id=rows["leader_id"] + float(first))
    assert set(read_table(write_table(rows, tmp_path / "a.parquet")).table["track_id"]) == {1, 2, 3}
