"""highway-env's straight-highway traffic written a second time: plain Python, one scenario, one vehicle after the
other.

Everything is float64 and follows the behaviour of highway-env 1.12.1 step by step, with its float timers and its
sequential decisions in list order. Nothing is shared with the package; slow on purpose.
"""

import math
from dataclasses import dataclass, field

IDM, META = "idm", "meta"
LEFT, IDLE, RIGHT, FASTER, SLOWER = range(5)


@dataclass
class Road:
    n_lanes: int = 4
    width: float = 4.0
    length: float = 10_000.0
    speed_limit: float | None = 30.0
    dt: float = 1 / 15
    levels: tuple[float, ...] = tuple(5 + 3.375 * k for k in range(9))

    def centre(self, lane):
        return lane * self.width

    def nearest(self, y):
        return min(range(self.n_lanes), key=lambda k: abs(y - self.centre(k)))

    def is_reachable(self, car, lane):
        if not 0 <= car.x < self.length + 5:
            return False
        return abs(car.y - self.centre(lane)) <= 2 * self.width

    def is_on(self, car, lane):
        if not -5 <= car.x < self.length + 5:
            return False
        return abs(car.y - self.centre(lane)) <= self.width / 2 + 1


@dataclass
class Car:
    x: float
    y: float
    speed: float
    heading: float = 0.0
    lane: int = 0
    target: int = 0
    desired: float = 25.0
    timer: float = 0.0
    kind: str = IDM
    # Driver.
    max_accel: float = 3.0
    comfort_decel: float = 5.0
    jam_spacing: float = 10.0
    time_gap: float = 1.5
    exponent: float = 4.0
    accel_limit: float = 6.0
    politeness: float = 0.0
    gain_threshold: float = 0.2
    safe_decel: float = 2.0
    delay: float = 1.0
    changes_lanes: bool = True
    # Body.
    length: float = 5.0
    width: float = 2.0
    collides: bool = True
    # What a tick leaves behind.
    acceleration: float = 0.0
    steering: float = 0.0
    crashed: bool = False
    push: tuple[float, float] | None = None
    #: How far the collision tests of the last tick were from another outcome [m].
    margin: float = math.inf

    @property
    def direction(self):
        return math.cos(self.heading), math.sin(self.heading)

    @property
    def velocity(self):
        return self.speed * math.cos(self.heading), self.speed * math.sin(self.heading)


@dataclass
class Events:
    changes: int = 0
    lefts: int = 0
    aborts: int = 0
    crashes: int = 0
    pushes: int = 0
    #: Aborts that an unordered rule (everybody sees the targets before the tick) would judge otherwise.
    by_order: int = 0
    crossings: int = field(default=0)

    def add(self, other):
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) + value)


def away_from_zero(value):
    if abs(value) > 0.01:
        return value
    return 0.01 if value >= 0 else -0.01


def clip(value, low, high):
    return max(low, min(high, value))


def ticks_to_exceed(timer, delay, dt):
    """Number of times that dt must be added to a float timer until it exceeds the delay."""
    ticks = 0
    while not timer > delay:
        timer += dt
        ticks += 1
    return ticks


def neighbours(cars, me, lane, road):
    front = rear = None
    for car in cars:
        if car is me or not road.is_on(car, lane):
            continue
        if car.x >= me.x:
            if front is None or car.x <= front.x:
                front = car
        elif rear is None or car.x > rear.x:
            rear = car
    return front, rear


def wanted_gap(ego, front, driver):
    (ux, uy), (vx, vy), (wx, wy) = ego.direction, ego.velocity, front.velocity
    closing = (vx - wx) * ux + (vy - wy) * uy
    braking = 2 * math.sqrt(driver.max_accel * driver.comfort_decel)
    return driver.jam_spacing + ego.speed * driver.time_gap + ego.speed * closing / braking


def follow(ego, front, driver, road):
    """Acceleration of `ego` behind `front` as judged by `driver`."""
    if ego is None:
        return 0.0
    desired = ego.desired
    if road.speed_limit is not None:
        desired = clip(desired, 0.0, road.speed_limit)
    ratio = max(ego.speed, 0.0) / abs(away_from_zero(desired))
    value = driver.max_accel * (1 - ratio**driver.exponent)
    if front is not None:
        share = wanted_gap(ego, front, driver) / away_from_zero(front.x - ego.x)
        value -= driver.max_accel * share**2
    return value


def wants_lane(cars, me, lane, road):
    """MOBIL: whether `me` likes `lane` better than its own."""
    new_front, new_rear = neighbours(cars, me, lane, road)
    old_front, old_rear = neighbours(cars, me, me.lane, road)
    imposed = follow(new_rear, me, me, road)
    if imposed < -me.safe_decel:
        return False
    gain = follow(me, new_front, me, road) - follow(me, old_front, me, road)
    others = imposed - follow(new_rear, new_front, me, road)
    others += follow(old_rear, old_front, me, road) - follow(old_rear, me, me, road)
    return not gain + me.politeness * others < me.gain_threshold


def is_in_the_way(me, other, target):
    """True if `other`, now on its way to `target`, makes `me` give up the same lane."""
    if other is me or other.lane == me.target or target != me.target:
        return False
    return 0 < other.x - me.x < wanted_gap(me, other, me)


def decide(cars, me, road, old_targets, events):
    if me.lane != me.target:
        blocked = any(is_in_the_way(me, other, other.target) for other in cars)
        at_once = any(is_in_the_way(me, other, t) for other, t in zip(cars, old_targets, strict=True))
        events.by_order += blocked != at_once
        if blocked:
            me.target = me.lane
            events.aborts += 1
        return
    if not me.timer > me.delay:
        return
    me.timer = 0.0
    for lane in (me.lane - 1, me.lane + 1):
        if not 0 <= lane < road.n_lanes or not road.is_reachable(me, lane) or abs(me.speed) < 1:
            continue
        if wants_lane(cars, me, lane, road):
            me.target = lane
    events.changes += me.target != me.lane
    events.lefts += me.target < me.lane


def steer(me, road):
    speed = away_from_zero(me.speed)
    sideways = -(me.y - road.centre(me.target)) / 0.6
    heading = clip(math.asin(clip(sideways / speed, -1, 1)), -math.pi / 4, math.pi / 4)
    error = (heading - me.heading + math.pi) % (2 * math.pi) - math.pi
    turn = clip(me.length / 2 / speed * error / 0.2, -1, 1)
    return clip(math.atan(2 * math.tan(math.asin(turn))), -math.pi / 3, math.pi / 3)


def act(cars, road, events):
    old_targets = [car.target for car in cars]
    for me in cars:
        if me.kind == META:
            me.steering = steer(me, road)
            me.acceleration = (me.desired - me.speed) / 0.6
        elif not me.crashed:
            if me.changes_lanes:
                decide(cars, me, road, old_targets, events)
            me.steering = steer(me, road)
            value = follow(me, neighbours(cars, me, me.lane, road)[0], me, road)
            if me.lane != me.target:
                value = min(value, follow(me, neighbours(cars, me, me.target, road)[0], me, road))
            me.acceleration = clip(value, -me.accel_limit, me.accel_limit)


def move(me, road):
    me.timer += road.dt
    if me.crashed:
        me.steering, me.acceleration = 0.0, -me.speed
    if me.speed > 40:
        me.acceleration = min(me.acceleration, 40 - me.speed)
    elif me.speed < -40:
        me.acceleration = max(me.acceleration, -40 - me.speed)
    slip = math.atan(math.tan(me.steering) / 2)
    me.x += me.speed * math.cos(me.heading + slip) * road.dt
    me.y += me.speed * math.sin(me.heading + slip) * road.dt
    if me.push is not None:
        me.x, me.y = me.x + me.push[0], me.y + me.push[1]
        me.crashed, me.push = True, None
    me.heading += me.speed * math.sin(slip) / (me.length / 2) * road.dt
    me.speed += me.acceleration * road.dt
    me.lane = road.nearest(me.y)


def corners(car):
    c, s = car.direction
    places = []
    for along, across in ((-1, -1), (-1, 1), (1, 1), (1, -1)):
        a, b = along * car.length / 2, across * car.width / 2
        places.append((car.x + c * a - s * b, car.y + s * a + c * b))
    return places


def edge_normals(polygon):
    normals = []
    for (x1, y1), (x2, y2) in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        size = math.hypot(x2 - x1, y2 - y1)
        normals.append((-(y2 - y1) / size, (x2 - x1) / size))
    return normals


def gap_between(low, high, other_low, other_high):
    return other_low - high if low < other_low else low - other_high


def test_pair(one, other, road):
    """Overlap of two cars: whether there is one, the shift of `one` that parts them, and the margin of the answer."""
    bound = (math.hypot(one.length, one.width) + math.hypot(other.length, other.width)) / 2
    beyond = math.hypot(one.x - other.x, one.y - other.y) - bound - one.speed * road.dt
    first, second = corners(one), corners(other)
    (vx, vy), (wx, wy) = one.velocity, other.velocity
    gaps, shifts = [], []
    for nx, ny in edge_normals(first) + edge_normals(second):
        spans = [sorted(nx * x + ny * y for x, y in polygon) for polygon in (first, second)]
        low, high, other_low, other_high = spans[0][0], spans[0][-1], spans[1][0], spans[1][-1]
        now = gap_between(low, high, other_low, other_high)
        drift = (nx * (vx - wx) + ny * (vy - wy)) * road.dt
        low, high = (low + drift, high) if drift < 0 else (low, high + drift)
        later = gap_between(low, high, other_low, other_high)
        side = (one.x - other.x) * nx + (one.y - other.y) * ny
        size = abs(later) if side > 0 else -abs(later)
        gaps.append((now, later))
        shifts.append((abs(later), size * nx, size * ny, abs(side)))
    now, later = (max(values) for values in zip(*gaps, strict=True))
    best = min(shifts, key=lambda shift: shift[0])
    rivals = [s[0] - best[0] for s in shifts if math.hypot(s[1] - best[1], s[2] - best[2]) > 1e-5]
    margin = min(abs(now), abs(later))
    if later <= 0:
        margin = min([margin, best[3], *rivals])
    if now <= 0 or later <= 0:
        margin = min(margin, abs(beyond))
    if beyond > 0:
        return False, None, margin
    return now <= 0, best[1:3] if later <= 0 else None, margin


test_pair.__test__ = False  # no test of pytest's


def collide(cars, road, events):
    before = [car.crashed for car in cars]
    for me in cars:
        me.margin = math.inf
    for i, one in enumerate(cars):
        for other in cars[i + 1 :]:
            if not (one.collides or other.collides) or math.hypot(one.x - other.x, one.y - other.y) > 30:
                continue
            overlaps, shift, margin = test_pair(one, other, road)
            if shift is not None:
                one.push = (shift[0] / 2, shift[1] / 2)
                other.push = (-shift[0] / 2, -shift[1] / 2)
                events.pushes += 1
            if overlaps:
                one.crashed = other.crashed = True
            one.margin, other.margin = min(one.margin, margin), min(other.margin, margin)
    events.crashes += sum(car.crashed and not was for car, was in zip(cars, before, strict=True))


def tick(cars, road, *, lane_changes=True, collisions=True):
    """Moves all cars on by one tick, in place; returns what happened."""
    events = Events()
    before = [(car.lane, car.changes_lanes) for car in cars]
    for car in cars:
        car.changes_lanes = car.changes_lanes and lane_changes
    act(cars, road, events)
    for car, (_, changes_lanes) in zip(cars, before, strict=True):
        car.changes_lanes = changes_lanes
        move(car, road)
    if collisions:
        collide(cars, road, events)
    events.crossings = sum(car.lane != lane for car, (lane, _) in zip(cars, before, strict=True))
    return events


def command(car, action, road):
    """Gives a META car its meta-action."""
    if action in (FASTER, SLOWER):
        low, high, last = road.levels[0], road.levels[-1], len(road.levels) - 1
        level = int(clip(round((car.speed - low) / (high - low) * last), 0, last))
        car.desired = road.levels[int(clip(level + (1 if action == FASTER else -1), 0, last))]
    elif action in (LEFT, RIGHT):
        lane = int(clip(car.target + (1 if action == RIGHT else -1), 0, road.n_lanes - 1))
        if road.is_reachable(car, lane):
            car.target = lane
