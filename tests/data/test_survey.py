"""`rearl prepare FILE` on tables of unknown layout: what columns are taken for, and a command that reads the truth."""

import dataclasses
import json
import shlex
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from rearl_jax import tasks
from rearl_jax.cli.command_line import main
from rearl_jax.cli.composition import compose_task
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.data.survey.report import command_of
from rearl_jax.data.survey.task import recognised, run
from rearl_jax.problems import MissingInputError
from tests.data.survey_tables import TABLES, truth
from tests.refusal import refused

PREPARE = next(task for task in tasks.TASKS if task.words == "prepare")
FOUND = {
    "detector_feet.csv": {
        "veh_id": ("track_id", None),
        "epoch_ms": ("time", "ms"),
        "local_y": ("position", "ft"),
        "local_x": ("lateral", "ft"),
        "v_vel": ("speed", "ft/s"),
        "v_acc": ("acceleration", "ft/s^2"),
        "v_length": ("length", "ft"),
        "v_width": ("width", "ft"),
        "lane_id": ("lane", "from 1"),
        "preceding": ("leader_id", None),
    },
    "drone_kmh.csv": {
        "Fahrzeug": ("track_id", None),
        "Zeitstempel": ("time", None),
        "Position [m]": ("position", None),
        "Geschwindigkeit [km/h]": ("speed", "km/h"),
        "Länge [m]": ("length", None),
        "Fahrstreifen": ("lane", None),
        "Fahrzeugtyp": ("vehicle_class", None),
    },
    "frames_only.tsv": {
        "frameNum": ("frame", "30/s"),
        "carId": ("track_id", None),
        "xCenter": ("position", None),
        "yCenter": ("lateral", None),
        "xVelocity": ("speed", None),
        "xAcceleration": ("acceleration", None),
        "laneId": ("lane", "from 1"),
    },
    "simulation_blanks.txt": {
        "time": ("time", None),
        "vehicle": ("track_id", None),
        "lane": ("lane", None),
        "pos": ("position", None),
        "speed": ("speed", None),
    },
    "corridor_uuid.csv.gz": {
        "timestamp": ("time", None),
        "object_id": ("track_id", None),
        "x_position": ("position", "-ft"),
        "y_position": ("lateral", "ft"),
        "velocity": ("speed", "ft/s"),
        "length": ("length", "ft"),
        "width": ("width", "ft"),
        "class": ("vehicle_class", None),
    },
    "probe_mph.txt": {
        "Vehicle No.": ("track_id", None),
        "Time": ("time", "s"),
        "Distance (ft)": ("position", "ft"),
        "Speed (mph)": ("speed", "mph"),
    },
    "camera_json_style.dat": {
        "objectId": ("track_id", None),
        "frameIndex": ("frame", None),
        "t": ("time", "ms"),
        "posX": ("position", None),
        "speed": ("speed", "km/h"),
        "objectClass": ("vehicle_class", None),
    },
    "nameless.csv": {
        "c1": ("time", None),
        "c2": ("track_id", None),
        "c3": ("speed", None),
        "c4": ("position", None),
    },
    "parquet_runs.parquet": {
        "run": ("recording", None),
        "vehicle_id": ("track_id", None),
        "time": ("time", None),
        "s": ("position", None),
        "v": ("speed", None),
        "lane": ("lane", None),
    },
    "already_canonical.csv": {
        name: (name, None)
        for name in "track_id frame time position lateral lane speed acceleration length width vehicle_class "
        "leader_id".split()
    },
}
"""Each column of the ten tables with its unit; columns that are not named are nothing canonical."""

LAYOUTS = {
    "drone_kmh.csv": ("Windows-1252 (not certain)", "semicolon", "decimal comma"),
    "simulation_blanks.txt": ("UTF-8", "blanks", "line 3"),
    "corridor_uuid.csv.gz": ("compressed (gz)", "comma"),
    "probe_mph.txt": ("UTF-16", "tab"),
    "camera_json_style.dat": ("bar",),
    "parquet_runs.parquet": ("Parquet",),
}
RATES = {"detector_feet.csv": 10, "drone_kmh.csv": 25, "frames_only.tsv": 30, "corridor_uuid.csv.gz": 25}
RATES |= {"nameless.csv": 20, "parquet_runs.parquet": 10, "already_canonical.csv": 10}


def _true(name: str) -> pd.DataFrame:
    special = {"simulation_blanks.txt": (2, 40.0), "probe_mph.txt": (1, 60.0), "camera_json_style.dat": (5, 16.0)}
    rate, seconds = special.get(name, (RATES.get(name, 0), 8.0))
    return truth(rate, seconds=seconds)


def _read(command: str) -> list:
    """The recordings that the words of a command read."""
    words = shlex.split(command)
    assert words[:2] == ["rearl", "prepare"]
    return list(iterate_recordings(compose_task(PREPARE, words[2:], None).data))


@pytest.mark.parametrize("name", TABLES)
def test_an_unknown_table_is_understood_and_its_command_reads_the_truth(name, tmp_path, capsys):
    path = tmp_path / name
    TABLES[name](path)
    found = run(str(path))
    assert {source: (one["canonical"], one["unit"]) for source, one in found["columns"].items()} == FOUND[name]
    printed = capsys.readouterr().out
    assert printed.splitlines()[-1] == found["command"]
    for part in LAYOUTS.get(name, ()):
        assert part in found["form"]
    true = _true(name)
    recordings = _read(found["command"])
    assert [r.info.id for r in recordings] == (
        [*"morning noon".split()] if "runs" in name else [path.name.split(".")[0]]
    )
    read = recordings[0].table
    assert read["track_id"].tolist() == [track + {"frames_only.tsv": 70}.get(name, 0) for track in true["track_id"]]
    np.testing.assert_allclose(read["speed"], true["speed"], atol=0.02)
    shift = read["position"].iloc[0] - true["position"].iloc[0]
    np.testing.assert_allclose(read["position"] - shift, true["position"], atol=0.05)
    assert abs(shift) < 0.05 or name == "corridor_uuid.csv.gz"
    np.testing.assert_allclose(read["time"].diff(), true["time"].diff(), atol=1e-3)
    for canonical, tolerance in (("lateral", 0.01), ("acceleration", 0.01), ("length", 0.03), ("lane", 0.0)):
        if any(taken[0] == canonical for taken in FOUND[name].values()):
            np.testing.assert_allclose(read[canonical].to_numpy(np.float64), true[canonical], atol=tolerance)
    assert found["recordings"][0]["rows"] == len(true)


def test_the_command_line_takes_a_file_and_the_printed_command_prepares_it(tmp_path, monkeypatch):
    def rearl(*words):
        done = subprocess.run([sys.executable, "-m", "rearl_jax", *words], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    monkeypatch.chdir(tmp_path)
    TABLES["drone_kmh.csv"](tmp_path / "mein Tag, früh.csv")
    found = json.loads(rearl("prepare", "mein Tag, früh.csv", "--json").splitlines()[-1])
    words = shlex.split(found["command"])[1:]
    rearl(*words, "scenes.seconds=6", "scenes.min_vehicles=5", "scenes.slots=5", "study=mine")
    (row,) = pd.read_parquet("results/mine/recordings.parquet").to_dict("records")
    assert (row["vehicles"], row["frame_rate"], row["rows"]) == (5, 25.0, 1000)
    stored = pd.read_parquet("results/mine/tables/" + next((tmp_path / "results/mine/tables").iterdir()).name)
    assert stored["track_name"].iloc[0] == "Fzg 001"


@pytest.mark.parametrize(
    "name",
    ["a b.csv", 'quo"te.csv', "it's.csv", "${x}.csv", "a,b=c;{d}.csv", "back\\slash\\", "\\\\\"'", "null", "1e5"],
)
def test_every_name_is_quoted_so_that_it_is_read_again(name):
    given = DataConfig(DataFormat.table, f"/data/{name}", columns={"speed": name, "x": None}, units={"speed": "km/h"})
    words = shlex.split(command_of(given))
    assert dataclasses.replace(compose_task(PREPARE, words[2:], None).data, recordings="*") == given


def test_known_formats_are_recognised(highd_files, tmp_path, capsys):
    tracks = highd_files(tmp_path / "highd")
    for place in (tracks.parent, tracks, tracks.with_name("01_recordingMeta.csv")):
        assert recognised(place) == ("highd", tracks.parent)
        found = run(str(place))
        assert len(_read(found["command"])) == 1
    assert "highD" in capsys.readouterr().out
    tracks.with_name("01_tracksMeta.csv").unlink()
    assert recognised(tracks) is None
    for kind in ("us101", "i80", "i80_lateral", "openacc", "fhwa"):
        folder = DataFormat[kind].shipped
        assert folder is not None
        name, root = recognised(folder) or ("", folder)
        assert name == kind
        assert recognised(next(folder.glob("*.parquet"))) == (name, root)


def test_what_does_not_fit_is_left_out_and_said(tmp_path):
    rows = truth().assign(
        lateral=lambda t: 10.0 - t["lateral"], vehicle_class="A7", leader_id=lambda t: t["track_id"] + 50
    )
    rows.to_csv(tmp_path / "a.csv", index=False)
    found = run(str(tmp_path / "a.csv"))
    assert set(found["refused"]) == {"lane", "lateral", "vehicle_class", "leader_id"}
    assert not any("may be meant" in note for note in found["notes"])
    assert any("data.units={lane: -from 1}" in doubt for doubt in found["doubts"])
    (recording,) = _read(found["command"])
    assert recording.table["lane"].isna().all()
    command = found["command"].replace("lateral: null, lane: null, ", "") + " 'data.units={lane: -from 1}'"
    (mirrored,) = _read(command)
    assert set(mirrored.table["lane"]) == {0, 1}


def test_rows_that_are_bad_are_dropped_and_counted(tmp_path):
    rows = truth()
    rows.loc[50, "speed"] = 500.0
    rows.to_csv(tmp_path / "a.csv", index=False)
    found = run(str(tmp_path / "a.csv"))
    assert found["dropped"]["out_of_range"] == 1
    assert found["command"].endswith("data.on_bad=drop_row")
    assert any("speed is 500 m/s" in note for note in found["notes"])
    assert len(_read(found["command"])) == 1


def test_what_is_missing_is_said(tmp_path, capsys):
    rows = truth()
    rows.drop(columns="speed").to_csv(tmp_path / "a.csv", index=False)
    with refused("column-missing", column="speed"):
        run(str(tmp_path / "a.csv"))
    assert "missing: speed" in capsys.readouterr().out
    rows.drop(columns=["track_id", "leader_id"]).to_csv(tmp_path / "a.csv", index=False)
    with refused("column-missing", column="track_id"):
        run(str(tmp_path / "a.csv"))
    assert "missing: track_id and time:" in capsys.readouterr().out
    both = pd.concat([rows, rows.assign(track_id=rows["track_id"] + 9, position=500.0 - rows["position"])])
    both.to_csv(tmp_path / "a.csv", index=False)
    with refused("column-missing", column="position"):
        run(str(tmp_path / "a.csv"))
    with refused("file-missing", MissingInputError):
        run(str(tmp_path / "nowhere.csv"))
    (tmp_path / "a.csv").write_text("a,b\n")
    with refused("no-rows"):
        run(str(tmp_path / "a.csv"))


def test_a_file_and_keys_are_two_commands(tmp_path, capsys):
    assert main(["prepare", str(tmp_path / "a.csv"), "study=x"]) == 2
    assert main(["prepare", str(tmp_path / "a.csv")]) == 2
    assert main(["evaluate", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 3
