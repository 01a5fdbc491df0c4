"""Every format knows a file in its own layout by names and first lines, and no other format takes it for its own."""

import gzip
import json
from collections.abc import Callable
from itertools import islice
from pathlib import Path

import pandas as pd
import pytest

from benchmarks import sensor_layouts
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.readers import reader_of
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.data.survey.task import run
from tests.data.formats import openacc_files, sumo_files, vissim_files
from tests.data.formats.test_encodings import i24, ngsim_text, old_vissim, pneuma
from tests.refusal import refused


def _sumo_xml(folder: Path) -> Path:
    return sumo_files.write(folder, sumo_files.xml_of(sumo_files.rows(2, 4))) / "fcd.xml"


def _sumo_packed(folder: Path) -> Path:
    path = _sumo_xml(folder)
    packed = path.with_name("fcd.xml.gz")
    packed.write_bytes(gzip.compress(path.read_bytes()))
    path.unlink()
    return packed


def _sumo_csv(folder: Path) -> Path:
    return sumo_files.write(folder, sumo_files.csv_of(sumo_files.rows(2, 4)), "fcd.csv") / "fcd.csv"


def _sumo_parquet(folder: Path) -> Path:
    path = _sumo_csv(folder)
    pd.read_csv(path, sep=";").to_parquet(path.with_suffix(".parquet"))
    path.unlink()
    return path.with_suffix(".parquet")


def _vissim(folder: Path) -> Path:
    return vissim_files.write(folder, vissim_files.record_of(vissim_files.rows(2, 30))) / "run_001.fzp"


def _i24_lines(folder: Path) -> Path:
    documents = map(sensor_layouts.i24_document, islice(sensor_layouts.traffic(1.0), 2))
    (folder / "day.json").write_text("\n".join(map(json.dumps, documents)))
    return folder / "day.json"


def _tgsim(folder: Path) -> Path:
    rows = sensor_layouts.tgsim_rows(next(sensor_layouts.traffic(1.0)))
    rows.rename(columns=lambda name: name.replace("-", "_")).to_csv(folder / "a.csv", index=False)
    return folder / "a.csv"


def _pneuma_of_spreadsheet(folder: Path) -> Path:
    path = pneuma(folder)
    path.write_text(f"sep=;\n{path.read_text()}")
    return path


def _exid(folder: Path) -> Path:
    sensor_layouts.write_exid(folder / "00_tracks.csv", 1)
    return folder / "00_tracks.csv"


def _openacc(folder: Path) -> Path:
    return openacc_files.write(folder, openacc_files.run_of(openacc_files.columns())) / "Vicolungo" / "part1.csv"


def _ngsim(folder: Path) -> Path:
    names = "Vehicle_ID,Frame_ID,Total_Frames,Global_Time,Local_X,Local_Y,v_Length,v_Width,v_Class,v_Vel,v_Acc,Lane_ID"
    (folder / "a.csv").write_text(f"\ufeff{names}\n")
    return folder / "a.csv"


WRITERS: list[tuple[str, Callable[[Path], Path]]] = [
    ("sumo", _sumo_xml),
    ("sumo", _sumo_packed),
    ("sumo", _sumo_csv),
    ("sumo", _sumo_parquet),
    ("vissim", _vissim),
    ("vissim", old_vissim),
    ("i24", i24),
    ("i24", _i24_lines),
    ("tgsim", _tgsim),
    ("pneuma", pneuma),
    ("pneuma", _pneuma_of_spreadsheet),
    ("exid", _exid),
    ("openacc", _openacc),
    ("ngsim", _ngsim),
    ("ngsim", ngsim_text),
]


def _recognised_by(path: Path) -> dict[str, Path]:
    """Every format that takes the file or folder for its own, with what data.root must name."""
    asked = {kind.name: reader_of(kind).recognises for kind in DataFormat}
    found = {name: recognises(path) for name, recognises in asked.items() if recognises is not None}
    return {name: root for name, root in found.items() if root is not None}


@pytest.mark.parametrize(("name", "write"), WRITERS, ids=[write.__name__.lstrip("_") for _, write in WRITERS])
def test_a_file_is_in_one_format_and_its_folder_too(name, write, tmp_path, capsys):
    file = write(tmp_path)
    assert _recognised_by(tmp_path) == {name: tmp_path}
    assert _recognised_by(file) == {name: tmp_path if name == "exid" else file}
    assert run(str(file))["format"] == name
    assert f"data={name} " in capsys.readouterr().out.splitlines()[-1]


def test_a_packed_file_of_i24_is_known_although_it_must_be_unpacked(tmp_path):
    packed = tmp_path / "day.json.gz"
    packed.write_bytes(gzip.compress(i24(tmp_path).read_bytes()))
    assert _recognised_by(packed) == {"i24": packed}
    with refused("not-json", file=str(packed)) as caught:
        next(iterate_recordings(DataConfig(DataFormat.i24, str(packed))))
    assert "unpack" in caught.value.problem.remedy


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.json", '{"timestamp": [1.0], "x_position": [1.0]}'),
        ("a.json", '["timestamp", "x_position", "y_position", "direction", "length"]'),
        ("a.xml", sumo_files.NET),
        ("a.csv", "timestep_time;vehicle_id;vehicle_speed\n"),
        ("a.csv", "id,time,speed_kf_x,lane_kf\n"),  # TGSIM at crossings
        ("a.csv", sensor_layouts.PNEUMA_HEADER.replace("lat; lon", "lon; lat")),
        ("a.csv", "Time,Speed1,Speed2,IVS1\n"),
        ("a.fzp", "* a comment without a table\n"),
        ("00_tracks.csv", "trackId,frame,xCenter,yCenter\n"),
        ("a.csv", ""),
        ("a.csv.gz", "not packed"),
    ],
)
def test_what_only_resembles_a_format_is_in_none(name, content, tmp_path):
    (tmp_path / name).write_text(content)
    assert _recognised_by(tmp_path / name) == {}
    assert _recognised_by(tmp_path) == {}
