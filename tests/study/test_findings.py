"""Sentences that are computed from figures say what the figures say."""

import pandas as pd

from rearl_jax.study.findings import Difference, RowDifferences, findings
from rearl_jax.study.table1_tables import verdict

CLOSER, SAME, FARTHER = Difference(-0.2, -0.3, -0.1), Difference(-0.05, -0.2, 0.1), Difference(0.2, 0.1, 0.3)


def said(rows, n_scenes=50, generated=False):
    return findings({"H": rows}, n_scenes=n_scenes, confidence=0.95, generated=generated)


def test_a_matcher_that_beats_everything():
    rows = [
        RowDifferences("base", None, FARTHER),
        RowDifferences("matcher", CLOSER, CLOSER, {"idle": CLOSER, "random": CLOSER}),
    ]
    base, real, controls, intervals = said(rows)
    assert base == "H: closer than base: matcher (-0.200, -0.300 to -0.100)."
    assert real.startswith("H: closer than real scenes are to each other: matcher")
    assert "This is not realism" in real
    assert "base" not in real
    assert controls.endswith("All its controls do worse.")
    assert intervals.startswith("5 intervals of 95 % were computed; about 0.3 of them")


def test_controls_that_do_as_well():
    rows = [RowDifferences("matcher", CLOSER, FARTHER, {"idle": SAME, "random": FARTHER})]
    base, real, controls, _ = said(rows)
    assert "closer than base: matcher" in base
    assert real == "H: every row is farther than real scenes are from each other."
    assert "not distinguished from its controls idle" in controls
    assert "farther than its controls random" in controls
    assert controls.endswith("Controls do as well, so its choices do not explain the gain.")
    mixed = said([RowDifferences("matcher", CLOSER, SAME, {"idle": CLOSER, "random": SAME})])
    assert (
        mixed[1] == "H: not distinguished from real against real: matcher (-0.050, -0.200 to +0.100); no row is closer."
    )
    assert mixed[2].endswith("Not every control does worse, so a gain by its choices is not shown.")


def test_a_row_that_is_worse_and_scenes_that_are_few():
    rows = [RowDifferences("PPO", FARTHER, FARTHER), RowDifferences("idle", SAME, None)]
    first, base, _, _, few = said(rows, n_scenes=5, generated=True)
    assert first.startswith("GENERATED")
    assert base.startswith("H: closer than base: no row; farther: PPO (+0.200")
    assert "not distinguished from base: idle" in base
    assert "only 5 held-out scenes" in few


def test_one_scene_tells_nothing_apart():
    rows = [RowDifferences("matcher", Difference(-0.4), Difference(-0.1), {"idle": Difference(-0.3)})]
    sentences = said(rows, n_scenes=1)
    assert "not distinguished from base: matcher (-0.400)" in sentences[0]
    assert "closer than base: no row" in sentences[0]
    assert sentences[-1] == "1 held-out scene(s) give no intervals, so nothing can be distinguished."


def test_an_interval_that_touches_zero_excludes_nothing():
    assert Difference(-0.1, -0.2, 0.0).sign == 0
    assert Difference(0.1, 0.0, 0.2).sign == 0
    assert (CLOSER.sign, FARTHER.sign) == (-1, 1)


def test_the_verdict_counts_rows_by_their_intervals():
    rows = pd.DataFrame({"metric": "h", "less_base_low": [-0.2, -0.1, None], "less_base_high": [-0.1, 0.1, None]})
    assert verdict(rows).startswith("By the Hellinger distance of speeds, 1 of 2 rows are closer")
    assert "closer" not in verdict(rows[2:])
