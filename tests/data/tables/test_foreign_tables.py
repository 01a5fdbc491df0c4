"""Tables of other names and units, read with `data.columns` and `data.units`: ids, times, encodings."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax import cut_scenes, read_recordings
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.problems import BadRecordingError
from rearl_jax.data.recordings import data_id
from rearl_jax.data.tables.canonical import TableFile, write_recording
from rearl_jax.data.units import factor_of
from tests.data.table_files import read_rows, read_table, write_table
from tests.refusal import refused

COLUMNS = {"track_id": "Vehicle ID", "time": "t", "position": "dist", "speed": "v", "lane": "lane no"}
UNITS = {"position": "ft", "speed": "km/h", "time": "ms"}


@pytest.fixture
def foreign(vehicle_rows) -> pd.DataFrame:
    """The rows with names and units of their own: feet, km/h, ms."""
    return pd.DataFrame(
        {
            "Vehicle ID": vehicle_rows["track_id"],
            "t": (vehicle_rows["frame"] - 7) * 100,
            "dist": vehicle_rows["position"] / 0.3048,
            "v": vehicle_rows["speed"] * 3.6,
            "lane no": vehicle_rows["lane"],
            "speed": "fast",
        }
    )


def _read(rows: pd.DataFrame, columns=COLUMNS, units=UNITS):
    return read_rows(rows, columns=dict(columns), units=dict(units))


@pytest.mark.parametrize("ending", [".csv", ".parquet", ".dat"])
def test_names_and_units_make_a_table_canonical(foreign, vehicle_rows, tmp_path, ending):
    path = write_table(foreign, tmp_path / f"cam{ending}")
    found = read_table(path, columns=COLUMNS, units=UNITS)
    in_frame = _read(foreign)
    assert found.info.frame_rate == in_frame.info.frame_rate == 10.0
    for name in ("track_id", "position", "x", "speed", "lane"):
        expected = vehicle_rows["position" if name == "x" else name].to_numpy(np.float64)
        np.testing.assert_allclose(found.table[name].to_numpy(np.float64), expected, rtol=1e-12)
        np.testing.assert_allclose(in_frame.table[name].to_numpy(np.float64), expected, rtol=1e-12)
    assert set(found.table["length"]) == {4.5}
    assert any("every vehicle is 4.5 m long" in note for note in found.info.notes)
    with refused("wrong-units", column="v"):
        read_table(path, columns=COLUMNS, units=UNITS | {"speed": "mph"})


def test_names_and_units_belong_to_the_identity_of_the_data(foreign, tmp_path):
    foreign.to_csv(tmp_path / "cam.csv", index=False)

    def identity(**keys):
        return data_id(DataConfig(DataFormat.table, str(tmp_path), **keys))

    keys = ({}, {"columns": COLUMNS}, {"columns": COLUMNS, "units": UNITS}, {"units": COLUMNS})
    assert len({identity(**one) for one in keys}) == len(keys)
    assert identity(columns=COLUMNS) == identity(columns=dict(reversed(COLUMNS.items())))


@pytest.mark.parametrize(
    ("columns", "units", "code", "key"),
    [
        ({"speeed": "v"}, {}, "column-unknown", "data.columns.speeed"),
        ({"speed": "vv"}, {}, "column-missing", "data.columns.speed"),
        ({"x": "dist"}, {}, "column-shared", "data.columns.x"),
        ({}, {"laen": "from 1"}, "column-unknown", "data.units.laen"),
        ({}, {"lane": "m"}, "unit-unknown", "data.units.lane"),
        ({}, {"speed": "km/s"}, "unit-unknown", "data.units.speed"),
        ({}, {"speed": "m"}, "unit-unknown", "data.units.speed"),
        ({}, {"width": "m"}, "column-missing", "data.units.width"),
        ({"speed": None}, {}, "column-missing", None),
    ],
)
def test_a_wrong_name_or_unit_is_named_with_the_nearest(foreign, columns, units, code, key):
    with refused(code, key=key) as caught:
        _read(foreign, COLUMNS | columns, units)
    nearest = {"speeed": "speed", "vv": "v", "km/s": "km/h", "laen": "lane"}
    for wrong, close in nearest.items():
        if wrong in (*columns, *columns.values(), *units.values()):
            assert close in str(caught.value)


def test_a_table_in_memory_takes_names_and_units(foreign):
    keys = {"columns": COLUMNS, "units": UNITS}
    scenes = cut_scenes(foreign, data=keys, scenes={"seconds": 5, "min_vehicles": 3, "slots": 3})
    assert len(scenes) == 2  # of 5 s in 10 s


def test_units_have_multiples_signs_and_rates():
    assert factor_of("km/h", "m/s") == factor_of("KMH", "m/s") == 1 / 3.6
    assert factor_of("-ft", "m") == -0.3048
    assert factor_of("0.1 s", "s") == factor_of("10/s", "s") == 0.1
    assert factor_of("25/s", "1/s") == factor_of("25 Hz", "1/s") == 25.0
    assert [factor_of(text, "m") for text in ("", "5", "0 m", "s", "m m")] == [None] * 5


def test_frames_of_a_stated_rate_are_a_clock(foreign):
    rows = foreign.assign(t=foreign["t"] // 100 + 3)
    columns = COLUMNS | {"frame": "t"}
    del columns["time"]
    assert _read(rows, columns, {**_without(UNITS), "frame": "10/s"}).info.frame_rate == 10.0
    with refused("frame-rate-unknown"):
        _read(rows, columns, _without(UNITS))
    every_second = rows.assign(t=rows["t"] * 2)
    found = _read(every_second, columns, {**_without(UNITS), "frame": "20/s"})
    assert found.info.frame_rate == 10.0
    assert any("every 2th frame" in note for note in found.info.notes)


def _without(units):
    return {name: unit for name, unit in units.items() if name != "time"}


@pytest.mark.parametrize(
    "form",
    [
        "%Y-%m-%dT%H:%M:%S.%fZ",
        "%Y-%m-%d %H:%M:%S,%f",
        "%d.%m.%Y %H:%M:%S.%f",
        "%m/%d/%Y %I:%M:%S.%f %p",
        "%H:%M:%S.%f",
        "mixed",
    ],
)
def test_dates_and_times_are_seconds(foreign, tmp_path, form):
    moments = pd.Timestamp("2024-05-31 11:59:55") + pd.to_timedelta(foreign["t"], unit="ms")
    texts = moments.astype(str) if form == "mixed" else moments.dt.strftime(form)
    foreign.assign(t=texts).to_csv(tmp_path / "a.csv", sep=";", index=False)
    found = read_table(tmp_path / "a.csv", columns=COLUMNS, units=_without(UNITS))
    assert found.info.frame_rate == 10.0
    assert any("dates and times of day" in note for note in found.info.notes)
    spoiled = foreign.assign(t=texts)
    spoiled.loc[41, "t"] = "yesterday"
    spoiled.to_csv(tmp_path / "a.csv", index=False)
    with refused("value-unreadable", column="t", row=42):
        read_table(tmp_path / "a.csv", columns=COLUMNS, units=_without(UNITS))


def test_times_with_and_without_their_offset_from_utc_do_not_mix(foreign, tmp_path):
    moments = pd.Timestamp("2024-10-27 02:59:55") + pd.to_timedelta(foreign["t"], unit="ms")
    texts = moments.map(pd.Timestamp.isoformat)
    rows = foreign.assign(t=texts.where(foreign.index < 100, texts + "+02:00"))
    with refused("time-ambiguous", column="t", row=101):
        _read(rows, COLUMNS, _without(UNITS))
    both = texts.where(foreign.index < 100, moments.map(lambda moment: f"{moment - pd.Timedelta('1h')}+01:00"))
    stated = both.where(foreign.index >= 100, texts + "+02:00")
    assert _read(foreign.assign(t=stated), COLUMNS, _without(UNITS)).info.frame_rate == 10.0


@pytest.mark.parametrize("rate", [30.0, 25.0, 12.5])
def test_rounded_times_tell_frames(foreign, vehicle_rows, rate):
    number = vehicle_rows["frame"] - 7
    rows = foreign.assign(t=(number / rate).round(2) + 1.6e9, dist=vehicle_rows["speed"] * number / rate + 9.0)
    found = _read(rows.assign(dist=rows["dist"] + 100 - 20 * vehicle_rows["track_id"]), COLUMNS, {"speed": "km/h"})
    assert found.info.frame_rate == pytest.approx(rate, abs=0.01)
    assert set(found.table["frame"]) == set(range(100))


def test_times_without_a_step_tell_no_frames(foreign):
    rng = np.random.default_rng(0)
    with refused("frames-unknown", column="t"):
        _read(foreign.assign(t=foreign["t"] + rng.uniform(0, 90, len(foreign))))


IDS = {
    "text": ["blue van", "9f86d081-884c-4d63", "x"],
    "huge": [2**60 + 1, 2**60 + 2, 2**60 + 3],
    "leading zeros": ["007", "07", "7"],
    "text and numbers": ["1", "2", "A3"],
}


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize("kind", IDS)
def test_ids_of_any_kind_are_numbered_and_kept(foreign, tmp_path, kind, ending):
    names = [str(name) for name in IDS[kind]]
    ids = foreign["Vehicle ID"].map(dict(zip((1, 2, 3), IDS[kind], strict=True)))
    leader = pd.Series(np.where(foreign["Vehicle ID"] == 3, IDS[kind][0], None), index=ids.index)
    rows = foreign.assign(**{"Vehicle ID": ids, "ahead": leader})
    path = write_table(rows, tmp_path / f"a{ending}")
    found = read_table(path, columns=COLUMNS | {"leader_id": "ahead"}, units=UNITS)
    assert found.info.labels == ("track_name",)
    assert found.labels["track_name"].astype(str).to_dict() == dict(zip((1, 2, 3), names, strict=True))
    assert found.table.loc[found.table["track_id"] == 3, "leader_id"].unique().tolist() == [1]
    assert any(f"1 is {names[0]}" in note for note in found.info.notes)
    (again,) = read_recordings(format="table", root=str(write_recording(found, tmp_path / "again.csv")))
    pd.testing.assert_frame_equal(again.table, found.table)


def test_ids_that_are_whole_numbers_stay(foreign):
    found = _read(foreign.assign(**{"Vehicle ID": (foreign["Vehicle ID"] + 40).astype(float).astype(str)}))
    assert found.table["track_id"].unique().tolist() == [41, 42, 43]
    assert found.info.labels == ()


def test_a_damaged_id_is_no_name(foreign, tmp_path):
    foreign.to_csv(tmp_path / "a.csv", index=False)
    text = (tmp_path / "a.csv").read_text().splitlines()
    text[50] = "!" + text[50]
    (tmp_path / "a.csv").write_text("\n".join(text))
    with refused("value-unreadable", column="Vehicle ID", row=50):
        read_table(tmp_path / "a.csv", columns=COLUMNS, units=UNITS)


@pytest.mark.parametrize(
    ("encoding", "delimiter"),
    [
        ("utf-8", ","),
        ("utf-8-sig", ";"),
        ("utf-16", "\t"),
        ("utf-16-le", "|"),
        ("utf-32", ","),
        ("latin-1", " "),
        ("latin-1", ";"),
    ],
)
def test_encodings_and_delimiters_are_recognised(foreign, tmp_path, encoding, delimiter):
    name = "Länge" if delimiter != " " else "Geschwindigkeit_für"
    rows = foreign.rename(columns={"v": name, "Vehicle ID": "id", "lane no": "lane"}).drop(columns="speed")
    decimal = "," if delimiter == ";" else "."
    rows.to_csv(tmp_path / "a.csv", index=False, sep=delimiter, encoding=encoding, decimal=decimal)
    columns = {"track_id": "id", "time": "t", "position": "dist", "speed": name}
    found = read_table(tmp_path / "a.csv", columns=columns, units=UNITS)
    assert len(found.table) == 300
    names = {"utf-16": "UTF-16", "utf-32": "UTF-32", "utf-16-le": "UTF-16, which", "latin-1": "Windows-1252, which"}
    said = names.get(encoding)
    assert any(said is not None and f"the file is {said}" in note for note in found.info.notes) == (said is not None)


def test_lines_before_the_names_are_passed_over(foreign, tmp_path):
    text = foreign.to_csv(index=False)
    for before in ("\n\n", "# made by a camera\n# on Monday, late\n", "sep=,\n"):
        (tmp_path / "a.csv").write_text(before + text)
        assert len(read_table(tmp_path / "a.csv", columns=COLUMNS, units=UNITS).table) == 300
    (tmp_path / "a.csv").write_text(f"# {text}")
    assert len(read_table(tmp_path / "a.csv", columns=COLUMNS, units=UNITS).table) == 300
    (tmp_path / "a.csv").write_text(text.partition("\n")[2].replace("fast", "1"))
    with refused("header-missing"):
        read_table(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "not-text"),
        ("id,v\nMüller,1\n".encode() + b"\xff,2\n", "not-text"),
        (b"id,v\n\x81,2\n", "not-text"),
        (b"\xff\xfei", "not-text"),
        (b"\n\n", "file-empty"),
    ],
)
def test_what_is_no_text_is_refused(tmp_path, content, code):
    (tmp_path / "a.csv").write_bytes(content)
    with refused(code, BadRecordingError):
        TableFile(tmp_path / "a.csv", DataConfig()).recordings()
