"""pNEUMA: wide rows, a straight stretch that the user names, what is lost outside it, and damaged files."""

from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks.sensor_layouts import (
    LANE_WIDTH,
    PNEUMA_HEADER,
    ROAD_LENGTH,
    pneuma_line,
    pneuma_stretch,
    traffic,
)
from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.recordings import data_id, iterate_recordings
from rearl_jax.data.roads.stretch import stretch_of
from rearl_jax.problems import InvalidInputError
from tests.refusal import refused

STRETCH = pneuma_stretch()


@pytest.fixture(scope="module")
def vehicles() -> list:
    return list(islice(traffic(10.0, directions=(2,)), 6))


@pytest.fixture(scope="module")
def lines(vehicles) -> list[str]:
    return [pneuma_line(vehicle) for vehicle in vehicles]


@pytest.fixture
def read(tmp_path: Path):
    def read(
        lines: list[str],
        on_bad: BadRows = BadRows.stop,
        stretch: tuple[float, ...] | None = STRETCH,
        header: str = PNEUMA_HEADER,
        end: str = "\n",
    ):
        (tmp_path / "20181024_d1_0830_0900.csv").write_text("\n".join([header, *lines]) + end)
        data = DataConfig(DataFormat.pneuma, str(tmp_path), on_bad=on_bad, stretch=stretch)
        (recording,) = iterate_recordings(data)
        return recording

    return read


def _cells(line: str, change) -> str:
    """The line with its repeated cells, (moments, 6) texts, changed."""
    fields = [field.strip() for field in line.rstrip("; ").split(";")]
    cells = np.array(fields[4:], object).reshape(-1, 6)
    change(cells)
    return "; ".join([*fields[:4], *cells.ravel().tolist()]) + "; "


def _scaled(column: int, factor: float):
    def change(cells: np.ndarray) -> None:
        cells[:, column] = [f"{factor * float(cell):.6f}" for cell in cells[:, column]]

    return change


def test_the_stretch_is_a_straight_road(vehicles, lines, read):
    recording = read(lines)
    info, table = recording.info, recording.table
    assert (info.id, info.frame_rate, info.lane_count) == ("pneuma_20181024_d1_0830_0900", 10.0, {1: 3})
    assert info.road_length == pytest.approx(ROAD_LENGTH - 80.0, abs=0.1)
    n_rows = sum(len(vehicle.time) for vehicle in vehicles)
    assert recording.dropped == {"outside_stretch": n_rows - len(table)}
    for vehicle in vehicles[:3]:
        own = table[table["track_id"] == vehicle.number]
        here = (vehicle.along >= 40.0) & (vehicle.along <= ROAD_LENGTH - 40.0)
        # Degrees have six decimals, 0.1 m.
        np.testing.assert_allclose(own["position"], vehicle.along[here] - 40.0, atol=0.15)
        np.testing.assert_allclose(own["lateral"], vehicle.lateral[here], atol=0.15)
        np.testing.assert_allclose(own["speed"], vehicle.speed[here], atol=1e-4)
        assert set(own["lane"]) == {int(vehicle.lateral[0] // LANE_WIDTH)}
    assert table.groupby("track_id")["length"].first().tolist() == [4.5, 4.5, 4.5, 4.5, 12.0, 4.5]
    assert table["width"].isna().all()


def test_what_is_not_lost_is_not_counted(lines, read):
    latitude, longitude = STRETCH[2] - STRETCH[0], STRETCH[3] - STRETCH[1]
    longer = (STRETCH[0] - latitude, STRETCH[1] - longitude, STRETCH[2] + latitude, STRETCH[3] + longitude)
    assert read(lines, stretch=(*longer, *STRETCH[4:])).dropped == {}


def test_crossing_and_oncoming_vehicles_are_counted(vehicles, lines, read):
    fields = [str(field) for field in range(100)]
    # Across the street at half its length, and against it.
    middle = [(STRETCH[at] + STRETCH[at + 2]) / 2.0 for at in (0, 1)]
    steps = [(middle[0] + 2e-6 * step, middle[1] - 3e-6 * step) for step in range(-25, 25)]
    moments = [f"{lat:.6f}; {lon:.6f}; 36; 0; 0; {0.1 * at:.2f}" for at, (lat, lon) in enumerate(steps)]
    crossing = "; ".join([fields[90], "Car", "20", "36", *moments]) + "; "

    def backwards(cells: np.ndarray) -> None:
        cells[:, :2] = cells[::-1, :2]

    recording = read([*lines, crossing, "91" + _cells(lines[0], backwards)[1:]])
    assert recording.dropped["crossing"] > 10
    assert recording.dropped["oncoming"] == (recording.table["track_id"] == 1).sum()
    assert recording.table["track_id"].max() == len(vehicles)


def test_a_vehicle_that_comes_back_is_another_one(lines, read):
    first = lines[0].rstrip()
    again = _cells(lines[0], _scaled(5, 1.0))
    later = [field.strip() for field in again.rstrip("; ").split(";")][4:]
    moved = np.array(later, object).reshape(-1, 6)
    moved[:, 5] = [f"{float(cell) + 60.0:.2f}" for cell in moved[:, 5]]
    recording = read([first + " " + "; ".join(moved.ravel().tolist()) + "; ", *lines[1:]])
    assert recording.table["track_id"].nunique() == len(lines) + 1


def test_another_stretch_is_another_data_set(lines, read, tmp_path):
    read(lines)
    ids = {
        data_id(DataConfig(DataFormat.pneuma, str(tmp_path), stretch=text)) for text in (STRETCH, pneuma_stretch(60.0))
    }
    assert len(ids) == 2


@pytest.mark.parametrize(
    ("stretch", "code"),
    [
        (None, "stretch-missing"),
        ((37.98, 23.73, 37.99), "stretch-unusable"),
        ((37.98, 23.73, 37.98, 23.73, 10.0, 3.0), "stretch-unusable"),
        ((37.98, 23.73, 38.98, 23.73, 10.0, 3.0), "stretch-unusable"),
        ((37.98, 23.73, 37.981, 23.73, 100.0, 3.0), "stretch-unusable"),
        ((37.98, 23.73, 37.981, 23.73, 10.0, 2.5), "stretch-unusable"),
        ((95.0, 23.73, 37.981, 23.73, 10.0, 2.0), "stretch-unusable"),
        ((37.98, 23.73, 37.981, np.nan, 10.0, 2.0), "stretch-unusable"),
    ],
)
def test_a_stretch_that_is_none_is_named(stretch, code):
    with refused(code, InvalidInputError, key="data.stretch"):
        stretch_of(stretch)


def test_metres_are_those_of_the_globe():
    # A minute of latitude is a nautical mile, 1852 m, at 45 degrees within 0.1 %.
    assert stretch_of((45.0, 10.0, 45.0166667, 10.0, 10.0, 3.0)).length == pytest.approx(1852.0, rel=1e-3)
    assert stretch_of((60.0, 10.0, 60.0, 10.02, 10.0, 3.0)).length == pytest.approx(0.02 * 111_320.0 / 2.0, rel=3e-3)


def _set(row: int, column: int, cell: str):
    def change(cells: np.ndarray) -> None:
        cells[row, column] = cell

    return change


def _moved(cells: np.ndarray) -> None:
    """One place 55 m further north."""
    cells[120, 0] = f"{float(cells[120, 0]) + 0.0005:.6f}"


@pytest.mark.parametrize(
    ("change", "code", "fields"),
    [
        (lambda rows: [_cells(line, _scaled(2, 1.0 / 3.6)) for line in rows], "wrong-units", {"column": "speed"}),
        (lambda rows: [_cells(line, _scaled(5, 1000.0)) for line in rows], "wrong-units", {"column": "time"}),
        (lambda rows: [_cells(line, _scaled(0, np.pi / 180.0)) for line in rows], "no-rows", {}),
        (lambda rows: [rows[0], _cells(rows[1], _moved), *rows[2:]], "jump", {"row": 2}),
        (lambda rows: [rows[0], _cells(rows[1], _set(120, 0, "0")), *rows[2:]], "out-of-range", {"row": 2}),
        (lambda rows: [rows[0], _cells(rows[1], _set(120, 0, "")), *rows[2:]], "value-unreadable", {"row": 2}),
        (lambda rows: [rows[0], _cells(rows[1], _set(120, 2, "fast")), *rows[2:]], "value-unreadable", {"row": 2}),
        (lambda rows: [rows[0], _cells(rows[1], _set(120, 2, "nan")), *rows[2:]], "not-finite", {"row": 2}),
        (lambda rows: [rows[0], _cells(rows[1], _set(120, 5, "0.1")), *rows[2:]], "unsorted", {"row": 2}),
        (lambda rows: [rows[0], rows[1].replace("Car", "Boat"), *rows[2:]], "unknown-class", {"row": 2}),
        (lambda rows: [rows[0], rows[1].rpartition("; ")[0].rpartition("; ")[0], *rows[2:]], "line-broken", {"row": 2}),
        (lambda rows: [rows[0], "7; Car; 5; 5", *rows[2:]], "line-broken", {"row": 2}),
        (lambda rows: [*rows, rows[1]], "duplicate", {}),
        (lambda rows: ["x" + rows[0], *rows[1:]], "value-unreadable", {"row": 1}),
        (lambda rows: [], "no-rows", {}),
    ],
)
def test_a_fault_is_named(lines, read, change, code, fields):
    with refused(code, **fields):
        read(change(lines))


def test_whole_numbers_may_have_a_fraction_of_0(lines, read):
    other = [line.replace(";", ".0;", 1) for line in lines]
    pd.testing.assert_frame_equal(read(other).table, read(lines).table)
    with refused("value-unreadable", row=1):
        read([lines[0].replace(";", ".5;", 1), *lines[1:]])


def test_a_cut_line_is_named_or_counted(lines, read):
    # Cut within the last number: what is left is a number, too.
    cut = [*lines[:-1], lines[-1].rstrip("; ")[:-3]]
    with refused("line-broken", row=len(lines)):
        read(cut, end="")
    assert read(cut, BadRows.drop_row, end="").dropped["broken_line"] == 1


@pytest.mark.parametrize(
    ("header", "code"),
    [
        (PNEUMA_HEADER.replace("; speed", ""), "column-missing"),
        (PNEUMA_HEADER.replace("lat; lon", "lon; lat"), "columns-unordered"),
        ("a;b;c", "not-a-table"),
    ],
)
def test_another_header_is_named(lines, read, header, code):
    with refused(code):
        read(lines, header=header)


def test_a_stretch_elsewhere_is_named(lines, read):
    with refused("no-rows"):
        read(lines, stretch=(37.9, 23.7, 37.901, 23.7, 10.0, 3.0))


def test_a_copy_of_a_spreadsheet_says_the_same(lines, read):
    expected = read(lines).table
    widest = max(line.count(";") for line in lines)
    filled = [line.rstrip("; ") + ";" * (widest + 1 - line.rstrip("; ").count(";")) for line in lines]
    for rows, header in (
        (filled, f"sep=;\n{PNEUMA_HEADER}"),
        (filled, f"\n{PNEUMA_HEADER}{';' * (widest - 9)}"),
        ([line.replace("; ", "\t") for line in lines], PNEUMA_HEADER.replace("; ", "\t")),
        ([line.replace(".", ",") for line in lines], PNEUMA_HEADER),
    ):
        pd.testing.assert_frame_equal(read(rows, header=header).table, expected)


def test_every_second_moment_of_all_vehicles_is_read(vehicles, lines, read):
    """The second vehicle then has its times between the frames of the others."""

    def thinned(line: str, first: int) -> str:
        fields = line.rstrip("; ").split("; ")
        moments = ["; ".join(fields[at : at + 6]) for at in range(4, len(fields), 6)]
        return "; ".join([*fields[:4], *moments[first::2]]) + "; "

    starts = [(round(10.0 * vehicle.time[0]) + (number == 1)) % 2 for number, vehicle in enumerate(vehicles)]
    recording = read([thinned(line, start) for line, start in zip(lines, starts, strict=True)])
    assert recording.info.frame_rate == 5.0
    assert (recording.table.groupby("track_id")["frame"].diff().dropna() == 1).all()
    assert any("1 vehicles have times between" in note for note in recording.info.notes)


def test_types_have_their_lengths_whatever_their_case(lines, read):
    lower = [line.replace("Bus", "bus").replace("Car", "CAR") for line in lines]
    assert lower != lines
    pd.testing.assert_frame_equal(read(lower).table, read(lines).table)
