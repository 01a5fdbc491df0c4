"""Traffic in which every scenario has one effect on, in one compiled program; its drivers in plain loops."""

import functools
import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from rearl_jax.core.batch import QUICKLY_COMPILED
from rearl_jax.core.car_following.idm import IDM
from rearl_jax.core.effects import EFFECTS
from rearl_jax.core.gap_driving import begin_driving
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.state import make_state
from rearl_jax.core.step import step
from tests.core.simulation import default_drivers

MODEL = TrafficModel(n_lanes=3, speed_limit=None, ticks_per_second=10, lane_changes=False, collisions=False)
N_TICKS = 40
DT = 0.1

V0, T, S0, A, B = 30.0, 1.3, 2.5, 1.4, 2.0

# Lane, position [m], speed [m/s], length [m], target lane: a platoon on lane 1 that one vehicle joins from lane 0, slow
# traffic on both sides, a truck.
CARS = (
    (1, 10.0, 22.0, 4.0, 1),
    (1, 34.0, 21.0, 5.0, 1),
    (1, 66.0, 19.0, 12.0, 1),
    (1, 104.0, 18.0, 4.5, 1),
    (0, 86.0, 19.0, 4.5, 1),
    (2, 40.0, 12.0, 5.0, 2),
    (0, 118.0, 15.0, 5.0, 0),
)
N_CARS = len(CARS)
LENGTH = np.array([car[3] for car in CARS])
IS_TRUCK = LENGTH > 10

ON = {
    "reaction_delay": {"delay": 0.5, "own_delay": 0.2},
    "several_leaders": {"weight": 0.4, "relief": 0.7},
    "leader_acceleration": {"gain": 0.6, "reach": 50.0},
    "speed_dependent_time_gap": {"slope": 0.7},
    "variance_driven_time_gap": {"gain": 2.0},
    "resignation": {"gain": 0.8, "memory_time": 4.0},
    "relaxation": {"gap_share": 0.5, "time_gap_share": 0.8, "relaxation_time": 8.0},
    "rear_pressure": {"gain": 0.9, "pressing_time_gap": 1.2},
    "leader_class": {"gain": 0.4},
    "asymmetry": {"closing": 0.15, "opening": 0.25, "scale": 3.0},
    "approach_rate_gain": {"gain": 0.2},
    "gap_relaxation": {"share": 0.8, "relaxation_time": 3.0},
    "actuator_lag": {"time": 0.5},
    "vehicle_limits": {"acceleration_limit": 0.4, "deceleration_limit": 1.0, "jerk_limit": 2.0},
    "lane_friction": {"gain": 0.7, "scale": 4.0},
    "no_undertaking": {"weight": 0.7},
    "lane_desired_speed": {"leftmost": 0.2, "rightmost": -0.3},
    "grade": {"push": -0.5, "start": 60.0, "end": 140.0, "edge": 6.0},
    "speed_limit": {"limit": 20.0, "start": 50.0, "end": 150.0, "edge": 6.0},
    "bend": {"lateral_acceleration": 2.0, "radius": 180.0, "start": 40.0, "end": 160.0, "edge": 9.0},
    "weather": {"slower": 0.2, "wider": 0.3, "onset": 2.0, "ramp": 0.5},
    "closed_course": {"values": (0.4, -0.3, 0.1, -0.2), "lap": 90.0},
    "dependence": {"values": (0.3, -0.2, 0.1)},
    "time_gap_dependence": {"values": (0.5, -0.3, 0.4)},
    "acceleration_noise": {"sd": 0.3, "time": 1.0},
    "perception_noise": {"gap_error": 0.1, "rate_error": 0.02, "time": 5.0},
    "time_gap_variation": {"sd": 0.4, "time": 5.0, "start_share": 0.5},
    "action_points": {"mean_time": 0.5, "threshold": 0.3},
}
"""One value of each parameter at which the effect acts."""

NAMES = tuple(ON)
CURVES = ("dependence", "time_gap_dependence")
N_VALUES = {"dependence": 3, "time_gap_dependence": 3, "closed_course": 4}
"""Number of values of the effects that have several."""

KNOTS = (5.0, 15.0, 25.0)


def is_off(name):
    """Parameters of an effect at which it is off."""
    return {item.name: item.off for item in EFFECTS[name].parameters}


def drivers_with(values, shape, dtype=np.float64, names=NAMES):
    """Drivers whose effects have the given parameters, `{effect: {parameter: [scenarios]}}`."""
    n_scenarios = shape[1]
    effects = []
    for name in names:
        numbers = is_off(name) | values.get(name, {})
        table = np.broadcast_to(np.asarray(numbers.pop("values", 0.0)).T, (N_VALUES.get(name, 1), n_scenarios))[:, None]
        if name in CURVES:
            effects.append(EFFECTS[name](jnp.asarray(table, dtype), jnp.asarray(KNOTS, dtype), "speed"))
            continue
        row = {key: jnp.asarray(np.broadcast_to(value, (1, n_scenarios)), dtype) for key, value in numbers.items()}
        if name in N_VALUES:
            row["values"] = jnp.asarray(table, dtype)
        effects.append(EFFECTS[name](**row))
    drivers = default_drivers(shape, dtype, length=LENGTH[:, None], accel_limit=9.0)
    following = IDM(*(jnp.full((1, 1), value, dtype) for value in (V0, T, S0, A, B)))
    body = replace(drivers.body, is_truck=jnp.asarray(np.broadcast_to(IS_TRUCK[:, None], shape)))
    return replace(drivers, body=body, car_following=following, effects=tuple(effects))


def start(n_scenarios, dtype=np.float64, model=MODEL):
    lane, x, speed, _, target = (np.array(column)[:, None] for column in zip(*CARS, strict=True))
    shape = (N_CARS, n_scenarios)
    same = [np.broadcast_to(values, shape) for values in (x, lane * 4.0, speed, target)]
    return make_state(*same[:3], model, target_lane=same[3], dtype=dtype)


@functools.partial(jax.jit, static_argnames=("model", "n_ticks"), compiler_options=QUICKLY_COMPILED)
def history(state, drivers, model=MODEL, n_ticks=N_TICKS):
    """The state before the first tick and after each, `[1 + n_ticks, ...]`."""
    state = begin_driving(state, drivers, model)

    def advance(before, _):
        after = step(before, drivers, model)
        return after, after

    after = lax.scan(advance, state, length=n_ticks)[1]
    return jax.tree.map(lambda first, rest: jnp.concatenate([first[None], rest]), state, after)


@functools.cache
def all_on():
    """One scenario per effect that is on, the last one without any; NumPy arrays."""
    n_scenarios = len(NAMES) + 1
    values = {}
    for number, name in enumerate(NAMES):
        values[name] = {}
        for key, value in ON[name].items():
            row = np.array([is_off(name)[key]] * n_scenarios, dtype=object)
            row[number] = value
            if key == "values":
                row = [item if isinstance(item, tuple) else (item,) * N_VALUES[name] for item in row]
            values[name][key] = np.array(list(row), float)
    shape = (N_CARS, n_scenarios)
    return jax.tree.map(np.asarray, history(start(n_scenarios), drivers_with(values, shape)))


class Seen:
    """The stimulus of one driver in one recorded state, in plain loops."""

    def __init__(self, states, now, me, scenario):
        x, y, v = states.x[now, :, scenario], states.y[now, :, scenario], states.speed[now, :, scenario]
        v = v * np.cos(states.heading[now, :, scenario])
        lane = np.clip(np.ceil(y / 4.0 - 0.5), 0, 2)
        on_my_lane = [j for j in range(N_CARS) if j != me and abs(y[j] - 4 * lane[me]) <= 3.0]
        ahead = sorted((j for j in on_my_lane if x[j] >= x[me]), key=lambda j: x[j])
        behind = sorted((j for j in on_my_lane if x[j] < x[me]), key=lambda j: -x[j])
        self.time, self.x, self.v, self.lane = now * DT, x[me], v[me], lane[me]
        self.ahead, self.behind = ahead[:3], behind[:1]
        self.speeds = [v[j] for j in self.ahead]
        self.executed = states.acceleration[now, me, scenario]
        self.gap = x[ahead[0]] - x[me] - (LENGTH[ahead[0]] + LENGTH[me]) / 2 if ahead else 1000.0
        self.dv = v[me] - self.speeds[0] if ahead else 0.0
        self.leader_acceleration = states.acceleration[now, ahead[0], scenario] if ahead else 0.0
        if len(ahead) > 1:
            first, second = ahead[:2]
            self.second_gap = self.gap + x[second] - x[first] - (LENGTH[first] + LENGTH[second]) / 2
        if behind:
            self.follower_gap = x[me] - x[behind[0]] - (LENGTH[behind[0]] + LENGTH[me]) / 2
            self.follower_speed = v[behind[0]]
        beside = [v[j] for j in range(N_CARS) if abs(lane[j] - lane[me]) == 1 and abs(x[j] - x[me]) <= 40.0]
        on_left = [j for j in range(N_CARS) if j != me and lane[me] > 0 and abs(y[j] - 4 * (lane[me] - 1)) <= 3.0]
        self.left = min((j for j in on_left if x[j] >= x[me]), key=lambda j: x[j], default=None)
        if self.left is not None:
            self.left_gap = x[self.left] - x[me] - (LENGTH[self.left] + LENGTH[me]) / 2
            self.left_speed = v[self.left]
        self.beside_speed = min(beside, default=1000.0)


def ratio(gap, v, dv, time_gap=T):
    """(s* / s)^2."""
    wanted = S0 + max(0.0, v * time_gap + v * dv / (2 * math.sqrt(A * B)))
    return (wanted / max(gap, 0.5)) ** 2


def idm(seen, *, v0=V0, time_gap=T, gap=None, v=None, dv=None, behind=None):
    """Acceleration of the published model, some of its inputs replaced."""
    v = seen.v if v is None else v
    gap, dv = seen.gap if gap is None else gap, seen.dv if dv is None else dv
    if behind is None:
        behind = ratio(gap, v, dv, time_gap) if seen.ahead else 0.0
    return A * (1 - (v / v0) ** 4 - behind)


def executed(states, name):
    """Acceleration of each tick in the scenario of an effect, `[n_ticks, vehicles]`; who obeys the own lane alone."""
    scenario = NAMES.index(name) if name in NAMES else len(NAMES)
    acceleration = states.acceleration[1:, :, scenario]
    lane = np.clip(np.ceil(states.y[:-1, :, scenario] / 4.0 - 0.5), 0, 2)
    return acceleration, lane == states.target_lane[:-1, :, scenario], scenario
