"""The threshold pairs: the front, what is concluded, and the command from end to end."""

import json

import pandas as pd
import pytest

from rearl_jax.config import StudyTable3Task
from rearl_jax.study.pair_results import METRICS, pareto, with_choice
from rearl_jax.study.table3_figure import draw_pairs
from rearl_jax.study.table3_tables import conclusions, long_pairs, sections

SUMMARY = {"is_distinguishable": False, "lead": 0.1, "lead_low": -0.1, "lead_high": 0.2}


def pair(h_pct, m_pct, h, mape):
    own = {"row": f"{h_pct:g} % / {m_pct:g} %", "h_pct": h_pct, "m_pct": m_pct}
    figures = dict.fromkeys(METRICS, 0.5) | {"h": h, "mape": mape}
    ends = {f"{name}_{end}": value for name in METRICS for end, value in (("low", 0.1), ("high", 0.9))}
    return own | figures | ends | {"threshold_h": 0.3, "threshold_m": 0.4, "win_share": 0.5}


def pairs_of(base, best):
    rows = [pair(30.0, 5.0, 0.4, 0.4), pair(20.0, 20.0, 0.3, 0.6), pair(5.0, 5.0, 0.5, 0.5), pair(0.0, 0.0, *base)]
    rows[-1] |= {"row": "base", "h_pct": None, "m_pct": None}
    return with_choice(pd.DataFrame(rows), best)


@pytest.fixture
def pairs():
    return pairs_of((0.8, 0.9), (30.0, 5.0))


def test_the_front_holds_what_no_other_beats_in_both():
    assert pareto([(1.0, 3.0), (2.0, 2.0), (3.0, 1.0), (3.0, 3.0), (2.0, 2.0)]) == [0, 1, 2, 4]
    assert pareto([(1.0, 1.0), (1.0, 2.0), (2.0, 1.0)]) == [0]


def test_conclusions_follow_from_the_pairs(pairs):
    first, second, *_, front = conclusions(pairs, SUMMARY, 15)
    assert first == "Best pair: ours 30 % / 5 %, the paper's 30 % / 5 %."
    assert "15 scenes cannot tell ours from the next best" in second
    assert "20 % / 20 %, 30 % / 5 %; 2 of the paper's 3 are among them" in front
    said = conclusions(pairs_of((0.4, 0.4), (5.0, 5.0)), SUMMARY, 15)
    assert "The paper's pair is number 1 of 3 here" in said[2]
    assert said[-1] == "No pair is closer to the recorded scenes than base."


def test_one_scene_has_no_interval_and_one_pair_no_next_best(pairs):
    _, second, *_ = conclusions(pairs, SUMMARY | {"lead_low": None, "lead_high": None}, 1)
    assert second.endswith("cannot tell ours from the next best: it leads by 0.1000 (no interval from one scene).")
    alone = pairs.iloc[[0, -1]].reset_index(drop=True)
    assert not any("next best" in sentence for sentence in conclusions(alone, SUMMARY, 15))


def test_long_table_marks_the_papers_pairs(pairs):
    long = long_pairs(pairs)
    table = long.set_index(["row", "metric"])
    assert table.loc[("30 % / 5 %", "is_best"), ["ours", "paper"]].tolist() == [1, 1]
    assert table.loc[("20 % / 20 %", "is_pareto"), ["ours", "paper"]].tolist() == [1, 1]
    assert table.loc[("5 % / 5 %", "is_pareto"), ["ours", "paper"]].tolist() == [0, 0]
    assert table.loc[("30 % / 5 %", "threshold_h"), "paper"] == 0.3306
    assert pd.isna(table.loc[("base", "score"), "paper"])
    assert pd.isna(table.loc[("base", "score"), "h_pct"])
    shown = sections(StudyTable3Task(), long, {})[0].tables[0]
    assert [row.title for row in shown.rows][::2] == ["30 % / 5 %", "20 % / 20 %", "5 % / 5 %", "base"]
    assert [cell.value for cell in shown.rows[1].cells[:2]] == ["0.3306", "0.1982"]
    assert [cell.value for cell in shown.rows[0].cells[5:8]] == ["50.0 %", "yes", "yes"]


def test_figure_is_drawn(pairs):
    assert draw_pairs(pairs, 15, generated=False)[:4] == b"\x89PNG"
    assert draw_pairs(pairs, 15, generated=True) != draw_pairs(pairs, 15, generated=False)


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
