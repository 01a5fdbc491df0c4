"""Random traffic for the tests of the core, driven by the slow reference and recorded tick by tick.

After every tick the reference's numbers are rounded to float32. So a state can be handed to the core in either type
without an error of its own, and errors cannot add up from tick to tick.
"""

import copy
import dataclasses
from dataclasses import dataclass

import numpy as np

from tests.core import reference
from tests.core.reference import IDM, META, Car, Events, Road

SINGLE = ("x", "y", "speed", "heading", "desired", "acceleration")
PARAMETERS = (
    *("max_accel", "comfort_decel", "jam_spacing", "time_gap", "exponent", "accel_limit", "politeness"),
    *("gain_threshold", "safe_decel", "length", "width"),
)

ROAD = Road()
WIDE = Road(n_lanes=8, width=3.5, length=400.0, speed_limit=None, dt=1 / 10)
NARROW = Road(n_lanes=1)
#: For float32, whose positions are 1 mm apart at the end of a road of 10 km.
SHORT = Road(length=300.0)


def draw_driver(rng, *, politeness=False):
    """Parameters of one driver and his vehicle, each different from everybody else's."""
    return {
        "max_accel": rng.uniform(1.5, 4.0),
        "comfort_decel": rng.uniform(2.0, 6.0),
        "jam_spacing": rng.uniform(7.0, 12.0),
        "time_gap": rng.uniform(0.6, 2.0),
        "exponent": rng.uniform(3.5, 4.5),
        "accel_limit": rng.uniform(4.0, 8.0),
        "politeness": rng.choice([0.0, 0.3, 1.0, -0.5]) if politeness else 0.0,
        "gain_threshold": rng.uniform(0.0, 0.5),
        "safe_decel": rng.uniform(1.0, 4.0),
        "delay": rng.choice([0.4, 1.0]),
        "changes_lanes": rng.uniform() < 0.95,
        "length": rng.uniform(4.0, 8.0),
        "width": rng.uniform(1.6, 2.6),
        "collides": rng.uniform() < 0.9,
    }


def draw_cars(kind, n_cars, road, rng):
    """Cars of a random scene.

    road: as highway-env places them, with desired speeds far apart. stress: anywhere, at any speed and angle, in any
    order. meta: half of the cars follow meta-actions. level: groups of cars side by side. start, end: around the
    start and the end of the road. pile: overlapping.
    """
    if kind == "road":
        gaps = rng.uniform(0.9, 1.1, n_cars) * (12 + 22) * np.exp(-5 * road.n_lanes / 40) / 2
        cars = []
        for x in np.cumsum(gaps):
            y, speed = road.centre(rng.integers(road.n_lanes)), rng.uniform(21, 24)
            cars.append(Car(x, y, speed, desired=rng.uniform(16, 32), exponent=rng.uniform(3.5, 4.5)))
        return cars
    span = 14.0 * n_cars * 4 / road.n_lanes**0.5 / 2
    cars = []
    for _ in range(n_cars):
        lane = rng.integers(road.n_lanes)
        car = Car(
            rng.uniform(5, span),
            road.centre(lane) + rng.normal(0, 0.6),
            rng.uniform(-0.5, 35.0) if rng.uniform() < 0.9 else rng.uniform(0, 2),
            heading=rng.normal(0, 0.08),
            desired=0.0 if road is WIDE and rng.uniform() < 0.05 else rng.uniform(8, 35),
            kind=META if kind == "meta" and rng.uniform() < 0.5 else IDM,
            **draw_driver(rng, politeness=road is WIDE),
        )
        cars.append(car)
    if kind == "level":
        places = np.repeat(rng.uniform(5, span, n_cars), 3)[:n_cars]
        for car, x in zip(cars, rng.permutation(places), strict=True):
            car.x, car.speed, car.heading = x, rng.choice([15.0, 20.0]), 0.0
    if kind in ("start", "end"):
        for car in cars:
            car.x -= 0.5 * span if kind == "start" else 0.6 * span - road.length
    if kind == "pile":
        for car in cars:
            car.x, car.y = rng.uniform(5, 6.0 * n_cars / road.n_lanes), rng.uniform(-1, 4 * road.n_lanes - 3)
            car.speed = rng.choice([0.0, rng.uniform(-2, 12)])
    return cars


def car_on(lane, x, speed, *, road=ROAD, target=None, **others):
    """A car in the middle of a lane."""
    target = lane if target is None else target
    return Car(float(x), road.centre(lane), float(speed), lane=lane, target=target, **others)


def prepare(cars, road, rng):
    """Lanes, target lanes, timers: some cars are already changing, some crashed, timers anywhere."""
    for car in cars:
        car.lane = car.target = road.nearest(car.y)
        if rng.uniform() < 0.25:
            car.target = int(np.clip(car.lane + rng.choice([-2, -1, 1, 2]), 0, road.n_lanes - 1))
        car.timer = rng.uniform(0, 1.2)
        car.crashed = bool(rng.uniform() < 0.03)
        if car.kind == META:
            car.desired = road.levels[rng.integers(len(road.levels))]


def to_single(cars):
    """Rounds what the cars carry to float32, in place."""
    for car in cars:
        for name in SINGLE:
            setattr(car, name, float(np.float32(getattr(car, name))))
        if car.push is not None:
            car.push = tuple(float(np.float32(part)) for part in car.push)


def photograph(cars, road):
    """All numbers of all cars, by name, as arrays [cars]."""
    names = [f.name for f in dataclasses.fields(Car) if f.name not in ("push", "kind")]
    picture = {name: np.array([getattr(car, name) for car in cars]) for name in names}
    picture["is_meta"] = np.array([car.kind == META for car in cars])
    picture["is_pushed"] = np.array([car.push is not None for car in cars])
    picture["push_x"], picture["push_y"] = np.array([car.push or (0.0, 0.0) for car in cars]).T
    picture["ticks"] = np.array([reference.ticks_to_exceed(car.timer, car.delay, road.dt) for car in cars], np.int32)
    periods = {car.delay: reference.ticks_to_exceed(0.0, car.delay, road.dt) for car in cars}
    picture["period"] = np.array([periods[car.delay] for car in cars], np.int32)
    return picture


@dataclass
class Recording:
    """States before and after every tick of several scenes, [cars, ticks of all scenes], and what happened in them.

    `commanded` are the states before meta-actions were given (at whole seconds only), `actions` those actions.
    """

    before: dict[str, np.ndarray]
    after: dict[str, np.ndarray]
    commanded: dict[str, np.ndarray]
    told: dict[str, np.ndarray]
    actions: np.ndarray
    events: Events
    n_ticks: int
    road: Road


def stack(pictures):
    return {name: np.stack([p[name] for p in pictures], axis=-1) for name in pictures[0]}


def record(kinds, n_cars, road, *, n_scenes, n_ticks, seed):
    """Recording of `n_scenes` scenes of each kind."""
    before, after, commanded, told, actions, events = [], [], [], [], [], Events()
    for number, kind in enumerate(kinds):
        for scene in range(n_scenes):
            rng = np.random.default_rng([seed, number, scene])
            cars = draw_cars(kind, n_cars, road, rng)
            prepare(cars, road, rng)
            for car in cars:
                for name in PARAMETERS:
                    setattr(car, name, float(np.float32(getattr(car, name))))
            for now in range(n_ticks):
                to_single(cars)
                if now % round(1 / road.dt) == 0:
                    orders = rng.integers(5, size=n_cars)
                    commanded.append(photograph(cars, road))
                    for car, order in zip(cars, orders, strict=True):
                        if car.kind == META:
                            reference.command(car, order, road)
                    told.append(photograph(cars, road))
                    actions.append(orders)
                before.append(photograph(cars, road))
                events.add(reference.tick(cars, road))
                after.append(photograph(cars, road))
    parts = (stack(before), stack(after), stack(commanded), stack(told), np.stack(actions, axis=-1))
    return Recording(*parts, events, n_ticks, road)


def drive(cars, road, n_ticks, **stages):
    """Copies of the cars after each of `n_ticks` ticks, without rounding, and what happened."""
    cars, events, pictures = copy.deepcopy(cars), Events(), []
    for _ in range(n_ticks):
        events.add(reference.tick(cars, road, **stages))
        pictures.append(photograph(cars, road))
    return pictures, events
