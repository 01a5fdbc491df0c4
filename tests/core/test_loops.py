"""Loops as single kernels: the same results, and a program that the compiler cannot translate so runs as it is."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core.batch import NO_OPTIONS, SOON_COMPILED, ScenarioMap
from rearl_jax.core.loops import ATTRIBUTES, with_loops_as_kernels

X = np.linspace(-1.0, 1.0, 3 * 7).reshape(3, 7)


def steps(x):
    """A loop with a literal start, a constant of its own, a loop inside it and another one after it."""
    factors = jnp.asarray([0.5, 0.25, 0.125])[:, None]

    def step(carry, k):
        inner = jax.lax.fori_loop(0, 3, lambda i, value: value + factors[i] * jnp.sin(x[i]), carry)
        return inner * 0.9, inner.sum() + k

    end, sums = jax.lax.scan(step, jnp.zeros(x.shape[1]), jnp.arange(5.0))
    limit = jax.lax.while_loop(lambda value: value.sum() < 10.0, lambda value: value + 1.0, jnp.abs(end))
    return {"end": end, "limit": limit, "sums": sums[:, None] * jnp.ones((1, x.shape[1]))}


def scattered(x):
    """A loop with an operation that a kernel cannot contain."""

    def step(total, k):
        return total.at[jnp.argsort(x[:, 0])].add(jnp.cos(x) * k), k

    return jax.lax.scan(step, jnp.zeros(x.shape), jnp.arange(4.0))[0]


def test_outermost_loops_are_marked_and_not_the_operations_in_them():
    text = jax.jit(with_loops_as_kernels(jax.make_jaxpr(steps)(X))).lower(X).as_text()
    marked = [line for line in text.splitlines() if all(name in line for name in ATTRIBUTES)]
    assert sum(" call @" in line for line in marked) == 2
    assert "stablehlo.sine" in text
    assert not any("stablehlo.sine" in line for line in marked)


@pytest.mark.parametrize("options", [NO_OPTIONS, SOON_COMPILED], ids=["fully optimised", "soon compiled"])
@pytest.mark.parametrize("function", [steps, scattered])
def test_results_are_the_same(function, options):
    plain, kernels = (
        ScenarioMap(function, chunk=7, options=options, loops_as_kernels=which) for which in (False, True)
    )
    expected, found = jax.tree.leaves(plain(X)), jax.tree.leaves(kernels(X))
    assert len(found) == len(expected) > 0
    for one, other in zip(found, expected, strict=True):
        assert np.any(other != 0.0)
        np.testing.assert_allclose(one, other, rtol=1e-14)


def test_other_errors_are_raised():
    def failing(x):
        jax.debug.callback(lambda: 1 / 0)
        return jax.lax.scan(lambda carry, k: (carry + k, k), x, jnp.arange(3.0))[0]

    with pytest.raises(jax.errors.JaxRuntimeError, match="ZeroDivisionError"):
        ScenarioMap(failing, chunk=7, loops_as_kernels=True)(X)
