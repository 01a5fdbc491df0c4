"""Every effect on car following against its equation, tick by tick, in simulated traffic."""

import math

import numpy as np
import pytest

from tests.core.effects import traffic
from tests.core.effects.traffic import (
    DT,
    IS_TRUCK,
    KNOTS,
    N_CARS,
    N_TICKS,
    NAMES,
    ON,
    S0,
    V0,
    A,
    B,
    Seen,
    T,
    idm,
    ratio,
)


@pytest.fixture(scope="module")
def states():
    return traffic.all_on()


def sigmoid(value):
    return 1 / (1 + math.exp(-value))


def inside(x, p):
    return sigmoid((x - p["start"]) / p["edge"]) * sigmoid((p["end"] - x) / p["edge"])


def limited(v0, limit):
    return v0 - math.log1p(math.exp(2 * (v0 - limit))) / 2


def several_leaders(seen, p, past):
    first = ratio(seen.gap, seen.v, seen.dv) if seen.ahead else 0.0
    if len(seen.ahead) < 2:
        return idm(seen)
    second = min(ratio(seen.second_gap / 2, seen.v, seen.v - seen.speeds[1]), 9.0 / A)
    return idm(seen, behind=(1 - p["relief"] * p["weight"]) * first + p["weight"] * second)


def leader_acceleration(seen, p, past):
    return idm(seen) + p["gain"] * seen.leader_acceleration * math.exp(-seen.gap / p["reach"])


def asymmetry(seen, p, past):
    nearer, farther = (p["scale"] * math.tanh(max(rate, 0.0) / p["scale"]) for rate in (seen.dv, -seen.dv))
    return idm(seen) - p["closing"] * nearer - p["opening"] * farther


def variance_driven_time_gap(seen, p, past):
    leader = seen.speeds[0] if seen.speeds else seen.v
    second = seen.speeds[1] if len(seen.speeds) > 1 else leader
    speeds = np.array([seen.v, leader, second, seen.speeds[2] if len(seen.speeds) > 2 else second])
    variation = math.sqrt(speeds.var() + 0.04) / (speeds.mean() + 2.0)
    return idm(seen, time_gap=T * math.exp(p["gain"] * variation))


def resignation(seen, p, past):
    level = past[0].v / V0
    for moment in past:
        level += DT / p["memory_time"] * (moment.v / V0 - level)
    return idm(seen, time_gap=T * math.exp(p["gain"] * (1 - level)))


def relaxation(seen, p, past):
    change = next((k for k in range(len(past) - 1, 0, -1) if past[k].ahead[:1] != past[k - 1].ahead[:1]), None)
    if change is None or not past[change].ahead:
        return idm(seen)
    after = past[change]
    left = math.exp(-(len(past) - 1 - change) * DT / p["relaxation_time"])
    lost = min(max(past[change - 1].gap - after.gap, 0.0), 60.0)
    then = min(max(after.gap / max(after.v, 5.0), 0.25), 9.0)
    time_gap = T + p["time_gap_share"] * min(then - T, 0.0) * left
    return idm(seen, gap=seen.gap + p["gap_share"] * lost * left, time_gap=time_gap)


def rear_pressure(seen, p, past):
    if not seen.behind:
        return idm(seen)
    behind = max(seen.follower_gap, 0.5) / (seen.follower_speed + 2.0)
    pressure = sigmoid((p["pressing_time_gap"] - behind) / 0.25)
    return idm(seen, time_gap=T * math.exp(-p["gain"] * pressure))


def leader_class(seen, p, past):
    is_behind_truck = bool(seen.ahead) and IS_TRUCK[seen.ahead[0]]
    return idm(seen, time_gap=T * math.exp(p["gain"] * is_behind_truck))


def no_undertaking(seen, p, past):
    if seen.left is None or seen.v <= 60 / 3.6:
        return idm(seen)
    own = ratio(seen.gap, seen.v, seen.dv) if seen.ahead else 0.0
    faster_by = seen.v - seen.left_speed
    left = min(ratio(seen.left_gap, seen.v, faster_by), 1 - (seen.v / V0) ** 4 + B / A)
    return idm(seen, behind=own + p["weight"] * sigmoid(2 * faster_by) * max(left - own, 0.0))


def lane_desired_speed(seen, p, past):
    growth = {0: p["leftmost"], 2: p["rightmost"]}.get(int(seen.lane), 0.0)
    return idm(seen, v0=V0 * math.exp(growth))


def speed_limit(seen, p, past):
    share = inside(seen.x, p)
    return idm(seen, v0=V0 - share * (V0 - limited(V0, p["limit"])))


def bend(seen, p, past):
    share = inside(seen.x, p)
    return idm(seen, v0=V0 - share * (V0 - limited(V0, math.sqrt(p["lateral_acceleration"] * p["radius"]))))


def weather(seen, p, past):
    share = sigmoid((seen.time - p["onset"]) / p["ramp"])
    return idm(seen, v0=V0 * math.exp(-p["slower"] * share), time_gap=T * math.exp(p["wider"] * share))


def reaction_delay(seen, p, past):
    ahead, own = (past[max(0, len(past) - 1 - round(p[name] / DT))] for name in ("delay", "own_delay"))
    leader = ahead.v - ahead.dv
    return idm(ahead, v=own.v, dv=own.v - leader)


def gap_relaxation(seen, p, past):
    began, came = 0, -1
    for now in range(1, len(past)):
        is_new = past[now].ahead and (not past[now - 1].ahead or past[now].ahead[0] != past[now - 1].ahead[0])
        if is_new:
            began = came = now
    if not seen.ahead:
        return idm(seen)
    # What is remembered from before the first tick is a tick old in it.
    elapsed = (len(past) - 1 - began) * DT + (DT if came < 0 else 0.0)
    then = min(max((past[began].gap - S0) / max(past[began].v, 2.0), 0.1), 6.0)
    return idm(seen, time_gap=T + p["share"] * (then - T) * math.exp(-elapsed / p["relaxation_time"]))


def actuator_lag(seen, p, past):
    wanted = np.clip(idm(seen), -9.0, 6.0)
    return wanted + (seen.executed - wanted) * p["time"] / (p["time"] + DT)


def vehicle_limits(seen, p, past):
    bounded = np.clip(idm(seen), -p["deceleration_limit"], p["acceleration_limit"])
    return np.clip(bounded, seen.executed - p["jerk_limit"] * DT, seen.executed + p["jerk_limit"] * DT)


def closed_course(seen, p, past):
    values = [*p["values"], p["values"][0]]
    return idm(seen) + np.interp(seen.x % p["lap"], np.linspace(0, p["lap"], len(values)), values)


EQUATIONS = {
    "approach_rate_gain": lambda seen, p, past: idm(seen) - p["gain"] * (seen.dv if seen.ahead else 0.0),
    "gap_relaxation": gap_relaxation,
    "actuator_lag": actuator_lag,
    "vehicle_limits": vehicle_limits,
    "closed_course": closed_course,
    "reaction_delay": reaction_delay,
    "several_leaders": several_leaders,
    "leader_acceleration": leader_acceleration,
    "speed_dependent_time_gap": lambda seen, p, past: idm(
        seen, time_gap=T * math.exp(p["slope"] * (seen.v / 20.0 - 1))
    ),
    "variance_driven_time_gap": variance_driven_time_gap,
    "resignation": resignation,
    "relaxation": relaxation,
    "rear_pressure": rear_pressure,
    "leader_class": leader_class,
    "asymmetry": asymmetry,
    "lane_friction": lambda seen, p, past: (
        idm(seen) - p["gain"] * math.tanh(max(seen.v - seen.beside_speed, 0.0) / p["scale"])
    ),
    "no_undertaking": no_undertaking,
    "lane_desired_speed": lane_desired_speed,
    "grade": lambda seen, p, past: idm(seen) + p["push"] * inside(seen.x, p),
    "speed_limit": speed_limit,
    "bend": bend,
    "weather": weather,
    "dependence": lambda seen, p, past: idm(seen) + np.interp(seen.v, KNOTS, p["values"]),
    "time_gap_dependence": lambda seen, p, past: idm(
        seen, time_gap=T * math.exp(np.interp(seen.v, KNOTS, p["values"]))
    ),
}


def expected(states, name, scenario, equation, p):
    wanted = np.zeros((N_TICKS, N_CARS))
    for me in range(N_CARS):
        past = []
        for now in range(N_TICKS):
            past.append(Seen(states, now, me, scenario))
            wanted[now, me] = np.clip(equation(past[-1], p, past), -9.0, 6.0)
    return wanted


def test_without_effects_drivers_follow_the_published_model(states):
    found, counts, scenario = traffic.executed(states, "none")
    wanted = expected(states, "none", scenario, lambda seen, p, past: idm(seen), {})
    np.testing.assert_allclose(found[counts], wanted[counts], rtol=1e-9, atol=1e-9)
    assert np.ptp(found) > 1.0


@pytest.mark.parametrize("name", EQUATIONS)
def test_acceleration_is_that_of_the_equation(states, name):
    found, counts, scenario = traffic.executed(states, name)
    wanted = expected(states, name, scenario, EQUATIONS[name], ON[name])
    plain = expected(states, name, scenario, lambda seen, p, past: idm(seen), {})
    # It acts, and on more than one tick of more than one vehicle.
    assert (np.abs(wanted - plain)[counts] > 0.01).sum() > 20, np.abs(wanted - plain).max()
    np.testing.assert_allclose(found[counts], wanted[counts], rtol=1e-8, atol=1e-8)


def test_trajectories_part_only_where_an_effect_is_on(states):
    without = states.x[-1, :, -1]
    for number, name in enumerate(NAMES):
        assert np.abs(states.x[-1, :, number] - without).max() > 0.02, name


def test_a_change_of_the_leader_is_remembered(states):
    history = states.memory.leader_history
    scenario = len(NAMES)
    leader = history.leader[:, 2, scenario]
    assert leader[1] == 3  # the vehicle ahead on the lane
    assert leader[-1] == 4  # the one that has come in between
    change = int(np.flatnonzero(leader == 4)[0])
    assert history.time_since_change[change, 2, scenario] == 0
    np.testing.assert_allclose(
        history.time_since_change[change:, 2, scenario], DT * np.arange(N_TICKS + 1 - change), atol=1e-12
    )
    gap = history.gap[:, 2, scenario]
    assert gap[change] < gap[change - 1] - 5
    assert history.gap_lost[-1, 2, scenario] == gap[change - 1] - gap[change]
    assert (history.time_since_change[:, 0, scenario] == 60.0).all()
