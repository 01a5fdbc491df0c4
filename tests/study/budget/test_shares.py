"""Shares of components: they sum to the whole, follow the definition, and keep to the possible orders."""

from itertools import permutations

import numpy as np
import pytest

from rearl_jax.config.budget import COMPONENTS, NEEDS, BudgetConfig
from rearl_jax.study.budget.components import orders, row_name, row_of, rows_of
from rearl_jax.study.budget.shares import shares_of
from tests.refusal import refused


def drawn(components, n_scenes=4, seed=0):
    rng = np.random.default_rng(seed)
    return {row: rng.uniform(0, 1, n_scenes) for row in rows_of(components)}


@pytest.mark.parametrize("components", [COMPONENTS, ("start",), ("rearl", "start", "boundary")])
def test_shares_sum_to_the_whole_in_every_scene(components):
    errors = drawn(components)
    shares = shares_of(errors, orders(components))
    whole = errors[frozenset()] - errors[frozenset(components)]
    assert np.abs(whole).min() > 1e-3
    np.testing.assert_allclose(shares.by_component.sum(axis=0), whole)
    np.testing.assert_allclose(shares.whole, whole)
    np.testing.assert_allclose(shares.by_order.sum(axis=1), whole.mean())
    assert shares.components == components


def test_every_component_comes_after_the_one_it_needs():
    every = orders(COMPONENTS)
    assert every[0] == COMPONENTS
    assert len(every) == len(set(every)) == 630
    for order in every:
        assert all(order.index(needed) < order.index(name) for name, needed in NEEDS.items())
    # three starts, nine choices of drivers, with and without REARL
    assert len(rows_of(COMPONENTS)) == 54
    assert rows_of(COMPONENTS)[0] == frozenset()


def test_without_constraints_a_share_is_that_of_shapley():
    components = ("start", "calibrated", "rearl")
    errors = drawn(components)
    shares = shares_of(errors, orders(components))
    for place, name in enumerate(components):
        falls = []
        for order in permutations(components):
            before = frozenset(order[: order.index(name)])
            falls.append(errors[before] - errors[before | {name}])
        np.testing.assert_allclose(shares.by_component[place], np.mean(falls, axis=0))
    np.testing.assert_allclose(shares.stated[0], np.mean(errors[frozenset()] - errors[frozenset({"start"})]))


def test_a_component_that_does_nothing_has_no_share_and_an_additive_one_its_effect():
    effect = {"start": 2.0, "boundary": 0.0, "rearl": 0.5}
    errors = {row: np.full(3, 5.0 - sum(effect[name] for name in row)) for row in rows_of(tuple(effect))}
    shares = shares_of(errors, orders(tuple(effect)))
    np.testing.assert_allclose(shares.by_component, np.array(list(effect.values()))[:, None] * np.ones(3))
    np.testing.assert_array_equal(shares.leading_share, [1.0, 0.0, 0.0])


def test_a_scene_without_an_error_in_some_row_counts_in_none():
    errors = drawn(("start", "rearl"))
    errors[frozenset({"rearl"})][1] = np.nan
    shares = shares_of(errors, orders(("start", "rearl")))
    assert np.isfinite(shares.by_component).all(axis=0).tolist() == [True, False, True, True]
    assert np.isfinite(shares.whole).tolist() == [True, False, True, True]
    kept = [0, 2, 3]
    np.testing.assert_allclose(shares.stated[0], (errors[frozenset()] - errors[frozenset({"start"})])[kept].mean())


def test_names_of_rows_are_read_back():
    rows = rows_of(COMPONENTS)
    assert [row_of(row_name(row)) for row in rows] == rows
    assert row_name(frozenset({"rearl", "start"})) == "start+rearl"


@pytest.mark.parametrize(
    ("components", "code"),
    [
        ((), "out-of-range"),
        (("start", "start"), "out-of-range"),
        (("start", "weather"), "out-of-range"),
        (("boundary",), "component-missing"),
        (("boundary", "start"), "component-missing"),
        (("start", "found"), "component-missing"),
    ],
)
def test_components_that_cannot_be_are_refused(components, code):
    with refused(code, key="components"):
        BudgetConfig(components).check()
