"""The task `prepare`: tables, counts, scenes and summary of a data set."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from rearl_jax.config import PrepareTask, ResultsConfig
from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.config.generator import GeneratorConfig
from rearl_jax.config.scenes import ScenesConfig
from rearl_jax.data.prepare import counts_of, run
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.results import read_metadata
from tests.refusal import refused


def task(folder: Path, kind: DataFormat, name: str, n_vehicles: int = 4) -> PrepareTask:
    """Recordings of a name in the folder are prepared into the study p there, with scenes of 3 s."""
    scenes = ScenesConfig(seconds=3, min_vehicles=n_vehicles, slots=n_vehicles)
    data = DataConfig(kind, str(folder / name))
    return PrepareTask(study="p", results=ResultsConfig(str(folder)), data=data, scenes=scenes)


def test_highd_files_become_tables_counts_and_scenes(highd_files, tmp_path):
    for number in ("01", "02"):
        highd_files(tmp_path / "in", number, seed=int(number))
    config = task(tmp_path, DataFormat.highd, "in")
    summary = run(config)
    assert summary["n_scenes"] >= 2
    stored = json.loads((tmp_path / "p" / "summary.json").read_text())
    assert {key: stored[key] for key in summary} == summary
    assert (stored["recordings"], stored["vehicles"], stored["trucks"]) == (2, 24, 6)
    assert stored["lane_changes"] == 8
    assert (stored["generated"], stored["dropped"]) == (False, {})
    assert stored["hours"] * 3600.0 == pytest.approx(2 * (55 + 150) / 25.0)
    counts = pd.read_parquet(tmp_path / "p" / "recordings.parquet")
    assert counts["recording"].tolist() == ["highd_01", "highd_02"]
    assert counts["in_view"].tolist() == pytest.approx([1800 / 205] * 2)
    tables = DataConfig(DataFormat.table, str(tmp_path / "p" / "tables"))
    for again, first in zip(iterate_recordings(tables), iterate_recordings(config.data), strict=True):
        pd.testing.assert_frame_equal(again.table, first.table)
        assert again.info.to_json() == first.info.to_json()
    assert read_metadata(tmp_path / "p" / "scenes.parquet")["data_id"] == stored["data_id"]


def test_what_is_dropped_is_in_the_summary(highd_files, tmp_path):
    tracks = highd_files(tmp_path / "in")
    table = pd.read_csv(tracks)
    table.loc[5, "xVelocity"] = np.nan
    table.to_csv(tracks, index=False)
    config = task(tmp_path, DataFormat.highd, "in")
    with refused("not-finite", column="xVelocity", row=6):
        run(config)
    assert not (tmp_path / "p" / "summary.json").exists()
    config.data.on_bad = BadRows.drop_track
    assert run(config)["dropped"] == {"not_finite": 150, "tracks": 1}


def test_recordings_are_generated_first_where_asked_for(tmp_path):
    config = PrepareTask(
        results=ResultsConfig(str(tmp_path / "results")),
        data=DataConfig(DataFormat.generated, str(tmp_path / "made")),
        generator=GeneratorConfig(n_recordings=1, duration_scale=0.1, workers=1),
        scenes=ScenesConfig(min_vehicles=4, slots=4),
    )
    summary = run(config)
    assert (tmp_path / "made" / "01_tracks.csv").is_file()
    assert summary["recordings"] == 1
    assert summary["n_scenes"] >= 1
    assert summary["dropped"] == {}
    folder = tmp_path / "results" / "prepare"
    assert json.loads((folder / "summary.json").read_text())["generated"] is True
    assert read_metadata(folder / "scenes.parquet")["generated"] == "true"
    # The generated files are the store; they are not written a second time.
    assert not (folder / "tables").exists()
    rows = pq.read_table(folder / "recordings.parquet").to_pylist()
    assert [row["recording"] for row in rows] == ["generated_01"]
    for part in ("tracks", "tracksMeta", "recordingMeta"):
        source = tmp_path / "made" / f"01_{part}.csv"
        (tmp_path / "made" / f"02_{part}.csv").write_bytes(source.read_bytes())
    with refused("recordings-beside", key="data.root"):
        run(config)


def test_unknown_lanes_are_no_lane_changes(highd_files, tmp_path):
    highd_files(tmp_path)
    (recording,) = iterate_recordings(DataConfig(DataFormat.highd, str(tmp_path)))
    assert counts_of(recording)["lane_changes"] == 4
    recording.table.loc[::2, "lane"] = pd.NA
    assert counts_of(recording)["lane_changes"] == 0


def test_recordings_whose_names_differ_by_case_only_have_tables_of_their_own_on_every_system(timed_rows, tmp_path):
    ahead = {name: timed_rows[name] + 5.0 for name in ("x", "position")}
    both = [timed_rows.assign(recording="Cam"), timed_rows.assign(recording="cam", **ahead)]
    pd.concat(both).to_csv(tmp_path / "a.csv", index=False)
    run(task(tmp_path, DataFormat.table, "a.csv", n_vehicles=2))
    tables = sorted((tmp_path / "p" / "tables").iterdir())
    assert len({file.name.lower() for file in tables}) == 2
    assert {next(iterate_recordings(DataConfig(DataFormat.table, str(file)))).info.id for file in tables} == {
        "Cam",
        "cam",
    }


def test_tables_of_a_copied_study_and_other_files_beside_the_new_ones_are_refused(timed_rows, tmp_path):
    for name in ("a", "b"):
        timed_rows.assign(recording=name).to_csv(tmp_path / f"{name}.csv", index=False)
    run(task(tmp_path, DataFormat.table, "a.csv", n_vehicles=2))
    tables = tmp_path / "p" / "tables"
    (tmp_path / ".p.files").unlink()  # as for a copied or renamed folder
    with refused("recordings-beside", file=str(tables)) as caught:
        run(task(tmp_path, DataFormat.table, "b.csv", n_vehicles=2))
    assert "a.parquet" in caught.value.problem.fault
    assert [file.name for file in tables.iterdir()] == ["a.parquet"]
    run(task(tmp_path, DataFormat.table, "a.csv", n_vehicles=2))  # the same study writes it again
    (tables / "a.csv").write_text("")
    with refused("recordings-beside"):
        run(task(tmp_path, DataFormat.table, "a.csv", n_vehicles=2))
    (tables / "a.csv").unlink()
    run(task(tmp_path, DataFormat.table, "b.csv", n_vehicles=2))
    assert [file.name for file in tables.iterdir()] == ["b.parquet"]
