"""Rollouts, and the map that spreads scenarios over chunks and devices."""

import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.core import conflicts
from rearl_jax.core.batch import QUICKLY_COMPILED, ScenarioMap, chunk_for
from rearl_jax.core.meta_actions import apply_meta_actions
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import Frames, rollout
from rearl_jax.core.spawn import spawn
from rearl_jax.core.state import Controller, nearest_lane
from rearl_jax.core.step import step
from tests.core import simulation
from tests.core.simulation import MODEL, N_VEHICLES

N_SCENARIOS, N_SECONDS = 8, 4


def simulate(arguments):
    state, drivers, actions = arguments
    return rollout(state, drivers, MODEL, n_seconds=N_SECONDS, actions=actions)


@pytest.fixture(scope="module")
def arguments():
    """Drawn traffic, three vehicles of each scenario driven by random meta-actions."""
    keys = jax.random.split(jax.random.key(3), N_SCENARIOS)
    state, drivers = spawn(keys, MODEL, n_vehicles=N_VEHICLES, dtype=jnp.dtype(jnp.float64))
    controller = np.array(state.controller)
    controller[::4] = Controller.META
    object.__setattr__(state, "controller", jnp.asarray(controller))
    rng = np.random.default_rng(0)
    actions = jnp.asarray(rng.integers(5, size=(N_SECONDS, N_VEHICLES, N_SCENARIOS)), jnp.int32)
    return state, drivers, actions


@pytest.fixture(scope="module")
def rolled(arguments):
    return jax.tree.map(np.asarray, jax.jit(simulate)(arguments))


def test_frames_are_the_states_after_each_second(arguments, rolled):
    """A rollout is meta-actions and ticks, one after the other; parameters of length one are those of everybody."""
    state, drivers, actions = arguments
    assert {leaf.shape for leaf in jax.tree.leaves(drivers)} == {(1, 1), (N_VEHICLES, N_SCENARIOS)}
    final, frames = rolled
    assert isinstance(frames, Frames)
    assert frames.x.shape == (N_SECONDS, N_VEHICLES, N_SCENARIOS)
    for second in range(N_SECONDS):
        state = jax.tree.map(jnp.asarray, apply_meta_actions(state, actions[second], MODEL))
        state = simulation.advance(state, drivers, n_ticks=15)
        for name in ("x", "y", "heading", "speed", "acceleration"):
            np.testing.assert_allclose(getattr(frames, name)[second], getattr(state, name), rtol=0, atol=1e-9)
        np.testing.assert_array_equal(frames.crashed[second], state.crashed)
        np.testing.assert_array_equal(frames.lane[second], np.clip(np.ceil(state.y / 4 - 0.5), 0, 3))
        state = jax.tree.map(jnp.asarray, state)
    np.testing.assert_array_equal(final.target_lane, state.target_lane)
    np.testing.assert_array_equal(frames.x[-1], final.x)
    assert (np.diff(frames.lane, axis=0) != 0).sum() > 10
    assert (np.diff(frames.speed, axis=0) > 0.5).any()


@pytest.mark.thorough
def test_map_over_chunks_is_the_function_itself(arguments, rolled):
    """Eight scenarios in chunks of three: the last chunk is filled up, nothing of the filling comes back."""
    mapped = ScenarioMap(simulate, chunk=3)
    parts = list(mapped.chunks(arguments))
    assert [part[1].x.shape[-1] for part in parts] == [3, 3, 2]
    joined = jax.tree.map(lambda *leaves: np.concatenate(leaves, axis=-1), *parts)
    assert (np.diff(joined[1].lane, axis=0) != 0).sum() > 10
    for a, b in zip(jax.tree.leaves(joined), jax.tree.leaves(rolled), strict=True):
        assert a.dtype == b.dtype
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 if a.dtype.kind == "f" else 0)
    for a, b in zip(jax.tree.leaves(mapped(arguments)), jax.tree.leaves(rolled), strict=True):
        np.testing.assert_array_equal(a, b)


def doubled(tree):
    return {"twice": tree["a"] * 2, "sum": tree["a"].sum(0) + tree["b"]}


@pytest.mark.parametrize("n_scenarios", [1, 4, 7, 8, 9])
def test_map_joins_any_number_of_scenarios_in_order(n_scenarios):
    tree = {"a": np.arange(3.0 * n_scenarios).reshape(3, n_scenarios), "b": np.arange(n_scenarios) * 1.0}
    result = ScenarioMap(doubled, chunk=4)(tree)
    np.testing.assert_array_equal(result["twice"], tree["a"] * 2)
    np.testing.assert_array_equal(result["sum"], tree["a"].sum(0) + tree["b"])


def test_map_takes_random_keys():
    keys = jax.random.split(jax.random.key(3), 9)
    drawn = ScenarioMap(jax.vmap(jax.random.uniform), chunk=2)(keys)
    assert len(set(drawn.tolist())) == 9
    np.testing.assert_allclose(drawn, jax.vmap(jax.random.uniform)(keys), rtol=1e-6)


def traced_map(chunk):
    """A map that adds one, and the shapes that it was traced for."""
    traced = []

    def function(x):
        traced.append(x.shape)
        return x + 1

    return ScenarioMap(function, chunk=chunk), traced


def test_map_compiles_once():
    mapped, traced = traced_map(4)
    mapped(np.arange(9.0))
    first = len(traced)
    mapped(np.arange(12.0))
    assert len(traced) == first
    assert set(traced) == {(4,)}


def test_small_numbers_of_scenarios_share_a_program():
    mapped, traced = traced_map(1000)
    for n in (2, 10, 16, 17, 64):
        np.testing.assert_array_equal(mapped(np.arange(n * 1.0)), np.arange(n) + 1.0)
    assert set(traced) == {(16,), (64,)}
    mapped(np.arange(65.0))
    assert traced[-1] == (65,)  # larger ones are worth a program of their own


DEVICES = """
import numpy as np
import jax
from rearl_jax.core import mobil
from rearl_jax.core.batch import ScenarioMap
assert len(jax.local_devices()) == 3
for n in (1, 2, 7, 12, 25):
    x = np.arange(2.0 * n).reshape(2, n)
    result = ScenarioMap(lambda x: (x * 2, x.sum(0)), chunk=4)(x)
    assert (result[0] == x * 2).all() and (result[1] == x.sum(0)).all()
print("done")
"""


def test_map_over_several_devices():
    environment = os.environ | {
        "XLA_FLAGS": "--xla_force_host_platform_device_count=3",
        "JAX_PLATFORMS": "cpu",
    }
    done = subprocess.run([sys.executable, "-c", DEVICES], env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "done", done.stderr


def test_map_refuses_arguments_that_disagree():
    mapped = ScenarioMap(doubled, chunk=4)
    with pytest.raises(ValueError, match=r"same number of scenarios in its last axis, or 1 for all, got \[3, 4\]"):
        mapped({"a": np.zeros((2, 3)), "b": np.zeros(4)})
    with pytest.raises(ValueError, match=r"same number of scenarios"):
        mapped({"a": np.zeros((2, 0)), "b": np.zeros(0)})
    with pytest.raises(ValueError, match="at least one scenario"):
        ScenarioMap(doubled, chunk=0)


def test_options_that_the_compiler_does_not_know_are_left_out():
    x = np.arange(6.0).reshape(2, 3)
    mapped = ScenarioMap(lambda x: 2 * x, chunk=2, options=QUICKLY_COMPILED | {"xla_of_no_version": 1})
    np.testing.assert_array_equal(mapped(x), 2 * x)


def test_chunks_shrink_with_the_number_of_vehicles():
    sizes = [chunk_for(n) for n in (1, 5, 10, 30, 60, 1000)]
    assert sizes == sorted(sizes, reverse=True)
    assert all(16 <= size <= 4096 and size // 16 % 2 == 1 and size % 16 == 0 for size in sizes)


@pytest.mark.thorough
def test_conflicts_among_few_are_settled_as_among_all(monkeypatch):
    model = TrafficModel()
    state, drivers = spawn(jax.random.split(jax.random.key(3), 4), model, n_vehicles=130, density=1.0)

    def drive():
        def advance(before, _):
            after = step(before, drivers, model)
            return after, (after.target_lane, nearest_lane(after.y, model), after.x)

        return jax.jit(lambda: jax.lax.scan(advance, state, length=120)[1])()

    among_few = drive()
    monkeypatch.setattr(conflicts, "is_large", lambda n_vehicles: False)
    among_all = drive()
    target, lane, _ = (np.asarray(values) for values in among_few)
    broken_off = (target != lane)[:-1] & (target == lane)[1:] & (lane[:-1] == lane[1:])
    assert broken_off.any()
    for few, every in zip(among_few, among_all, strict=True):
        np.testing.assert_array_equal(few, every)
