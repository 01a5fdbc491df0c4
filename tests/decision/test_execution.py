"""Effect and duration of an accepted action, and its remains afterwards."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.decision import ExecConfig
from rearl_jax.core.drivers import highway_env_drivers
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import rollout
from rearl_jax.core.state import Controller, make_state
from rearl_jax.decision.execution import (
    MAX_SINCE_LANE_CHANGE,
    accept,
    execute,
    initial_decision_memory,
    record_lane_changes,
)

LEFT, KEEP, RIGHT, FASTER, SLOWER = range(5)
NONE = -1


class Vehicle:
    """One vehicle that is given orders second by second."""

    def __init__(self, model, speed=20.0, lane=1, **options):
        self.model, self.options = model, ExecConfig(**options)
        self.state = make_state(np.array([[100.0]]), np.array([[4.0 * lane]]), np.array([[speed]]), model)
        self.memory = initial_decision_memory(self.state, model)

    def order(self, action, *, is_asked=True):
        admissible = jnp.ones((5, 1, 1), bool)
        orders = accept(jnp.asarray([[action]], jnp.int32), jnp.asarray([[is_asked]]), admissible)
        self.state, self.memory = execute(self.state, self.memory, orders, self.model, self.options)
        return self

    @property
    def is_driven(self):
        return int(self.state.controller[0, 0]) == Controller.META

    @property
    def target(self):
        return float(self.state.desired_speed[0, 0])


@pytest.mark.parametrize(
    ("speed", "action", "target"),
    [(20.0, FASTER, 21.875), (20.0, SLOWER, 15.125), (20.0, KEEP, 20.0), (31.9, FASTER, 32.0), (2.0, KEEP, 5.0)],
)
def test_target_speed(model, speed, action, target):
    vehicle = Vehicle(model, speed=speed).order(action)
    assert vehicle.is_driven
    assert vehicle.target == pytest.approx(target)


def test_keep_and_lane_actions_keep_the_target_of_the_second_before(model):
    vehicle = Vehicle(model, lane=2).order(FASTER)
    assert vehicle.order(KEEP).target == 21.875
    vehicle.order(LEFT)
    assert (vehicle.target, int(vehicle.state.target_lane[0, 0])) == (21.875, 1)
    vehicle.order(KEEP, is_asked=False)
    assert vehicle.order(KEEP).target == 20.0  # not driven in between: the present speed


def test_afterwards_the_target_persists_or_not(model):
    kept = Vehicle(model).order(FASTER).order(NONE, is_asked=False)
    assert (kept.is_driven, kept.target) == (False, 21.875)
    restored = Vehicle(model, persist_target=False).order(FASTER).order(KEEP).order(NONE, is_asked=False)
    assert (restored.is_driven, restored.target) == (False, 20.0)


def test_hold(model):
    vehicle = Vehicle(model, hold=3)
    driven = [vehicle.order(FASTER).is_driven]
    driven += [vehicle.order(NONE, is_asked=False).is_driven for _ in range(4)]
    assert driven == [True, True, True, False, False]
    again = Vehicle(model, hold=3).order(FASTER).order(SLOWER)
    assert again.target == 15.125  # a newer action replaces the one held
    assert not again.order(NONE).is_driven  # asked without a valid answer: back to IDM at once


def test_a_driven_vehicle_keeps_its_distance_with_the_cap_only():
    """Behind a slow leader, told to go faster: IDM's bound brakes, the plain speed controller rams."""
    x, y, speed = np.array([[0.0], [80.0]]), np.full((2, 1), 4.0), np.array([[25.0], [10.0]])
    controller = np.array([[Controller.META], [Controller.IDM]])
    crashed, least = {}, {}
    for follows in (True, False):
        model = TrafficModel(meta_follows=follows, lane_changes=False)
        state = make_state(x, y, speed, model, controller=controller)
        actions = jnp.full((8, 2, 1), FASTER, jnp.int32)
        run = jax.jit(
            lambda state, actions, model=model: rollout(
                state, highway_env_drivers(jnp.full((2, 1), 4.0, jnp.float32)), model, n_seconds=8, actions=actions
            )
        )
        frames = run(state, actions)[1]
        crashed[follows], least[follows] = bool(frames.crashed.any()), float(frames.acceleration.min())
    assert crashed == {True: False, False: True}
    assert -6.0 <= least[True] < -1.0


def test_a_change_is_seen_in_the_memory(model):
    vehicle = Vehicle(model)
    moved = vehicle.state
    object.__setattr__(moved, "y", moved.y + 4.0)
    memory = record_lane_changes(vehicle.memory, moved, model)
    assert int(memory.since_lane_change[0, 0]) == 0
    assert int(record_lane_changes(memory, moved, model).since_lane_change[0, 0]) == 1
    assert int(vehicle.memory.since_lane_change[0, 0]) == MAX_SINCE_LANE_CHANGE
