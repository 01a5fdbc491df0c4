"""The method rearl in the evaluation: common random numbers, tables, missing keys."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from rearl_jax.config.detection import Cues, DetectionConfig
from rearl_jax.config.evaluation import Method
from rearl_jax.data.scenes.splits import Split, Splits
from rearl_jax.decision.situation import ACTION_NAMES
from rearl_jax.evaluation.estimates import estimates
from rearl_jax.evaluation.inputs import Inputs
from rearl_jax.evaluation.interventions import decision_table
from rearl_jax.evaluation.percentiles import base_values, thresholds_of
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row
from rearl_jax.evaluation.runner import evaluate
from rearl_jax.evaluation.simulators import NEVER_EXCEEDED, program
from rearl_jax.evaluation.task import documented
from rearl_jax.progress import silent
from tests.refusal import refused


@pytest.fixture
def evaluation(scenes, intervening, references):
    return evaluate(intervening, scenes, np.array([1, 4]), references=references, thresholds=(0.1, 0.05))


def test_decisions_are_counted_second_by_second(scenes, intervening, evaluation):
    table = decision_table(scenes, evaluation.log, intervening.hist.window)
    assert len(table) == 2 * 3 * scenes.seconds
    assert table.scene_id.unique().tolist() == [1, 4]
    assert table.triggered.any()
    told = table[[*ACTION_NAMES, "inadmissible", "invalid"]].sum(axis=1)
    assert (told == table.asked).all()
    assert (table.asked[table.frame == 0] == 0).all()
    assert table.h[table.frame < 4].isna().all()
    assert table.h[table.frame >= 4].notna().all()
    found = estimates(evaluation.rows, evaluation.held_out, intervening.eval)
    methods, *_, interventions, _ = documented(evaluation, found).sections
    assert any(f"{table.asked.sum()} decisions in 6 rollouts" in note for note in methods.notes)
    (row,) = interventions.tables[0].rows
    assert [cell.value for cell in row.cells[1:3]] == [f"{n:,}" for n in (table.asked.sum(), table.left.sum())]


def test_decisions_have_the_frame_that_they_were_made_in(scenes, intervening, evaluation):
    """Among replayed traffic the first frame is the start, so there is a second less than frames."""
    log, window = evaluation.log, intervening.hist.window
    bounded = replace(log, decisions=jax.tree.map(lambda leaf: leaf[1:], log.decisions))
    table = decision_table(scenes, bounded, window)
    assert table.frame.unique().tolist() == list(range(1, scenes.seconds))
    assert table.h[table.frame < window].isna().all()
    assert table.h[table.frame >= window].notna().all()
    of_log = decision_table(scenes, log, window)
    same = of_log[of_log.frame > 0].reset_index(drop=True)
    np.testing.assert_array_equal(table.mape, same.mape)
    np.testing.assert_array_equal(table.frame, same.frame)


def test_base_stands_beside_the_method_from_the_same_initial_states(scenes, intervening, evaluation):
    held_out = np.array([1, 4])
    assert [row.row for row in evaluation.rows] == ["rearl", "base", "real_vs_real", "noise_floor", "real"]
    alone = evaluate(replace(intervening, method=Method.base), scenes, held_out)
    for name, values in evaluation.row("base").values.items():
        np.testing.assert_array_equal(values, alone.rows[0].values[name])
    rearl, base = (evaluation.row(name).values["h"] for name in ("rearl", "base"))
    assert (rearl != base).any()
    found = estimates(evaluation.rows, held_out, intervening.eval)
    less = found["rearl", "h"]
    assert less.less_base == pytest.approx((rearl - base).mean())
    assert less.less_base_low <= less.less_base <= less.less_base_high
    assert found["base", "h"].less_base is None


def test_rows_of_one_batch_get_the_same_rollouts_and_thresholds_do_not_recompile(scenes, intervening, references):
    held_out = np.array([0, 3])
    (resting,) = Rollouts([Row(intervening)], scenes, held_out, references).chunks()
    pairs = [NEVER_EXCEEDED, (0.1, 0.05), (np.inf, float(np.median(resting.decisions.mape)))]
    rows = [Row(intervening, thresholds=pair) for pair in pairs]
    together = Rollouts(rows, scenes, held_out, references)
    assert together.row.tolist() == [0] * 6 + [1] * 6 + [2] * 6
    (base,) = Rollouts([Row(replace(intervening, method=Method.base))], scenes, held_out).chunks()
    assert base.decisions is None
    joined = list(together.chunks())
    compiled = program.cache_info().misses
    for row, part in zip(rows, joined, strict=True):
        alone = Rollouts([row], scenes, held_out, references)
        (simulated,) = alone.chunks()
        np.testing.assert_array_equal(part.decisions.triggered, simulated.decisions.triggered)
        np.testing.assert_array_equal(part.frames.x, simulated.frames.x)
        np.testing.assert_array_equal(part.frames.x[0], base.frames.x[0])
    assert program.cache_info().misses == compiled
    np.testing.assert_array_equal(joined[0].frames.x, base.frames.x)
    asked = [int(part.decisions.n_asked.sum()) for part in joined]
    assert asked[0] == 0
    assert asked[1] > asked[2] > 0
    assert (joined[1].frames.x[-1] != base.frames.x[-1]).any()


def test_missing_references_are_named(scenes, intervening):
    with refused("references-missing", key="method=rearl"):
        Rollouts([Row(intervening)], scenes, np.arange(2))


@pytest.mark.thorough
def test_thresholds_are_percentiles_of_base_where_none_is_given(scenes, intervening):
    subset = np.array([0, 5])
    label = np.where(np.isin(np.arange(6), subset), Split.THRESHOLD, Split.EVALUATION)
    inputs = Inputs(scenes, Splits(label, {}, 0, 0))
    base = base_values(intervening, scenes, subset)
    n_rollouts = 3 * len(subset)
    assert len(base.mape) == n_rollouts * scenes.seconds
    assert len(base.h) == n_rollouts * (scenes.seconds - intervening.hist.window + 1)
    assert (base.h < base.threshold_h(30.0)).mean() == pytest.approx(0.3, abs=0.02)

    def thresholds(**keys):
        return thresholds_of(replace(intervening, detection=DetectionConfig(**keys)), inputs, silent())

    assert thresholds() == (base.threshold_h(30.0), base.threshold_m(5.0))
    assert thresholds(threshold_h=0.2, m_pct=50.0) == (0.2, base.threshold_m(50.0))
    assert thresholds(threshold_h=0.2, threshold_m=0.1) == (0.2, 0.1)
    assert thresholds(cues=Cues.speed, h_pct=10.0) == (base.threshold_h(10.0), np.inf)
    assert thresholds(cues=Cues.never) == (np.inf, np.inf)
