"""`rearl validate` from end to end."""

import json
import re
import shutil

import jax
import matplotlib.image
import numpy as np
import pandas as pd
import pytest

from rearl_jax.config import ResultsConfig, ValidateTask
from rearl_jax.results import read_metadata
from rearl_jax.validation import simulation, task
from rearl_jax.validation.workers import Variant, vector_features

pytestmark = pytest.mark.slow

PLAIN = "validation.control_share=0"
PROGRESS = re.compile(r"[\d.]+ (s|min): [a-z]+(, \d+ of \d+)?")
"""A line of progress, which only a slow machine writes."""


def test_everything_is_written_and_nothing_half(done):
    assert done.code == 0
    files = ["agreement.parquet", "config.json", "error_over_time.png", "errors.parquet", "reference"]
    assert sorted(path.name for path in done.folder.iterdir()) == [*files, "scenes.parquet", "summary.json"]
    n_vectorised = 2 if vector_features() else 0
    variants = [name.split("_")[1] for name in done.reference_files()]
    assert (variants.count("plain"), variants.count("vectorised")) == (3, n_vectorised)
    assert f"results: {done.folder}" in done.printed
    assert all(PROGRESS.fullmatch(line) for line in done.said.splitlines()), done.said


def test_summary_says_that_the_core_agrees_and_that_something_happened(done):
    figures = done.summary
    assert figures["scenes"] == figures["n10_scenes"] == 3
    assert figures["lane_changes"] >= 15
    assert figures["aborts"] >= 1
    assert figures["crashes"] >= 2
    assert figures["agree_share_f64"] == figures["agree_share_f32"] == 1.0
    assert 0 <= figures["max_dx_f64"] < 1e-9 < figures["max_dx_f32"] < 2e-3
    assert figures["lane_change_agreement_f64"] == 1.0
    assert figures["unexplained"] == 0
    assert figures["control_scenes"] == (2 if vector_features() else 0)
    assert figures["reference"].startswith("highway-env 1.")


def test_scenes_have_a_row_each_in_every_precision(done):
    scenes = done.table("scenes")
    assert list(scenes["set"].unique()) == ["stress10"]
    for precision in ("float64", "float32"):
        part = scenes[scenes["precision"] == precision]
        assert list(part["index"]) == [0, 1, 2]
        assert part["agrees"].all()
        assert part["own_difference"].isna().all()
    double = scenes[scenes["precision"] == "float64"]
    assert double["lane_changes"].sum() == done.summary["lane_changes"]
    assert double["cause"].isna().all()
    assert double["first_contact"].notna().sum() >= 1
    # Empty columns are of the same type as full ones, so that tables of several studies fit together.
    assert pd.api.types.is_string_dtype(scenes["cause"])
    assert pd.api.types.is_float_dtype(scenes["first_time"])
    assert scenes["first_vehicle"].dtype == "Int64"


def test_errors_hold_every_tick_and_agree_with_the_scenes(done):
    errors, scenes = done.table("errors"), done.table("scenes")
    whole = errors[(errors["precision"] == "float32") & (errors["scope"] == "all")]
    assert list(whole["tick"]) == list(range(181))
    assert (whole["scenes"] == 3).all()
    largest = scenes[scenes["precision"] == "float32"]["max_position"].max()
    assert whole["largest"].max() == largest > 0
    assert (whole["median"] <= whole["q90"]).all()
    assert (whole["q99"] <= whole["largest"]).all()
    before = errors[(errors["precision"] == "float32") & (errors["scope"] == "before_contact")]
    assert (before["scenes"].iloc[0], before["scenes"].iloc[-1]) == (3, 2)


def test_metadata_say_what_was_compared(done):
    for name in ("scenes", "agreement", "errors"):
        stored = read_metadata(done.folder / f"{name}.parquet")
        assert (stored["task"], stored["seed"]) == ("validate", "0")
        assert stored["reference"] == done.summary["reference"]
    assert json.loads((done.folder / "config.json").read_text())["validation"]["scenes"]["stress10"] == 3


def test_figure_is_a_picture(done):
    picture = matplotlib.image.imread(done.folder / "error_over_time.png")
    assert min(picture.shape[:2]) >= 300
    assert picture[..., :3].std() > 0.05


def test_terminal_shows_tables_with_units(done):
    for precision in ("float64", "float32"):
        assert f"{precision} against {done.summary['reference']}" in done.printed
    assert len(re.findall(r"^ stress10 +3 ", done.printed, re.MULTILINE)) == 2
    assert all(unit in done.printed for unit in ("[m]", "[m/s]", "[rad]"))
    assert "…" not in done.printed
    assert "Scenes that differ" not in done.printed


def test_a_core_that_differs_fails_and_is_described(validate, replayed, recorded, planted, tmp_path, monkeypatch):
    """One micrometre, in scene 1, vehicle 4, from tick 30 on; and too little has happened."""
    simulate = simulation.simulate

    def wrong(scenes, model, dtype):
        tracks = simulate(scenes, model, dtype)
        return planted(tracks, "x", (slice(30, None), 4, 1), dtype(1e-6))

    monkeypatch.setattr(simulation, "simulate", wrong)
    nudged = Variant.nudged
    for job in list(recorded):
        scene = recorded[job]
        ahead = planted(scene.tracks, "x", slice(None), 1e-7)
        monkeypatch.setitem(recorded, type(job)(job.scenario, nudged), type(scene)(scene.start, scene.actions, ahead))
    done = validate(tmp_path, PLAIN, "validation.least_lane_changes=1000", stress10=3)
    assert done.code == 2
    assert "results:" not in done.printed
    for sentence in ("lane changes occurred", "66.67% of the scenes agree in float64", "without an explanation"):
        assert sentence in done.said
    assert done.summary["unexplained"] == 1
    assert done.summary["agree_share_f32"] == 1.0
    scenes = done.table("scenes").set_index(["precision", "index"])
    assert list(scenes.loc["float64", "agrees"]) == [True, False, True]
    row = scenes.loc[("float64", 1)]
    assert (row["first_time"], row["first_vehicle"], row["cause"]) == (2.0, 4, "unexplained")
    assert row["first_difference"] == pytest.approx(1e-6, rel=1e-3)
    # What highway-env makes of the least difference is asked for that scene and no other.
    assert [job.scenario.index for job in replayed.asked if job.variant is nudged] == [1]
    assert row["own_difference"] == pytest.approx(1e-7, rel=1e-3)
    assert np.isnan(scenes.loc[("float64", 0), "own_difference"])
    assert "speed [m/s]" in done.printed
    assert re.search(r"^ stress10 1 +unexplained +2\.00 ", done.printed, re.MULTILINE)


def test_an_interrupted_study_goes_on(validate, replayed, done, tmp_path):
    replayed.broken_after = 2
    stopped = validate(tmp_path, PLAIN, stress10=3)
    assert stopped.code == 130
    assert "interrupted" in stopped.said
    assert len(stopped.reference_files()) == 2
    assert not (stopped.folder / "summary.json").exists()
    on_file = [job.scenario.index for job in replayed.asked[:2]]

    replayed.asked.clear()
    replayed.broken_after = None
    resumed = validate(tmp_path, PLAIN, stress10=3)
    assert resumed.code == 0
    assert [job.scenario.index for job in replayed.asked] == [index for index in range(3) if index not in on_file]
    whole = done.table("scenes")
    whole = whole[whole["precision"] != "control"].reset_index(drop=True)
    assert len(whole) == 6
    pd.testing.assert_frame_equal(resumed.table("scenes"), whole)


def test_a_damaged_record_stops_the_study_with_its_name(validate, replayed, done, tmp_path):
    shutil.copytree(done.folder / "reference", tmp_path / "validate" / "reference")
    (path,) = (tmp_path / "validate" / "reference" / "stress10").glob("0001_plain*")
    path.write_bytes(path.read_bytes()[:-500])
    stopped = validate(tmp_path, PLAIN, stress10=3)
    assert stopped.code == 2
    assert path.name in stopped.said
    assert replayed.asked == []


def test_single_precision_alone_is_refused(tmp_path):
    with jax.enable_x64(False), pytest.raises(ValueError, match="double precision"):
        task.run(ValidateTask(results=ResultsConfig(root=str(tmp_path))))
    assert list(tmp_path.iterdir()) == []
