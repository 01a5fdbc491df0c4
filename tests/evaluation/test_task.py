"""`rearl evaluate` from end to end: what it writes, what it prints, and that nothing is missing or made up."""

import json
import re
from dataclasses import replace

import jax
import matplotlib.image
import numpy as np
import pandas as pd
import pytest

from rearl_jax import console
from rearl_jax.data.scenes.scene_set import recorded_lane_change_rate
from rearl_jax.document.terminal import print_document, text_of
from rearl_jax.evaluation.document import document_of
from rearl_jax.evaluation.figures import errors_over_time, speed_histogram
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.evaluation.runner import example_scene
from rearl_jax.evaluation.scores import REAL_VS_REAL
from rearl_jax.evaluation.task import documented
from rearl_jax.metrics import METRICS
from rearl_jax.report.documents import evaluation_document
from rearl_jax.report.finished import read_finished
from rearl_jax.results import read_metadata
from tests.refusal import refused

ROWS = ["base", "real_vs_real", "noise_floor", "real"]
FILES = ["config.json", "errors_over_time.png", "frames.parquet", "page.html", "positions.parquet", "runs.parquet"]
FILES += ["space_time.png", "speed_histogram.png", "summary.json", "summary.parquet"]


def test_folder_holds_every_file_and_nothing_half_written(done):
    assert sorted(path.name for path in done.folder.iterdir()) == FILES


def test_summary_is_one_flat_object_per_row_with_the_documented_keys(done):
    stored = json.loads((done.folder / "summary.json").read_text())
    assert [row["method"] for row in stored] == ROWS
    documented = "method h mape_a mape_b mape_c thw lcr collisions realism n_scenes n_rollouts seconds".split()
    figures = {f"{name}{part}" for name in METRICS for part in ("", "_sd", "_low", "_high")}
    for row in stored:
        assert set(documented) | figures <= set(row)
        assert {"task", "study", "config_hash", "code_version", "data_id", "generated"} <= set(row)
        assert all(isinstance(value, (str, int, float, bool, type(None))) for value in row.values())
    base, others, floor, real = stored
    assert all(base[name] is not None for name in documented)
    assert (base["n_scenes"], base["n_rollouts"]) == (5, 5)
    assert base["seconds"] > 0
    assert base["h_sd"] is base["energy_score"] is None  # one run has no spread
    assert base["frechet"] > base["displacement"] > 50.0 < others["displacement"]  # no vehicle is the recorded one
    assert 0 < base["thw_likelihood"] < base["ttc_likelihood"] <= 1
    assert base["h_low"] < base["h"] < base["h_high"]
    # Chance alone, then other traffic, then the model: each is further away than the one before.
    assert 0 < floor["h"] < others["h"] < base["h"] < 1
    assert 10.0 < base["position_error"] < 300.0
    assert floor["thw"] is None
    assert real["h"] is None
    assert real["thw"] > 0
    assert real["lcr"] > 0


def test_base_starts_as_recorded(done):
    base, scenes, held_out = done.summary[0], done.evaluation.scenes, done.evaluation.held_out
    runs = done.table("runs").query("method == 'base'")
    frames = done.table("frames").query("method == 'base'")
    assert len(runs) == 5
    first = frames[frames["frame"] == 0].sort_values("scene_id")["spacing"].to_numpy(np.float64)
    np.testing.assert_allclose(first, scenes.mean_spacing[held_out, 0], rtol=0.05)
    assert base["mape_a"] == pytest.approx(float(runs["mape_a"].mean()), rel=1e-6)
    assert base["h"] == pytest.approx(float(frames.groupby("scene_id")["h"].mean().mean()), rel=1e-5)


def test_tables_have_a_row_for_everything_and_no_nan(done):
    runs, frames = done.table("runs"), done.table("frames")
    assert runs.groupby("method", observed=True).size().to_dict() == dict.fromkeys(ROWS, 5)
    assert frames.groupby("method", observed=True).size().to_dict() == {
        name: 5 * 60 for name in ROWS if name != "noise_floor"
    }
    for table in (runs, frames, done.table("summary")):
        for name in table.select_dtypes("number").columns:
            values = table[name].dropna().to_numpy(np.float64)
            assert np.isfinite(values).all(), name
    base = frames.query("method == 'base'")
    assert base["h"].isna().groupby(base["frame"]).all().sum() == 4  # a window of five has 56 ends
    assert base["h"].notna().sum() == 5 * 56
    assert base[["mape_a", "mape_b", "mape_c", "spacing"]].notna().all().all()
    real = frames.query("method == 'real'")
    assert real["h"].isna().all()
    assert real["spacing"].notna().all()


def test_partners_are_other_scenes(done):
    runs = done.table("runs")
    others = runs.query("method == 'real_vs_real'")
    assert (others["partner"] != others["scene_id"]).all()
    real = runs.query("method == 'real'")
    assert (real["partner"] == real["scene_id"]).all()
    assert runs.query("method == 'base'")["partner"].isna().all()


def test_real_rows_are_the_scenes_own(done):
    scenes, held_out = done.evaluation.scenes, done.evaluation.held_out
    runs = done.table("runs").set_index(["method", "scene_id"])
    np.testing.assert_allclose(
        runs.loc["real", "lcr"].to_numpy(np.float64), recorded_lane_change_rate(scenes)[held_out], rtol=1e-6
    )
    np.testing.assert_allclose(
        runs.loc["real", "spacing"].to_numpy(np.float64),
        scenes.mean_spacing[held_out].mean(axis=1),
        rtol=1e-5,
    )


def test_metadata_says_where_the_tables_come_from(done):
    for name in ("runs", "frames", "summary"):
        stored = read_metadata(done.folder / f"{name}.parquet")
        assert stored["task"] == "evaluate"
        assert stored["generated"] == "false"
        assert stored["seeds"] == "eval.seed=0, split.seed=0"
        assert stored["scenes_id"] == done.evaluation.scenes.data_id
        assert stored["mape_definition"] == "A"
        assert json.loads(stored["definitions"])["lcr"].startswith("lane changes")


def test_printed_table_holds_the_reference_rows_and_never_praises_more_headway(done):
    for title in ("base", "real against real", "noise floor", "real"):
        assert re.search(rf"^ {title} ", done.printed, re.MULTILINE)
    assert "more is not better" in " ".join(done.printed.split())
    assert "GENERATED" not in done.printed
    assert "…" not in done.printed  # nothing cut off
    base = done.summary[0]
    assert f"{base['h']:.3f}" in done.printed
    assert done.printed.startswith(
        f"The speeds of base are a Hellinger distance of {base['h']:.3f} ({base['h_low']:.3f} "
    )


def test_the_document_is_the_same_from_memory_and_from_the_folder(done):
    stored = read_finished(str(done.folder.parent), done.folder.name)
    assert evaluation_document(stored) == documented(done.evaluation, done.estimates)


def test_figures_are_pictures_of_some_size(done):
    for path in done.folder.glob("*.png"):
        picture = matplotlib.image.imread(path)
        assert min(picture.shape[:2]) >= 500
        assert picture[..., :3].std() > 0.05  # not empty


def test_generated_data_are_marked_everywhere(done):
    scenes = done.evaluation.scenes
    infos = tuple(replace(info, generated=True) for info in scenes.infos)
    evaluation = replace(done.evaluation, scenes=replace(scenes, infos=infos))
    assert text_of(documented(evaluation, done.estimates)).count("GENERATED") == 2
    assert speed_histogram(done.config, evaluation) != speed_histogram(done.config, done.evaluation)


def document_with(done, **columns):
    """The document of a summary with other columns."""
    summary = done.table("summary").assign(**columns)
    return document_of(done.config, summary, Remarks(), decisions=None, generated=False)


def test_narrow_terminal_loses_intervals_and_nothing_else(done, monkeypatch, capsys):
    class Narrow(console.Console):
        def __init__(self, **options):
            super().__init__(force_terminal=True, color_system=None, **({"width": 84} | options))

    monkeypatch.setattr(console, "Console", Narrow)
    print_document(document_with(done, sd=0.012))
    printed = capsys.readouterr().out
    assert "…" not in printed
    assert "intervals: page.html" in printed
    assert f"{done.summary[0]['realism']:.3f}" in printed
    assert "±0.012" in printed


def test_a_change_to_base_is_part_of_verdict_notes_and_table_of_all_metrics(done):
    changed = document_with(done, less_base=-0.1, less_base_low=-0.2, less_base_high=0.05)
    assert ", a change of -0.100 (-0.200 to +0.050) to base;" in changed.verdict
    assert "base less base, from the same initial states: H -0.100 (-0.200 to +0.050)" in changed.sections[0].notes[1]
    (table,) = changed.sections[1].tables
    column = table.headings.index("base less base")
    assert table.rows[0].cells[column].interval == "-0.200 to +0.050"


def test_summary_table_compares_row_by_row(done):
    table = done.table("summary").set_index(["method", "metric"])
    h = table.loc[("base", "h")]
    assert h["compared_with"] == "real_vs_real"
    assert h["difference"] == pytest.approx(h["value"] - table.loc[("real_vs_real", "h"), "value"])
    assert h["difference_low"] < h["difference"] < h["difference_high"]
    assert table.loc[("base", "thw"), "compared_with"] == "real"
    assert pd.isna(table.loc[("real", "thw"), "compared_with"])


def test_unknown_example_stops(done):
    scenes, held_out = done.evaluation.scenes, done.evaluation.held_out
    ids = scenes.scene_id[held_out]
    assert example_scene(scenes, held_out, int(ids[2])) == held_out[2]
    speed = scenes.speed[held_out].mean(axis=(1, 2))
    assert speed[np.searchsorted(held_out, example_scene(scenes, held_out, None))] == np.median(speed)
    other = next(i for i in scenes.scene_id if i not in ids)
    with refused("scene-not-held-out", key="eval.example") as caught:
        example_scene(scenes, held_out, int(other))
    assert caught.value.problem.value == other


def test_a_scene_without_another_one_is_drawn_and_told(done):
    evaluation = done.evaluation
    others = evaluation.row(REAL_VS_REAL)
    arrays = {name: getattr(others, name)[:0] for name in ("scene", "run", "partner")}
    nothing = replace(
        others,
        **arrays,
        values={name: values[:0] for name, values in others.values.items()},
        counts={name: counts[:0] for name, counts in others.counts.items()},
        series=jax.tree.map(lambda leaf: leaf[..., :0], others.series),
        realism=None,
        pooled={},
    )
    alone = replace(evaluation, rows=[nothing if row is others else row for row in evaluation.rows])
    assert errors_over_time(done.config, alone).startswith(b"\x89PNG")
    found = {key: estimate for key, estimate in done.estimates.items() if key[0] != REAL_VS_REAL}
    assert "from each other" in documented(evaluation, done.estimates).verdict
    assert "from each other" not in documented(alone, found).verdict
