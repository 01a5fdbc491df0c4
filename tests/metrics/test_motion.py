"""Lane changes and jerk, of fixed vehicles and of recordings whose slots change hands."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.metrics.motion import jerk_statistics, lane_changes, previous_values, rate_of_change
from tests.metrics.conftest import make_scene


@partial(jax.jit, static_argnums=(2, 3))
def jerk_from_speed(speed, crashed, dt, threshold, track_id):
    return jerk_statistics(rate_of_change(speed, track_id, dt), crashed, track_id, dt, threshold)


def jerk_of(scene, dt, threshold, track_id):
    return jerk_from_speed(jnp.asarray(scene["speed"]), jnp.asarray(scene["crashed"]), dt, threshold, track_id)


def test_slots_do_not_matter_where_vehicles_are_known():
    scene = make_scene(21, recorded=True)
    order = np.random.default_rng(0).permuted(np.tile(np.arange(10), (12, 1)), axis=1)
    assert (order[1:] != order[:-1]).any()
    mixed = {name: np.take_along_axis(values, order, axis=1) for name, values in scene.items()}
    found = [jerk_of(s, 1.0, 2.5, jnp.asarray(s["track_id"])) for s in (scene, mixed)]
    assert int(found[0].rms.count) > 40
    assert float(found[0].rms.value) == pytest.approx(float(found[1].rms.value), rel=1e-12)


def test_a_lane_change_into_the_crash_frame_does_not_count():
    lane = jnp.asarray([[0, 0], [1, 1], [1, 2]])
    crashed = jnp.asarray([[False, False], [False, True], [False, True]])
    found = lane_changes(lane, crashed, None, jnp.dtype("float64"))
    assert float(found.rate.value) == pytest.approx(1 / 6), "the denominator counts all frames"
    assert (float(found.observed_rate.value), int(found.observed_rate.count)) == (0.5, 2)


def test_jerk_of_known_motions(dtype):
    t = np.arange(8.0)[:, None]
    crashed = np.zeros((8, 2), bool)
    uniform = jerk_of({"speed": (5 + 2 * t + np.zeros((1, 2))).astype(dtype), "crashed": crashed}, 1.0, 2.5, None)
    assert (float(uniform.rms.value), float(uniform.share.value), int(uniform.rms.count)) == (0, 0, 12)
    growing = {"speed": (1.5 * t**2 + np.zeros((1, 2))).astype(dtype), "crashed": crashed}
    assert float(jerk_of(growing, 1.0, 2.5, None).rms.value) == pytest.approx(3)
    assert float(jerk_of(growing, 1.0, 2.5, None).share.value) == 1
    assert float(jerk_of(growing, 1.0, 3.5, None).share.value) == 0
    assert float(jerk_of(growing, 0.5, 2.5, None).rms.value) == pytest.approx(12)
    growing["crashed"] = crashed.copy()
    growing["crashed"][5:, 0] = True
    assert int(jerk_of(growing, 1.0, 2.5, None).rms.count) == 9


def test_previous_values_follow_the_vehicle():
    ids = jnp.asarray([[7, 8, 9], [9, 7, 5]])
    previous, found = previous_values(jnp.asarray([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), ids)
    assert found.tolist() == [[True, True, False]]
    assert previous.tolist() == [[3, 1, 0]]
