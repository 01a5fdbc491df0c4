"""The threshold pairs: the front, what is concluded, and the command from end to end."""

import json
from dataclasses import replace

import pandas as pd
import pytest

from rearl_jax.study.pair_results import PairResults, PairRow, pareto
from rearl_jax.study.table3_figure import draw_pairs
from rearl_jax.study.table3_tables import conclusions, long_pairs


def pair(h_pct, m_pct, h, mape):
    means = {"h": h, "mape": mape, "thw": 3.0, "lcr": 0.01, "collisions": 0.0}
    return PairRow(h_pct, m_pct, (0.3, 0.4), means, dict.fromkeys(means, (0.1, 0.9)), 0.5)


@pytest.fixture
def results():
    rows = [pair(30.0, 5.0, 0.4, 0.4), pair(20.0, 20.0, 0.3, 0.6), pair(5.0, 5.0, 0.5, 0.5)]
    base = replace(pair(None, None, 0.8, 0.9), thresholds=None, win_share=None)
    summary = {"best_h_pct": 30.0, "best_m_pct": 5.0, "is_distinguishable": False}
    summary |= {"lead": 0.1, "lead_low": -0.1, "lead_high": 0.2}
    return PairResults(rows, base, summary, 15)


def test_the_front_holds_what_no_other_beats_in_both():
    assert pareto([(1.0, 3.0), (2.0, 2.0), (3.0, 1.0), (3.0, 3.0), (2.0, 2.0)]) == [0, 1, 2, 4]
    assert pareto([(1.0, 1.0), (1.0, 2.0), (2.0, 1.0)]) == [0]


def test_conclusions_follow_from_the_pairs(results):
    first, second, *_, front = conclusions(results)
    assert first == "Best pair: ours 30 % / 5 %, the paper's 30 % / 5 %."
    assert "15 scenes cannot tell ours from the next best" in second
    assert "20 % / 20 %, 30 % / 5 %; 2 of the paper's 3 are among them" in front
    other = replace(results, summary=results.summary | {"best_h_pct": 5.0}, base=results.pairs[0])
    said = conclusions(other)
    assert "The paper's pair is number 1 of 3 here" in said[2]
    assert said[-1] == "No pair is closer to the recorded scenes than base."


def test_long_table_marks_the_papers_pairs(results):
    table = long_pairs(results).set_index(["row", "metric"])
    assert table.loc[("30 % / 5 %", "is_best"), ["ours", "paper"]].tolist() == [1, 1]
    assert table.loc[("20 % / 20 %", "is_pareto"), ["ours", "paper"]].tolist() == [1, 1]
    assert table.loc[("5 % / 5 %", "is_pareto"), ["ours", "paper"]].tolist() == [0, 0]
    assert table.loc[("30 % / 5 %", "threshold_h"), "paper"] == 0.3306
    assert pd.isna(table.loc[("base", "score"), "paper"])


def test_figure_is_drawn(results):
    assert draw_pairs(results, generated=False)[:4] == b"\x89PNG"
    assert draw_pairs(results, generated=True) != draw_pairs(results, generated=False)


@pytest.mark.slow
def test_the_command_runs_the_sweep_and_stands_beside_the_paper(rearl, quick, tmp_path):
    keys = ["sweep.h_pct=[5,30]", "sweep.m_pct=[5,20]", *quick]
    printed = rearl(tmp_path, "study", "table3", *keys)
    assert "Best pair: ours" in printed
    folder = tmp_path / "study_table3"
    own = pd.read_parquet(folder / "sweep" / "table3.parquet")
    table = pd.read_parquet(folder / "table3.parquet")
    assert table[table["metric"] == "h"]["ours"].tolist()[:4] == pytest.approx(own["h"].tolist(), abs=1e-6)
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["best_h_pct"] == own[own["is_best"]]["h_pct"].iloc[0]
    assert summary["threshold_h_p30_paper"] == 0.3306
    before = (folder / "sweep" / "summary.json").stat().st_mtime_ns
    rearl(tmp_path, "study", "table3", *keys)
    assert (folder / "sweep" / "summary.json").stat().st_mtime_ns == before
