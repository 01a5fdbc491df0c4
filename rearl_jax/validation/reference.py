"""Reference simulation in highway-env: builds a scene, simulates it tick by tick, and records it. The only module that
imports highway-env.

Run in worker processes (see `workers`), never imported by the main process: in workers the arithmetic of NumPy
is chosen by an environment variable before NumPy is loaded.

Nothing of highway-env is replaced. The road is ticked directly (`Road.act`, `Road.step`) as `AbstractEnv._simulate`
does, so that observations and rewards, which do not act on the traffic, need not be computed.
"""

from typing import Any, cast

import numpy as np
from highway_env.envs.common.action import DiscreteMetaAction
from highway_env.envs.highway_env import HighwayEnv
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import ControlledVehicle, MDPVehicle

from rearl_jax.validation.records import Recorded, Start, Tracks
from rearl_jax.validation.scenarios import TICKS_PER_SECOND, Injection, Scenario, Source

DENSITY = 2.0
"""vehicles_density of the scenes that highway-env places itself. Source: REARL (Bi et al.), as DiLu."""

IDLE = 1
"""Meta-action of vehicles that take none."""

ATTRIBUTES = {
    "max_accel": "COMFORT_ACC_MAX",
    "comfort_decel": "COMFORT_ACC_MIN",
    "jam_spacing": "DISTANCE_WANTED",
    "time_gap": "TIME_WANTED",
    "accel_exponent": "DELTA",
    "accel_limit": "ACC_MAX",
    "politeness": "POLITENESS",
    "gain_threshold": "LANE_CHANGE_MIN_ACC_GAIN",
    "safe_decel": "LANE_CHANGE_MAX_BRAKING_IMPOSED",
    "length": "LENGTH",
    "width": "WIDTH",
    "changes_lanes": "enable_lane_change",
    "collides": "check_collisions",
}
"""Our names of the parameters and highway-env's. Its comfortable deceleration is negative."""


def simulate(scenario: Scenario, *, nudged: bool = False) -> Recorded:
    """The scene as highway-env drives it.

    Args:
        scenario: The scene.
        nudged: Move every vehicle forward by one unit in the last place before the first tick. This shows how
            highway-env amplifies the smallest possible difference.

    Raises:
        ValueError: If a result is not finite.
    """
    road = _BUILDERS[scenario.source](scenario)
    # highway-env annotates a list of any vehicles; here all of them steer themselves.
    vehicles = cast("list[ControlledVehicle]", road.vehicles)
    if nudged:
        for vehicle in vehicles:
            vehicle.position[0] = np.nextafter(vehicle.position[0], np.inf)
            vehicle.on_state_update()
    start = _describe(vehicles)
    actions = np.full((scenario.n_seconds, len(vehicles)), IDLE, np.int8)
    actions[:, start.is_meta] = np.array(scenario.actions).reshape(scenario.n_seconds, -1)
    names = DiscreteMetaAction.ACTIONS_ALL
    frames = [_frame(vehicles)]
    for row in actions:
        for vehicle, is_meta, action in zip(vehicles, start.is_meta, row, strict=True):
            if is_meta:
                vehicle.act(names[int(action)])
        for _ in range(TICKS_PER_SECOND):
            road.act()
            road.step(1 / TICKS_PER_SECOND)
            frames.append(_frame(vehicles))
    return Recorded(start=start, actions=actions, tracks=_tracks(frames))


def _spawn_on_road(scenario: Scenario) -> Road:
    """A bare road with IDM vehicles placed as `HighwayEnv._create_vehicles` places them."""
    road = _straight_road(scenario)
    for _ in range(scenario.n_idm):
        vehicle = cast("IDMVehicle", IDMVehicle.create_random(road, spacing=1 / DENSITY))
        vehicle.randomize_behavior()
        road.vehicles.append(vehicle)
    return road


def _reset_env(scenario: Scenario) -> Road:
    """The road of `highway-v0` after its reset."""
    single = {"type": "DiscreteMetaAction", "target_speeds": list(scenario.speed_levels)}
    many = {"type": "MultiAgentAction", "action_config": single}
    env = HighwayEnv(
        config={
            "action": many if scenario.n_meta > 1 else single,
            "controlled_vehicles": scenario.n_meta,
            "vehicles_count": scenario.n_idm,
            "vehicles_density": DENSITY,
            "simulation_frequency": TICKS_PER_SECOND,
        }
    )
    env.reset(seed=scenario.seed)
    return env.road


def _inject(scenario: Scenario) -> Road:
    """A bare road with the vehicles of the scenario."""
    road, injection = _straight_road(scenario), scenario.injection
    if injection is None:
        raise ValueError(f"scene {scenario.index} of {scenario.set_name} has no vehicles to inject")
    for number in range(scenario.n_vehicles):
        road.vehicles.append(_injected_vehicle(road, injection, number, scenario.speed_levels))
    return road


def _injected_vehicle(
    road: Road, injection: Injection, number: int, speed_levels: tuple[float, ...]
) -> ControlledVehicle:
    position = [injection.x[number], injection.y[number]]
    heading, speed = injection.heading[number], injection.speed[number]
    desired = injection.desired_speed[number]
    if injection.is_meta[number]:
        vehicle = MDPVehicle(road, position, heading, speed, target_speed=desired, target_speeds=list(speed_levels))
    else:
        # highway-env annotates a number, but the default is None.
        timer: Any = None if injection.timer is None else injection.timer[number]
        vehicle = IDMVehicle(road, position, heading, speed, target_speed=desired, timer=timer)
    for name, values in injection.parameters:
        value = values[number]
        setattr(vehicle, ATTRIBUTES[name], -value if name == "comfort_decel" else value)
    vehicle.diagonal = np.sqrt(vehicle.LENGTH**2 + vehicle.WIDTH**2)
    return vehicle


_BUILDERS = {Source.road: _spawn_on_road, Source.env: _reset_env, Source.injected: _inject}


def _straight_road(scenario: Scenario) -> Road:
    network = RoadNetwork.straight_road_network(4, speed_limit=30)
    # highway-env annotates NumPy's old generator, but its environments pass the new one.
    random: Any = np.random.default_rng(scenario.seed)
    return Road(network=network, np_random=random, record_history=False)


def _describe(vehicles: list[ControlledVehicle]) -> Start:
    """Start of the core's run, read from the vehicles that highway-env has built, not from the scenario."""

    def column(values: list, kind: type = np.float64) -> np.ndarray:
        return np.array(values, kind)

    def parameter(name: str) -> np.ndarray:
        attribute, kind = ATTRIBUTES[name], bool if name in ("changes_lanes", "collides") else np.float64
        # A vehicle with meta-actions has no parameters of IDM and MOBIL; they are not used.
        default = True if kind is bool else getattr(IDMVehicle, attribute)
        values = column([getattr(vehicle, attribute, default) for vehicle in vehicles], kind)
        return -values if name == "comfort_decel" else values

    return Start(
        x=column([vehicle.position[0] for vehicle in vehicles]),
        y=column([vehicle.position[1] for vehicle in vehicles]),
        heading=column([vehicle.heading for vehicle in vehicles]),
        speed=column([vehicle.speed for vehicle in vehicles]),
        desired_speed=column([vehicle.target_speed for vehicle in vehicles]),
        target_lane=column([vehicle.target_lane_index[2] for vehicle in vehicles], np.int8),
        timer=column([getattr(vehicle, "timer", 0.0) for vehicle in vehicles]),
        is_meta=column([isinstance(vehicle, MDPVehicle) for vehicle in vehicles], bool),
        **{name: parameter(name) for name in ATTRIBUTES},
    )


def _frame(vehicles: list[ControlledVehicle]) -> list[tuple]:
    """For each vehicle the fields of `Tracks`, in their order."""
    return [(*v.position, v.heading, v.speed, v.lane_index[2], v.target_lane_index[2], v.crashed) for v in vehicles]


def _tracks(frames: list[list[tuple]]) -> Tracks:
    columns = np.moveaxis(np.array(frames, np.float64), -1, 0)
    if not np.isfinite(columns).all():
        raise ValueError("a position, heading or speed is not finite")
    x, y, heading, speed, lane, target_lane, crashed = columns
    lane, target_lane = lane.astype(np.int8), target_lane.astype(np.int8)
    return Tracks(x, y, heading, speed, lane, target_lane, crashed.astype(bool))
