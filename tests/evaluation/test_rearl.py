"""The method rearl in the evaluation: common random numbers, tables, missing keys."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.problems import InvalidInputError


@pytest.fixture
def references(scenes):
    from rearl_jax.detection.references import References

    chosen = [0, 3]
    with_float32 = (scenes.scaled_speed, scenes.spacing, scenes.mean_spacing)
    import jax.numpy as jnp

    speed, spacing, mean = (jnp.asarray(values[chosen], jnp.float32) for values in with_float32)
    action = jnp.asarray(scenes.action[chosen], jnp.int32)
    return References(speed, spacing, mean, action, jnp.asarray([0.25, 0.75], jnp.float32))


@pytest.fixture
def intervening(small):
    from rearl_jax.config.detection import DetectionConfig
    from rearl_jax.config.evaluation import Method

    core = replace(small.core, collisions=False)
    detection = DetectionConfig(threshold_h=0.1, threshold_m=0.05)
    return replace(small, method=Method.rearl, detection=detection, core=core)


def test_decisions_are_counted_second_by_second(scenes, intervening, references):
    from rearl_jax.decision.situation import ACTION_NAMES
    from rearl_jax.evaluation.estimates import estimates
    from rearl_jax.evaluation.interventions import decision_table
    from rearl_jax.evaluation.runner import evaluate
    from rearl_jax.evaluation.task import documented

    evaluation = evaluate(intervening, scenes, np.array([1, 4]), references=references, thresholds=(0.1, 0.05))
    table = decision_table(scenes.scene_id, evaluation.log, intervening.hist.window)
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


def test_base_stands_beside_the_method_from_the_same_initial_states(scenes, intervening, references):
    from rearl_jax.config.evaluation import Method
    from rearl_jax.evaluation.estimates import estimates
    from rearl_jax.evaluation.runner import evaluate

    held_out = np.array([1, 4])
    evaluation = evaluate(intervening, scenes, held_out, references=references, thresholds=(0.1, 0.05))
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


def test_the_first_second_is_that_of_the_base_and_thresholds_do_not_recompile(scenes, intervening, references):
    from rearl_jax.config.evaluation import Method
    from rearl_jax.evaluation.rollouts import Rollouts
    from rearl_jax.evaluation.simulators import program

    def simulated(config, *interventions):
        (part,) = Rollouts(config, scenes, np.arange(6), *interventions).chunks(64)
        return part

    base = simulated(replace(intervening, method=Method.base))
    acting = simulated(intervening, references, [(0.1, 0.05)])
    assert base.decisions is None
    np.testing.assert_array_equal(acting.frames.x[0], base.frames.x[0])
    assert (acting.frames.x[-1] != base.frames.x[-1]).any()
    compiled = program.cache_info().misses
    resting = simulated(intervening, references, [(1.0, 1e9)])
    assert program.cache_info().misses == compiled
    np.testing.assert_array_equal(resting.frames.x, base.frames.x)


@pytest.mark.slow
def test_every_pair_of_thresholds_gets_the_same_rollouts(scenes, intervening, references):
    """All pairs as one batch are what they are one by one."""
    from rearl_jax.evaluation.rollouts import Rollouts
    from rearl_jax.evaluation.simulators import NEVER

    pairs = [NEVER, (0.1, 0.05), (2.0, 0.5)]
    together = Rollouts(intervening, scenes, np.arange(3), references, pairs)
    assert together.cell.tolist() == [0] * 9 + [1] * 9 + [2] * 9
    (joined,) = together.chunks(64)
    for number, pair in enumerate(pairs):
        alone = Rollouts(intervening, scenes, np.arange(3), references, [pair])
        own = together.cell == number
        np.testing.assert_array_equal(together.scene[own], alone.scene)
        np.testing.assert_array_equal(together.run[own], alone.run)
        (part,) = alone.chunks(64)
        np.testing.assert_array_equal(joined.decisions.triggered[:, own], part.decisions.triggered)
        np.testing.assert_allclose(joined.frames.x[..., own], part.frames.x, atol=1e-3)
    asked = [int(joined.decisions.n_asked[:, together.cell == number].sum()) for number in range(3)]
    assert asked[0] == 0
    assert asked[1] > asked[2] > 0


def test_missing_references_are_named(scenes, intervening):
    from rearl_jax.evaluation.rollouts import Rollouts

    with pytest.raises(InvalidInputError) as caught:
        Rollouts(intervening, scenes, np.arange(2))
    assert (caught.value.code, caught.value.problem.key) == ("references-missing", "method=rearl")


@pytest.mark.thorough
def test_thresholds_are_percentiles_of_base_where_none_is_given(scenes, intervening):
    from rearl_jax.config.detection import Cues, DetectionConfig
    from rearl_jax.evaluation.percentiles import base_values, detection_thresholds

    subset = np.array([0, 2, 5])
    base = base_values(intervening, scenes, subset)
    n_rollouts = 3 * len(subset)
    assert base.n_rollouts == n_rollouts
    assert len(base.mape) == n_rollouts * scenes.seconds
    assert len(base.h) == n_rollouts * (scenes.seconds - intervening.hist.window + 1)
    assert (base.h < base.threshold_h(30.0)).mean() == pytest.approx(0.3, abs=0.02)

    def thresholds(**keys):
        return detection_thresholds(replace(intervening, detection=DetectionConfig(**keys)), scenes, subset)

    assert thresholds() == (base.threshold_h(30.0), base.threshold_m(5.0))
    assert thresholds(threshold_h=0.2, m_pct=50.0) == (0.2, base.threshold_m(50.0))
    assert thresholds(threshold_h=0.2, threshold_m=0.1) == (0.2, 0.1)
    assert thresholds(cues=Cues.speed, h_pct=10.0) == (base.threshold_h(10.0), np.inf)
    assert thresholds(cues=Cues.never) == (np.inf, np.inf)
