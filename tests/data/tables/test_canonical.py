"""Canonical tables in files: what is written is read back; foreign tables are worked out; damage is named."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.recordings import is_generated, iterate_recordings
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.data.schema import validate
from rearl_jax.data.tables.canonical import TableFile, write_recording
from tests.data.table_files import write_table
from tests.refusal import refused

STOP = DataConfig()
DROP_ROW = DataConfig(on_bad=BadRows.drop_row)


@pytest.fixture
def recording(vehicle_rows) -> Recording:
    info = RecordingInfo(
        id="made_07",
        frame_rate=10.0,
        lane_count={1: 3},
        road_length=300.0,
        source="made by hand",
        licence="CC0",
        attribution="nobody",
        generated=True,
        speed_limit=33.3,
        lane_markings={1: (0.0, 3.5, 7.0, 10.5)},
        notes=("one", "two"),
    )
    table, _ = validate(vehicle_rows, info, STOP)
    return Recording(info, table)


@pytest.mark.parametrize("ending", [".parquet", ".csv"])
def test_what_is_written_is_read_back(recording, tmp_path, ending):
    path = write_recording(recording, tmp_path / "deep" / f"a{ending}")
    file = TableFile(path, STOP)
    assert file.recordings() == ["made_07"]
    back = file.read("made_07")
    assert back.dropped == {}
    assert back.info.to_json() == recording.info.to_json()
    assert back.info.lane_markings == recording.info.lane_markings
    pd.testing.assert_frame_equal(back.table, recording.table)
    assert not list(path.parent.glob("*unfinished*"))
    data = DataConfig(DataFormat.table, str(tmp_path / "deep"))
    assert is_generated(data)
    assert [r.info.id for r in iterate_recordings(data)] == ["made_07"]


@pytest.mark.parametrize("ending", [".parquet", ".csv"])
def test_a_foreign_table_of_several_recordings_is_worked_out(recording, tmp_path, ending):
    other = recording.table.assign(recording="other", lane=0, position=recording.table["position"] + 5.0)
    both = pd.concat([recording.table.astype({"recording": str}), other], ignore_index=True)
    both["comment"] = "not in the schema"
    path = write_table(both, tmp_path / f"tables{ending}")
    file = TableFile(path, STOP)
    assert file.recordings() == ["made_07", "other"]
    first, second = (file.read(name) for name in file.recordings())
    assert first.info.frame_rate == 10.0
    assert (dict(first.info.lane_count), dict(second.info.lane_count)) == ({1: 2}, {1: 1})
    assert first.info.road_length == pytest.approx(first.table["position"].max() + 2.25)
    assert "derived from the rows" in first.info.notes[0]
    pd.testing.assert_frame_equal(first.table, recording.table)
    spoiled = both.copy()
    spoiled.loc[310, "speed"] = np.nan
    write_table(spoiled, path)
    with refused("not-finite", file=str(path), column="speed", row=311):
        TableFile(path, STOP).read("other")


@pytest.mark.parametrize("ending", [".parquet", ".CSV"])
def test_rows_may_come_frame_by_frame(recording, tmp_path, ending):
    by_frame = recording.table.sort_values(["frame", "track_id"])
    assert not (by_frame["track_id"].diff() == 0).any()
    write_table(by_frame, tmp_path / f"made_07{ending}")
    (found,) = iterate_recordings(DataConfig(DataFormat.table, str(tmp_path)))
    assert found.info.frame_rate == 10.0
    pd.testing.assert_frame_equal(found.table, recording.table)


def test_a_table_without_recording_is_named_after_its_file(recording, tmp_path):
    recording.table.drop(columns="recording").to_parquet(tmp_path / "motorway.parquet")
    (found,) = iterate_recordings(DataConfig(DataFormat.table, str(tmp_path / "motorway.parquet")))
    assert found.info.id == "motorway"
    assert set(found.table["recording"]) == {"motorway"}


def test_damaged_tables_stop(recording, tmp_path):
    csv = write_recording(recording, tmp_path / "a.csv")
    text = csv.read_text()
    csv.write_text(text[: text.rindex(",") - 20])
    with refused("line-broken", row=300):
        TableFile(csv, STOP).read("made_07")
    assert TableFile(csv, DROP_ROW).read("made_07").dropped == {"broken_line": 1}
    parquet = write_recording(recording, tmp_path / "a.parquet")
    parquet.write_bytes(parquet.read_bytes()[:-50])
    with refused("not-parquet"):
        TableFile(parquet, STOP).recordings()


def test_what_cannot_be_worked_out_is_asked_for(recording, tmp_path):
    path = tmp_path / "a.parquet"
    recording.table.drop(columns="time").to_parquet(path)
    with refused("frame-rate-unknown", column="time"):
        TableFile(path, STOP).read("made_07")
    recording.table.assign(time=0.0).to_parquet(path)
    with refused("frame-rate-unknown", column="time"):
        TableFile(path, STOP).read("made_07")
    recording.table.drop(columns="speed").to_parquet(path)
    with refused("column-missing", column="speed"):
        TableFile(path, STOP).read("made_07")
    for name in (None, "", "  "):
        recording.table.assign(recording=name).to_parquet(path)
        with refused("recording-unnamed", column="recording"):
            TableFile(path, STOP).recordings()


@pytest.mark.parametrize(
    ("ending", "writer"), [(".parquet", "pyarrow.parquet.write_table"), (".csv", "pandas.DataFrame.to_csv")]
)
def test_a_failed_write_leaves_the_old_files(recording, tmp_path, monkeypatch, ending, writer):
    path = write_recording(recording, tmp_path / f"a{ending}")
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    assert path.name in before

    def full_disk(*_, **__):
        raise OSError("no space left")

    monkeypatch.setattr(writer, full_disk)
    other = Recording(replace(recording.info, source="another"), recording.table)
    with pytest.raises(OSError, match="no space left"):
        write_recording(other, path)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before
    with refused("ending-unknown"):
        write_recording(recording, tmp_path / "a.txt")


@pytest.mark.parametrize(
    ("name", "kind", "text"),
    [
        ("recording", "int64", "7"),
        ("recording", "float64", "7"),
        ("recording", "category", "7"),
        ("recording", "bool", "true"),
        ("track_id", "uint64", None),
        ("track_id", "str", None),
        ("frame", "float32", None),
        ("lane", "str", None),
        ("position", "float32", None),
        ("vehicle_class", "category", None),
    ],
)
def test_a_parquet_column_may_have_any_type_that_says_the_same(timed_rows, tmp_path, name, kind, text):
    rows = timed_rows.assign(recording=7)
    path = tmp_path / "a.parquet"
    rows.astype({name: kind}).to_parquet(path)
    (recording,) = iterate_recordings(DataConfig(DataFormat.table, str(path)))
    assert recording.info.id == (text or "7")
    expected = validate(rows.drop(columns="recording"), recording.info, STOP)[0]
    pd.testing.assert_frame_equal(recording.table, expected, check_exact=False, rtol=1e-6)


@pytest.mark.parametrize("kind", ["datetime64[ms]", "datetime64[ns]", "timedelta64[us]"])
def test_moments_in_parquet_are_seconds(vehicle_rows, tmp_path, kind):
    time = pd.to_timedelta(vehicle_rows["frame"] / 10.0, unit="s")
    time = time if kind.startswith("time") else pd.Timestamp("2005-06-15") + time
    vehicle_rows.assign(time=time.astype(kind)).to_parquet(tmp_path / "a.parquet")
    (recording,) = iterate_recordings(DataConfig(DataFormat.table, str(tmp_path)))
    assert recording.info.frame_rate == 10.0
    assert recording.table["time"].iloc[1] - recording.table["time"].iloc[0] == pytest.approx(0.1, abs=1e-6)


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_large_ids_are_read(timed_rows, tmp_path, ending):
    rows = timed_rows.assign(track_id=timed_rows["track_id"] + 10**15)
    rows["leader_id"] += 10**15
    path = write_table(rows, tmp_path / f"a{ending}")
    (recording,) = iterate_recordings(DataConfig(DataFormat.table, str(path)))
    assert recording.table["track_id"].unique().tolist() == [10**15 + 1, 10**15 + 2, 10**15 + 3]
    assert recording.table["leader_id"].dropna().unique().tolist() == [10**15 + 1]


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize("policy", [BadRows.drop_row, BadRows.drop_track])
def test_what_is_read_can_be_written_and_read_again(vehicle_rows, tmp_path, ending, policy):
    rows = vehicle_rows.assign(time=(1.62e9 + vehicle_rows["frame"] / 10.0).round(0), recording="..\\cam 1")
    rows = rows.assign(position=rows["position"] - 5.7e6, vehicle_class=rows["vehicle_class"].str.upper())
    rows.loc[40, "acceleration"] = -9999.0
    rows.loc[130:250, "leader_id"] = 2
    rows.to_csv(tmp_path / "a.csv", index=False)
    (recording,) = iterate_recordings(DataConfig(DataFormat.table, str(tmp_path), on_bad=policy))
    assert recording.dropped["out_of_range"] >= 1
    path = write_recording(recording, tmp_path / "again" / f"a{ending}")
    (again,) = iterate_recordings(DataConfig(DataFormat.table, str(path)))
    assert again.dropped == {}
    assert again.info.to_json() == recording.info.to_json()
    pd.testing.assert_frame_equal(again.table, recording.table)
