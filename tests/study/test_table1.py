"""`rearl study table1` with two rows: files, figures against the rows' own, and a study that was killed."""

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


@pytest.fixture
def folder(table1):
    return table1[0] / "study_table1"


def test_every_file_is_there(folder):
    names = {path.name for path in folder.iterdir()}
    assert names == {"config.json", "page.html", "rows", "summary.json", "table1.parquet", "table1.png"}
    assert {path.name for path in (folder / "rows").iterdir() if path.is_dir()} == {"base", "idle"}
    assert (folder / "rows" / "idle" / "page.html").exists()
    assert read_metadata(folder / "table1.parquet")["generated"] == "false"


def test_figures_are_those_of_the_evaluations_beside_the_papers(folder):
    table = pd.read_parquet(folder / "table1.parquet").set_index(["row", "metric"])
    for name, method in (("base", "base"), ("idle", "rearl")):
        own = pd.read_parquet(folder / "rows" / name / "summary.parquet").set_index(["method", "metric"])
        for metric in ("h", "mape_a", "thw", "lcr"):
            assert table.loc[(name, metric), "ours"] == own.loc[(method, metric), "value"]
            assert table.loc[(name, metric), "low"] == own.loc[(method, metric), "low"]
    assert table.loc[("base", "h_legacy"), "paper"] == 0.346
    assert pd.isna(table.loc[("base", "h"), "paper"])
    assert pd.isna(table.loc[("idle", "mape_a"), "paper"])
    assert table.loc[("paper_ppo", "lcr"), "paper"] == 0.0138  # rows of the paper that correspond to none of ours
    assert pd.isna(table.loc[("paper_ppo", "lcr"), "ours"])
    assert pd.isna(table.loc[("base", "h"), "less_base"])
    assert table.loc[("idle", "h"), "less_base"] == pytest.approx(
        table.loc[("idle", "h"), "ours"] - table.loc[("base", "h"), "ours"]
    )
    numbers = table.select_dtypes("number").to_numpy(np.float64, na_value=0)
    assert np.isfinite(numbers).all()


def test_summary_is_flat_and_says_the_same(folder):
    summary = json.loads((folder / "summary.json").read_text())
    table = pd.read_parquet(folder / "table1.parquet").set_index(["row", "metric"])
    assert all(isinstance(value, (str, int, float, bool, type(None))) for value in summary.values())
    assert summary["n_rows"] == 2
    assert summary["idle_h"] == table.loc[("idle", "h"), "ours"]
    assert summary["base_h_legacy_paper"] == 0.346
    assert summary["real_thw"] > 0
    assert summary["base_h_less_base"] is None


def test_what_is_printed_never_claims_comparability(table1, folder):
    printed = " ".join(table1[1].split())
    assert "Only the signs of differences and the order of methods can be compared with the paper" in printed
    assert "traffic model, Hellinger distance, MAPE, decisions" in printed
    assert "paper: Base" in printed
    assert "closer than base" in printed
    assert printed.count("real against real") >= 1
    assert "…" not in table1[1]
    assert printed.count("held-out scenes (of") == 0  # the rows' own tables are on their own pages
    page = (folder / "page.html").read_text(encoding="utf-8")
    assert "What differs from the paper" in page
    assert "more is not better" in page
    assert "H legacy = 0.385 H" in page
    assert "CC BY-SA 4.0" in page
    assert not re.search(r"<(?:script|link|iframe|object)\b", page)
    document = paper_document(read_finished(str(table1[0]), "study_table1"))
    assert text_of(document) in table1[1]  # the report is of the same words


@pytest.mark.slow
def test_a_killed_study_goes_on_and_equals_one_that_was_not(table1, rearl, two_rows, tmp_path):
    root = tmp_path / "killed"
    shutil.copytree(table1[0], root)
    folder = root / "study_table1"
    for name in ("summary.json", "table1.parquet", "table1.png", "page.html"):
        (folder / name).unlink()
    (folder / "rows" / "idle" / "summary.json").unlink()  # written last: this row was being written
    finished = folder / "rows" / "base" / "runs.parquet"
    before = finished.stat().st_mtime_ns
    rearl(root, "study", "table1", *two_rows)
    assert finished.stat().st_mtime_ns == before
    assert (folder / "rows" / "idle" / "runs.parquet").stat().st_mtime_ns > before
    pd.testing.assert_frame_equal(
        pd.read_parquet(folder / "table1.parquet"), pd.read_parquet(table1[0] / "study_table1" / "table1.parquet")
    )
    assert json.loads((folder / "summary.json").read_text()) == json.loads(
        (table1[0] / "study_table1" / "summary.json").read_text()
    )


def test_fig6_uses_the_rows_of_table1(table1, rearl, two_rows, tmp_path):
    root = tmp_path / "results"
    shutil.copytree(table1[0], root)
    kept = root / "study_table1" / "rows" / "idle" / "runs.parquet"
    before = kept.stat().st_mtime_ns
    printed = rearl(root, "study", "fig6", "table1.kept_in=study_table1", *two_rows)
    assert kept.stat().st_mtime_ns == before
    assert "page.html lists what differs: Fig. 6, data" in " ".join(printed.split())
    assert text_of(paper_document(read_finished(str(root), "study_fig6"))) in printed
    folder = root / "study_fig6"
    assert not (folder / "rows").exists()
    table = pd.read_parquet(folder / "fig6.parquet")
    assert set(table["row"]) == {"base", "idle", "real_vs_real"}
    h = table[(table["row"] == "base") & (table["metric"] == "h")]
    assert h["second"].tolist() == list(range(4, 60))  # the first full window ends at second 4
    frames = pd.read_parquet(kept.parent.parent / "base" / "frames.parquet").query("method == 'base'")
    wanted = frames.groupby("frame")["h"].mean().dropna()
    np.testing.assert_allclose(h["ours"].to_numpy(float), wanted.to_numpy(float), rtol=1e-6)
    assert (h["low"] <= h["ours"]).all()
    assert (h["ours"] <= h["high"]).all()
    assert table["paper"].isna().all()
