"""`rearl study table1` with two rows: its files, its numbers compared with the evaluations of the rows, and a study
that was interrupted.
"""

import json
import re
import shutil

import numpy as np
import pandas as pd
import pytest

from rearl_jax.document.terminal import text_of
from rearl_jax.report.documents import paper_document
from rearl_jax.report.finished import read_finished
from rearl_jax.results import read_metadata

pytestmark = pytest.mark.thorough


STUDY = "study_table1"
"""Folder of the study below that of all results."""


@pytest.fixture
def results(table1):
    """Folder of all results."""
    return table1[0]


@pytest.fixture
def printed(table1):
    """Output of the command."""
    return table1[1]


@pytest.fixture
def folder(results):
    """Folder of the study."""
    return results / STUDY


def test_the_study_writes_all_its_files(folder):
    names = {path.name for path in folder.iterdir()}
    assert names == {"config.json", "page.html", "rows", "summary.json", "table1.parquet", "table1.png"}
    assert {path.name for path in (folder / "rows").iterdir() if path.is_dir()} == {"base", "idle"}
    assert (folder / "rows" / "idle" / "page.html").exists()
    assert read_metadata(folder / "table1.parquet")["generated"] == "false"


def test_the_table_has_the_values_of_the_rows_evaluations_and_of_the_paper(folder):
    table = pd.read_parquet(folder / "table1.parquet").set_index(["row", "metric"])
    for name, method in (("base", "base"), ("idle", "rearl")):
        evaluation = pd.read_parquet(folder / "rows" / name / "summary.parquet").set_index(["method", "metric"])
        for metric in ("h", "mape_a", "thw", "lcr"):
            assert table.loc[(name, metric), "ours"] == evaluation.loc[(method, metric), "value"]
            assert table.loc[(name, metric), "low"] == evaluation.loc[(method, metric), "low"]
    assert table.loc[("base", "h_legacy"), "paper"] == 0.346
    assert pd.isna(table.loc[("base", "h"), "paper"])
    assert pd.isna(table.loc[("idle", "mape_a"), "paper"])
    assert table.loc[("paper_ppo", "lcr"), "paper"] == 0.0138  # a row of the paper only
    assert pd.isna(table.loc[("paper_ppo", "lcr"), "ours"])
    assert pd.isna(table.loc[("base", "h"), "less_base"])
    assert table.loc[("idle", "h"), "less_base"] == pytest.approx(
        table.loc[("idle", "h"), "ours"] - table.loc[("base", "h"), "ours"]
    )
    numbers = table.select_dtypes("number").to_numpy(np.float64, na_value=0)
    assert np.isfinite(numbers).all()


def test_summary_json_is_flat_and_has_the_values_of_the_table(folder):
    summary = json.loads((folder / "summary.json").read_text())
    table = pd.read_parquet(folder / "table1.parquet").set_index(["row", "metric"])
    assert all(isinstance(value, (str, int, float, bool, type(None))) for value in summary.values())
    assert summary["n_rows"] == 2
    assert summary["idle_h"] == table.loc[("idle", "h"), "ours"]
    assert summary["base_h_legacy_paper"] == 0.346
    assert summary["real_thw"] > 0
    assert summary["base_h_less_base"] is None


def test_output_and_page_state_what_can_be_compared_with_the_paper(results, folder, printed):
    words = " ".join(printed.split())
    assert "Only the signs of differences and the order of methods can be compared with the paper" in words
    assert "traffic model, Hellinger distance, MAPE, decisions" in words
    assert "paper: Base" in words
    assert "closer than base" in words
    assert "real against real" in words
    assert "…" not in printed
    assert "held-out scenes (of" not in words  # the heading of a row's table, which is on the page of the row
    page = (folder / "page.html").read_text(encoding="utf-8")
    assert "What differs from the paper" in page
    assert "more is not better" in page
    assert "H legacy = 0.385 H" in page
    assert "CC BY-SA 4.0" in page
    assert not re.search(r"<(?:script|link|iframe|object)\b", page)
    document = paper_document(read_finished(str(results), STUDY))
    assert text_of(document) in printed  # `rearl report` repeats the text of the study


@pytest.mark.slow
def test_an_interrupted_study_continues_to_the_results_of_an_uninterrupted_study(
    results, folder, rearl, two_rows, tmp_path
):
    interrupted = tmp_path / "interrupted"
    shutil.copytree(results, interrupted)
    continued = interrupted / STUDY
    for name in ("summary.json", "table1.parquet", "table1.png", "page.html"):
        (continued / name).unlink()
    (continued / "rows" / "idle" / "summary.json").unlink()  # the last file of a row, which is unfinished without it
    base_runs = continued / "rows" / "base" / "runs.parquet"
    written_at = base_runs.stat().st_mtime_ns
    rearl(interrupted, "study", "table1", *two_rows)
    assert base_runs.stat().st_mtime_ns == written_at
    assert (continued / "rows" / "idle" / "runs.parquet").stat().st_mtime_ns > written_at
    tables = [pd.read_parquet(path / "table1.parquet") for path in (continued, folder)]
    pd.testing.assert_frame_equal(*tables)
    summaries = [json.loads((path / "summary.json").read_text()) for path in (continued, folder)]
    assert summaries[0] == summaries[1]


def test_fig6_uses_the_rows_of_table1(results, rearl, two_rows, tmp_path):
    root = tmp_path / "results"
    shutil.copytree(results, root)
    rows = root / STUDY / "rows"
    idle_runs = rows / "idle" / "runs.parquet"
    written_at = idle_runs.stat().st_mtime_ns
    printed = rearl(root, "study", "fig6", f"table1.kept_in={STUDY}", *two_rows)
    assert idle_runs.stat().st_mtime_ns == written_at
    assert "page.html lists what differs: Fig. 6, data" in " ".join(printed.split())
    assert text_of(paper_document(read_finished(str(root), "study_fig6"))) in printed
    fig6 = root / "study_fig6"
    assert not (fig6 / "rows").exists()
    table = pd.read_parquet(fig6 / "fig6.parquet")
    assert set(table["row"]) == {"base", "idle", "real_vs_real"}
    h = table[(table["row"] == "base") & (table["metric"] == "h")]
    assert h["second"].tolist() == list(range(4, 60))  # the first window of 5 s has the seconds 0 to 4
    frames = pd.read_parquet(rows / "base" / "frames.parquet").query("method == 'base'")
    expected = frames.groupby("frame")["h"].mean().dropna()
    np.testing.assert_allclose(h["ours"].to_numpy(float), expected.to_numpy(float), rtol=1e-6)
    assert (h["low"] <= h["ours"]).all()
    assert (h["ours"] <= h["high"]).all()
    assert table["paper"].isna().all()
