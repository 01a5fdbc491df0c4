"""Vissim's vehicle records: both layouts and their units, links in sequence; damaged files are refused."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.recordings import is_generated, iterate_recordings
from rearl_jax.problems import InvalidInputError
from tests.data.formats import vissim_files
from tests.refusal import refused

ROWS = vissim_files.rows()
TEXT = vissim_files.record_of(ROWS)


def read(root, on_bad: BadRows = BadRows.stop):
    (recording,) = iterate_recordings(DataConfig(DataFormat.vissim, str(root), on_bad=on_bad))
    return recording


def test_fronts_on_links_become_centres_on_one_road(tmp_path):
    recording = read(vissim_files.write(tmp_path, TEXT))
    table, info = recording.table, recording.info
    raw = pd.DataFrame(ROWS, columns=["time", "no", "link", "lane", "front", "aside", "speed", "kind", "size"])
    assert info.id == "vissim_run_001"
    assert info.generated
    assert is_generated(DataConfig(DataFormat.vissim, str(tmp_path)))
    assert info.frame_rate == 5.0
    assert info.lane_count == {1: 2}
    assert recording.dropped == {"other_road": (raw["link"] == 77).sum()}
    assert recording.dropped["other_road"] > 20
    assert any("77" in note for note in info.notes)
    raw = raw[raw["link"] != 77].sort_values(["no", "time"])
    assert len(raw) == len(table)
    begin = raw["link"].map({1: 0.0, 10000: 500.0, 2: 512.0})
    np.testing.assert_array_equal(table["track_id"], raw["no"])
    np.testing.assert_allclose(table["position"], begin + raw["front"] - raw["size"] / 2 + 2.2, atol=0.03)
    np.testing.assert_allclose(table["speed"], raw["speed"], atol=0.001)
    np.testing.assert_array_equal(table["lane"], 2 - raw["lane"])
    np.testing.assert_allclose(table["lateral"], 3.5 * (table["lane"].astype(float) + 0.5))
    assert set(table.loc[table["length"] == 10.2, "vehicle_class"]) == {"truck"}
    assert set(table["type"]) == {"100", "200"}


@pytest.mark.parametrize(("length", "speed"), [("ft", "mph"), ("m", "m/s"), ("m", "mph")])
def test_units_that_the_file_states_are_converted(tmp_path, length, speed):
    expected = read(vissim_files.write(tmp_path, TEXT)).table
    vissim_files.write(tmp_path, vissim_files.record_of(ROWS, length, speed))
    table = read(tmp_path).table
    for name in ("position", "speed", "length"):
        np.testing.assert_allclose(table[name], expected[name], atol=0.01)


@pytest.mark.parametrize("speed", ["km/h", "mph"])
def test_the_older_layout_is_read(tmp_path, speed):
    expected = read(vissim_files.write(tmp_path, TEXT)).table
    vissim_files.write(tmp_path, vissim_files.old_record_of(ROWS, speed))
    table = read(tmp_path).table
    for name in ("position", "speed", "length", "lane"):
        np.testing.assert_allclose(table[name].astype(float), expected[name].astype(float), atol=0.05)


@pytest.mark.parametrize(("comma", "encoding"), [(False, "utf-8"), (True, "utf-8"), (True, "cp1252")])
def test_the_german_edition_is_read(tmp_path, comma, encoding):
    expected = read(vissim_files.write(tmp_path, TEXT)).table
    text = vissim_files.german_record_of(ROWS, "m/s", comma=comma)
    (tmp_path / "run_001.fzp").write_text(text, encoding=encoding)
    recording = read(tmp_path)
    for name in ("track_id", "lane", "position", "speed", "length", "vehicle_class", "type"):
        if name in ("position", "speed"):  # speeds are written with three places in another unit
            np.testing.assert_allclose(recording.table[name], expected[name], atol=0.001)
        else:
            np.testing.assert_array_equal(recording.table[name], expected[name])
    assert not any("assumed" in note and "right" not in note and "wide" not in note for note in recording.info.notes)
    (tmp_path / "run_001.fzp").write_text(text.replace("GESCHW;", "TEMPO;"), encoding=encoding)
    with refused("column-missing", column="GESCHW"):
        read(tmp_path)


def test_units_that_are_not_stated_are_vissims_own_and_a_note_says_so(tmp_path):
    text = "\n".join(line for line in TEXT.splitlines() if not line.startswith("*"))
    recording = read(vissim_files.write(tmp_path, text))
    assert any("m and km/h assumed" in note for note in recording.info.notes)
    text = vissim_files.record_of(ROWS, speed="mph")
    vissim_files.write(tmp_path, "\n".join(line for line in text.splitlines() if not line.startswith("*")))
    with refused("wrong-units", column="SPEED"):
        read(tmp_path, BadRows.drop_row)


def test_without_types_and_lengths_what_is_assumed_is_said(tmp_path):
    text = TEXT.replace("VEHTYPE", "SOMETHING").replace("LENGTH", "ELSE")
    recording = read(vissim_files.write(tmp_path, text))
    assert set(recording.table["length"]) == {4.5}
    assert set(recording.table["vehicle_class"]) == {"car"}
    assert recording.info.labels == ()
    notes = " ".join(recording.info.notes)
    assert "4.5 m assumed" in notes
    assert "cars assumed" in notes
    recording = read(vissim_files.write(tmp_path, TEXT.replace(";200;", ";642;")))
    assert any("642" in note for note in recording.info.notes)
    assert set(recording.table["vehicle_class"]) == {"car", "other"}


LINES = TEXT.splitlines()
FIRST = next(number for number, line in enumerate(LINES) if line.startswith("$VEHICLE"))


@pytest.mark.parametrize(
    ("text", "code", "fields"),
    [
        pytest.param(TEXT.replace("POS;", "POZ;"), "column-missing", {"column": "POS"}, id="column"),
        pytest.param(TEXT.replace(r"LANE\INDEX", "INDEX"), "column-missing", {"column": r"LANE\INDEX"}, id="lane"),
        pytest.param(TEXT[:-20], "line-broken", {"row": len(ROWS)}, id="cut"),
        pytest.param("", "file-empty", {}, id="empty"),
        pytest.param("\n".join(LINES[: FIRST + 1]), "no-rows", {}, id="no-rows"),
        pytest.param("a;b\n1;2\n", "not-a-table", {}, id="foreign"),
        pytest.param(TEXT.replace("[km/h]", "[furlong/day]"), "unit-unknown", {"column": "SPEED"}, id="unit"),
        pytest.param(TEXT.replace("[km/h]", "[m]"), "unit-unknown", {"column": "SPEED"}, id="unit of a length"),
        pytest.param(
            TEXT.replace(LINES[FIRST + 3], LINES[FIRST + 3].replace(";100;", ";100;x"), 1),
            "value-unreadable",
            {"column": "LENGTH", "row": 3},
            id="number",
        ),
        pytest.param(TEXT.replace("[km/h]", "[m/s]"), "wrong-units", {}, id="wrong-unit"),
        pytest.param(TEXT.replace(";10000;", ";1;", 1), None, {}, id="wrong-link"),
    ],
)
def test_damaged_files_are_refused(tmp_path, text, code, fields):
    vissim_files.write(tmp_path, text)
    if code is None:
        with pytest.raises(InvalidInputError):
            read(tmp_path)
        return
    with refused(code, **fields):
        read(tmp_path)


def test_broken_lines_are_counted(tmp_path):
    vissim_files.write(tmp_path, TEXT[:-20])
    assert read(tmp_path, BadRows.drop_row).dropped["broken_line"] == 1


def test_an_empty_line_below_the_names_of_columns_does_not_matter(tmp_path):
    expected = read(vissim_files.write(tmp_path, TEXT)).table
    text = "\n".join([*LINES[: FIRST + 1], "", *LINES[FIRST + 1 :]]) + "\n"
    pd.testing.assert_frame_equal(read(vissim_files.write(tmp_path, text)).table, expected)


def test_a_lateral_position_in_percent_is_named_by_its_column(tmp_path):
    rows = [[*row[:5], 100.0 * row[5], *row[6:]] for row in ROWS]
    with refused("wrong-origin", column="POSLAT"):
        read(vissim_files.write(tmp_path, vissim_files.record_of(rows)))


def test_types_with_words_have_the_class_of_the_word(tmp_path):
    text = vissim_files.record_of(vissim_files.rows()).replace(";100;", ";1001: Car;").replace(";200;", ";HGV;")
    assert set(read(vissim_files.write(tmp_path, text)).table["vehicle_class"]) == {"car", "truck"}


def test_positions_far_from_the_beginning_of_the_link_begin_at_0(tmp_path):
    rows = [row for row in vissim_files.rows() if row[2] == 1]
    near = read(vissim_files.write(tmp_path, vissim_files.record_of(rows)))
    far = [[*row[:4], row[4] + 50_000.0, *row[5:]] for row in rows]
    recording = read(vissim_files.write(tmp_path, vissim_files.record_of(far)))
    assert recording.info.road_length == pytest.approx(near.info.road_length, abs=10.0)
    assert recording.table["position"].min() < 10.0
