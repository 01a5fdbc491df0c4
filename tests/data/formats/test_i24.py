"""I-24 MOTION: documents that are read block by block, windows and sections, speeds, and damaged files."""

import gzip
import json
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from benchmarks.sensor_layouts import i24_document, traffic
from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.files import json_documents
from rearl_jax.data.formats import i24
from rearl_jax.data.recordings import data_id, iterate_recordings
from rearl_jax.problems import InvalidInputError
from tests.refusal import refused

WHOLE: dict[str, Any] = {"window": None, "section": None}


@pytest.fixture(scope="module")
def vehicles() -> list:
    return list(islice(traffic(10.0, n_lanes=4), 16))


@pytest.fixture
def found(vehicles) -> list[dict]:
    return [i24_document(vehicle) for vehicle in vehicles]


@pytest.fixture
def read(tmp_path: Path):
    def read(content: list[dict] | str | bytes, on_bad: BadRows = BadRows.stop, **keys):
        content = json.dumps(content) if isinstance(content, list) else content
        path = tmp_path / "day.json"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return list(iterate_recordings(DataConfig(DataFormat.i24, str(tmp_path), on_bad=on_bad, **(WHOLE | keys))))

    return read


def test_both_carriageways_in_the_drivers_frame(vehicles, found, read):
    (recording,) = read(found)
    info, table = recording.info, recording.table
    assert (info.id, info.frame_rate, info.lane_count, recording.dropped) == ("i24_day", 10.0, {1: 4, 2: 4}, {})
    for vehicle in vehicles[:8]:
        own = table[table["track_id"] == vehicle.number]
        assert (own["direction"] == vehicle.direction).all()
        np.testing.assert_allclose(np.diff(own["position"]), np.diff(vehicle.along), atol=1e-6)
        np.testing.assert_allclose(own["speed"].iloc[1:-1], vehicle.speed[1:-1], rtol=1e-3)
        np.testing.assert_allclose(own["length"], vehicle.length)
        assert set(own["vehicle_class"]) == {"truck" if vehicle.is_truck else "car"}
        np.testing.assert_allclose(own["lateral"], 12 * 0.3048 * vehicle.lateral / 3.6)
    # x falls westbound, the position rises.
    west = table[table["direction"] == 1]
    assert (west.groupby("track_id")["x"].last() < west.groupby("track_id")["x"].first()).all()
    assert table["acceleration"].isna().all()


def test_centres_are_half_a_length_before_the_rear(found, read):
    (recording,) = read(found)
    trucks = recording.table.groupby("track_id").first()
    rear = found[4]["x_position"][0] * 0.3048 - 0.5 * 14.0
    assert trucks["x"][5] - trucks["x"][1] == pytest.approx(rear - (found[0]["x_position"][0] * 0.3048 + 2.3), abs=1e-6)


def test_windows_and_sections_share_out_all_rows(found, read):
    (whole,) = read(found)
    parts = read(found, window=7.0, section=150.0)
    assert len(parts) > 8
    assert sum(len(part.table) for part in parts) == len(whole.table)
    for part in parts:
        assert part.info.road_length == 150.0
        assert part.table["position"].between(-0.1, 150.1).all()
        assert np.ptp(part.table["time"]) <= 7.0
    assert parts[0].info.id.startswith("i24_20221122_07")
    # Speeds do not know where a recording was cut.
    speeds = np.sort(pd.concat([part.table for part in parts])["speed"])
    np.testing.assert_array_equal(speeds, np.sort(whole.table["speed"]))


def test_lines_arrays_and_small_blocks_say_the_same(found, read, monkeypatch):
    (array,) = read(found)
    lines = "\n".join(json.dumps(document) for document in found)
    indented = json.dumps(found, indent=2)
    monkeypatch.setattr(json_documents, "BLOCK_BYTES", 3000)
    monkeypatch.setattr(i24, "_BATCH_BYTES", 10_000)
    for content in (lines, indented, "\ufeff" + indented):
        (other,) = read(content)
        pd.testing.assert_frame_equal(array.table, other.table)


def test_brackets_in_texts_are_no_documents(found, read):
    found[3]["flags"] = ["}{", 'a "{" b', "\\"]
    (recording,) = read(found)
    assert recording.table["track_id"].nunique() == len(found)


def test_other_windows_are_another_data_set(found, read, tmp_path):
    read(found)
    changes: list[dict[str, Any]] = [{}, {"window": 300.0}, WHOLE]
    usual, same, other = (data_id(DataConfig(DataFormat.i24, str(tmp_path), **keys)) for keys in changes)
    assert usual == same != other


def test_rows_beside_the_lanes_have_no_lane(found, read):
    found[0]["y_position"] = [5.0] * len(found[0]["y_position"])
    (recording,) = read(found)
    own = recording.table["track_id"] == 1
    assert recording.table.loc[own, "lane"].isna().all()
    assert any(f"{own.sum()} rows beside the lanes" in note for note in recording.info.notes)


def test_times_between_frames_are_noted(found, read):
    found[0]["timestamp"] = [time + 0.03 for time in found[0]["timestamp"]]
    (recording,) = read(found)
    assert any(note.startswith("1 vehicles have times between") for note in recording.info.notes)


def _each(found: list[dict], **changes) -> list[dict]:
    return [document | {name: change(document) for name, change in changes.items()} for document in found]


def _scaled(name: str, factor: float):
    return {name: lambda document: (factor * np.array(document[name])).tolist()}


def _back(document: dict) -> float:
    """The second time of a document, as its first one."""
    return document["timestamp"][1]


@pytest.mark.parametrize(
    ("change", "code", "fields"),
    [
        (lambda d: [{k: v for k, v in x.items() if k != "y_position"} for x in d], "column-missing", {}),
        (lambda d: _each(d, **_scaled("x_position", 0.3048)), "wrong-units", {"column": "x_position"}),
        (lambda d: _each(d, **_scaled("y_position", 0.3048)), "wrong-units", {"column": "y_position"}),
        (lambda d: _each(d, **_scaled("timestamp", 1000.0)), "wrong-units", {"column": "timestamp"}),
        (lambda d: _each(d, **_scaled("length", 0.3048)), "wrong-units", {"column": "length"}),
        (lambda d: _each(d, direction=lambda x: -x["direction"]), "wrong-direction", {"column": "x_position"}),
        (lambda d: [d[0], {**d[1], "x_position": d[1]["x_position"][:-1]}], "lengths-differ", {"row": 2}),
        (lambda d: [*d, d[4]], "duplicate", {"row": 17}),
        (lambda d: [d[0], {**d[1], "x_position": d[1]["x_position"][::-1]}, *d[2:]], "wrong-direction", {"row": 2}),
        (lambda d: [d[0], {**d[1], "x_position": "far"}, *d[2:]], "broken-document", {"column": "x_position"}),
        (lambda d: _each(d, length=lambda x: [x["length"]]), "broken-document", {"row": 1, "column": "length"}),
        (lambda d: [d[0], {**d[1], "width": "wide"}, *d[2:]], "broken-document", {"row": 2, "column": "width"}),
        (lambda d: [d[0], {**d[1], "timestamp": [_back(d[1]), *d[1]["timestamp"][1:]]}], "time-unordered", {"row": 2}),
        (lambda d: gzip.compress(json.dumps(d).encode()), "not-json", {}),
        (lambda d: [d[0], {**d[1], "direction": 0}, *d[2:]], "wrong-direction", {"row": 2}),
        (lambda d: [d[0], {**d[1], "length": None}, *d[2:]], "value-missing", {"row": 2, "column": "length"}),
        (lambda d: [d[0], {**d[1], "coarse_vehicle_class": 9}, *d[2:]], "unknown-class", {"row": 2}),
        (lambda d: [d[0], {**d[1], "coarse_vehicle_class": None}, *d[2:]], "unknown-class", {"row": 2}),
        (lambda d: [d[0], {**d[1], "timestamp": [], "x_position": [], "y_position": []}], "no-rows", {"row": 2}),
        (lambda d: [], "file-empty", {}),
        (lambda d: "id,time\n1,2\n", "not-json", {}),
        (lambda d: "", "file-empty", {}),
        (lambda d: json.dumps(d)[:-4000], "broken-document", {}),
        (lambda d: json.dumps(d)[:-1], "broken-document", {"row": 17}),
        (lambda d: json.dumps(d).replace("}, {", "} nonsense {", 1), "not-json", {}),
        (lambda d: json.dumps(d).encode()[:3000] + b"\xff" + json.dumps(d).encode()[3001:], "broken-document", {}),
    ],
)
def test_a_fault_is_named(found, read, change, code, fields):
    with refused(code, **fields):
        read(change(found))


def test_the_remedy_for_a_class_is_a_number_of_the_format(found, read):
    with refused("unknown-class") as caught:
        read([found[0], {**found[1], "coarse_vehicle_class": 9}, *found[2:]])
    assert "6 (motorcycle)" in str(caught.value)
    (recording,) = read([found[0], {**found[1], "coarse_vehicle_class": 6}, *found[2:]], BadRows.drop_track)
    assert set(recording.table.loc[recording.table["track_id"] == 2, "vehicle_class"]) == {"motorcycle"}


def test_ids_may_be_texts(found, read):
    (expected,) = read(found)
    (recording,) = read(_each(found, _id=lambda document: document["_id"]["$oid"]))
    pd.testing.assert_frame_equal(recording.table, expected.table)
    with refused("duplicate", row=17):
        read(_each([*found, found[4]], _id=lambda document: document["_id"]["$oid"]))


def test_dropped_documents_are_counted_with_the_first_recording(found, read):
    found[2]["x_position"] = found[2]["x_position"][:-1]
    text = json.dumps(found)[:-4000]
    first, *others = read(text, BadRows.drop_row, window=7.0)
    assert {name: first.dropped[name] for name in ("lengths_differ", "broken_document")} == {
        "lengths_differ": 1,
        "broken_document": 1,
    }
    assert others
    assert not any("broken_document" in other.dropped for other in others)


def test_a_single_wrong_sample_is_a_fault_of_its_row(found, read):
    found[2]["x_position"][100] += 400.0
    with refused("out-of-range", row=3):
        read(found)
    (recording,) = read(found, BadRows.drop_row)
    assert sum(recording.dropped.values())


def test_windows_must_be_positive(tmp_path):
    for name in ("window", "section"):
        with refused("out-of-range", InvalidInputError, key=name):
            replace(DataConfig(DataFormat.i24, str(tmp_path)), **{name: 0.0}).check()


@pytest.mark.parametrize("keys", [{"section": 5.0}, {"window": 0.4}])
def test_parts_too_small_for_names_of_their_own_are_refused(found, read, keys):
    with refused("out-of-range", InvalidInputError, key=f"data.{next(iter(keys))}"):
        read(found, **keys)


def test_lateral_positions_of_one_carriageway_in_another_unit_stop(read):
    documents = [i24_document(vehicle) for vehicle in islice(traffic(10.0, n_lanes=4), 24)]
    other = [{**d, "y_position": [0.3048 * y for y in d["y_position"]]} if d["direction"] < 0 else d for d in documents]
    assert read(documents)
    with refused("wrong-units", column="y_position"):
        read(other)


def test_another_file_in_the_folder_is_to_be_moved_away(found, read, tmp_path):
    (tmp_path / "metadata.json").write_text('{"note": 1}')
    with refused("not-a-table", file=str(tmp_path / "metadata.json")):
        read(found)
