"""Drivers of the rows: parts of a model switched on and off, in one structure."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from rearl_jax.config.budget import CALIBRATED, FOUND, LANE_CHANGES, VARIATION
from rearl_jax.config.core import CoreConfig
from rearl_jax.core.effects.lane_changes import KeepRight, Politeness
from rearl_jax.models.population import population_of_model
from rearl_jax.models.record import EffectValues
from rearl_jax.study.budget.components import rows_of
from rearl_jax.study.budget.drivers import components_of, drivers_of, switched_off
from tests.models.drivers import CURVE, GAIN, MOBIL, model

VARIES = EffectValues("time_gap_variation", {"sd": 0.2, "time": 20.0, "start_share": 0.5})
POLITE = EffectValues("politeness", {"weight": 0.4})
FULL = replace(model(GAIN, CURVE, VARIES, POLITE), lane_changing=MOBIL)
CORE = CoreConfig()


def row(*names):
    return frozenset({CALIBRATED, *names})


def test_a_model_says_which_components_it_has():
    assert components_of(FULL) == {FOUND: True, LANE_CHANGES: True, VARIATION: True}
    assert components_of(model(noise_sd=0.0)) == {FOUND: False, LANE_CHANGES: False, VARIATION: False}
    assert components_of(model(VARIES, noise_sd=0.0)) == {FOUND: False, LANE_CHANGES: False, VARIATION: True}


def test_all_rows_are_one_program():
    rows = rows_of((CALIBRATED, FOUND, LANE_CHANGES, VARIATION))[1:]
    made = [drivers_of(FULL, one, CORE) for one in rows]
    assert len(rows) == 8
    assert len({jax.tree.structure(one) for one in made}) == 1
    assert len({tuple((np.shape(leaf), np.asarray(leaf).dtype) for leaf in jax.tree.leaves(one)) for one in made}) == 1
    assert made[0].is_noisy


def test_the_row_with_everything_is_the_repaired_model():
    whole = drivers_of(FULL, row(FOUND, LANE_CHANGES, VARIATION), CORE)
    wanted = population_of_model(FULL, np.dtype("float32"), with_effects=True)
    for name in ("median", "factor", "noise", "length", "shares"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(wanted, name))
    np.testing.assert_array_equal(whole.lane_changing.gain_threshold, wanted.lane_changing.gain_threshold)
    assert float(whole.lane_changing.politeness) == 0.0  # the effect takes its place
    assert [type(effect) for effect in whole.effects] == [type(effect) for effect in wanted.effects]


def test_calibrated_drivers_alone_have_neither_effects_nor_noise():
    plain = drivers_of(FULL, row(), CORE)
    baseline = population_of_model(FULL, np.dtype("float32"), with_effects=False)
    np.testing.assert_array_equal(plain.median, baseline.median)
    np.testing.assert_array_equal(plain.noise[:, 0], 0.0)
    assert (plain.noise[:, 1] > 0).all()
    for effect in plain.effects:
        for known in type(effect).parameters:
            if known.is_strength:
                np.testing.assert_array_equal(getattr(effect, known.name), known.off)
    assert float(plain.lane_changing.gain_threshold) == pytest.approx(0.2)  # highway-env's


def test_lane_changes_without_what_was_found_have_their_own_politeness_and_bias():
    changing = drivers_of(FULL, row(LANE_CHANGES), CORE)
    assert float(changing.lane_changing.politeness) == pytest.approx(MOBIL.politeness)
    biases = [float(effect.bias) for effect in changing.effects if isinstance(effect, KeepRight)]
    assert biases == [pytest.approx(MOBIL.bias)]
    weights = [float(effect.weight) for effect in changing.effects if isinstance(effect, Politeness)]
    assert weights == [0.0]


def test_variation_has_the_noise_that_was_estimated_beside_it():
    noisy = drivers_of(FULL, row(VARIATION), CORE)
    np.testing.assert_allclose(noisy.noise[:, 0], FULL.population["car"].noise_sd)


def test_curves_are_switched_off_at_every_knot():
    off = switched_off(CURVE)
    assert off.parameters["values"] == [0.0, 0.0, 0.0]
    assert off.parameters["knots"] == CURVE.parameters["knots"]
    assert off.variable == CURVE.variable
