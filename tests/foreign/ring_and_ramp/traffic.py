"""The two sites and the traffic on them: inflow, car following, lateral movement and the true record.

Sites (drawn by seed)
    ramp   open two-lane motorway of 2600 m with an on-ramp; the merge section 1750 to 2050 m is the bottleneck.
           Queues and stop-and-go waves grow upstream of it.
    ring   closed two-lane motorway of 2400 m with a solid line (no lane changes); in each lane one pace vehicle
           changes its speed every 35 to 80 s, a moving bottleneck for those behind it.
Sources: Cassidy and Bertini 1999 (merge bottlenecks), Sugiyama et al. 2008 and Tadaki et al. 2013 (ring
experiments), Jiang et al. 2014 (pace car), Treiber, Kesting and Helbing 2006 (perception errors).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .effects import Behaviour, State
from .lanes import LaneChanges
from .models import Array, Fleet, Ints, base_acceleration, draw_fleet, guard

DT = 0.05  # s
OPEN = 1.0e6  # m, an open road is a ring so long that its ends never see each other
RAMP_START, MERGE_START, MERGE_END, ROAD_END = 1450.0, 1750.0, 2050.0, 2600.0  # m
RING = 2400.0  # m
GAP_ERROR, RATE_ERROR, ERROR_TIME = 0.06, 0.010, 20.0  # 1, 1/s, s: perception errors of the HDM paper
PEDAL_ERROR, PEDAL_TIME = 0.08, 1.0  # m/s2, s: actuation noise
WANDER, WANDER_TIME = 0.18, 7.0  # m, s: swaying in the lane
SOFT = -1.3  # m/s2, hardest braking to help or prepare a lane change


@dataclass(frozen=True)
class Scene:
    """Everything that the seed fixes before any effect: site, base model and times (s)."""

    site: str
    model: str
    sag_start: float  # m
    warm_up: float  # s, not recorded
    duration: float  # s, recorded


@dataclass
class Run:
    """True record at every step after the warm-up; rows are times, columns vehicles, NaN where not on the road."""

    scene: Scene
    fleet: Fleet
    wrap: float  # m
    time: Array  # s
    x: NDArray[np.float32]  # m, front
    v: NDArray[np.float32]  # m/s
    a: NDArray[np.float32]  # m/s2
    lateral: NDArray[np.float32]  # m from the left edge
    lane: NDArray[np.int8]
    lead: NDArray[np.int16]  # vehicle in front in the same lane (itself if none)
    changes: list[tuple[float, int, int, int, float]]  # start time s, vehicle, from, to, position m
    pace: list[int]
    contacts: int  # steps and vehicles with a gap below zero


def _demand(scene: Scene, rng: np.random.Generator) -> tuple[Ints, Array, Array, Array]:
    """Lane, entry time (s), entry position (m), truck share of every vehicle, sorted by entry time."""
    lanes, times, places = [], [], []
    if scene.site == "ring":
        for lane, density in ((0, rng.uniform(29, 34)), (1, rng.uniform(27, 32))):
            n = int(density * RING / 1000.0)
            lanes += [lane] * n
            times += [0.0] * n
            places += list((np.arange(n) + rng.uniform(-0.15, 0.15, n)) * RING / n)
    else:
        total = scene.warm_up + scene.duration
        scale = {"helly": 1.0, "fvd": 1.03, "lcm": 0.92}[scene.model]  # the models differ in capacity
        for lane, flow in ((0, rng.uniform(1750, 1850)), (1, rng.uniform(1500, 1650)), (2, rng.uniform(480, 600))):
            start = {0: 0.0, 1: 0.0, 2: RAMP_START}[lane]
            flow *= scale
            if lane < 2:
                # a queue already stands before the merge
                spots = np.append(np.arange(40.0, MERGE_START, 25.0), np.arange(MERGE_START + 40.0, ROAD_END, 45.0))
                spots += rng.uniform(-2.0, 2.0, spots.size)
                lanes += [lane] * spots.size
                times += [0.0] * spots.size
                places += list(spots)
            mean = 3600.0 / flow
            t = np.cumsum(1.1 + rng.exponential(mean - 1.1, int(total / mean * 1.3) + 20))
            t = t[t < total]
            lanes += [lane] * t.size
            times += list(t)
            places += [start] * t.size
    order = np.lexsort((-np.asarray(places), np.asarray(times)))
    lane_of = np.asarray(lanes, dtype=np.int64)[order]
    share = np.choose(lane_of, [0.0, 0.20, 0.10])
    return lane_of, np.asarray(times)[order], np.asarray(places)[order], share


class Road:
    """One simulation."""

    def __init__(self, scene: Scene, effect: str, seeds: list[np.random.SeedSequence]) -> None:
        demand, drivers, self.noise, lane_dice, strengths = (np.random.default_rng(s) for s in seeds)
        self.scene = scene
        self.lane0, self.t_in, self.x_in, share = _demand(scene, demand)
        n = self.lane0.size
        self.fleet = draw_fleet(n, share, drivers)
        ring = scene.site == "ring"
        self.wrap = RING if ring else OPEN
        satisfied = demand.uniform(0.3, 1.0, n + 1) if ring else None
        self.behaviour = Behaviour(effect, self.fleet, strengths, DT, scene.sag_start, satisfied)
        self.st = State(
            np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1), np.arange(n + 1), np.full(n + 1, np.nan), self.wrap
        )
        self.st.x[n] = MERGE_END
        self.lane = np.full(n + 1, -1)
        self.on = np.zeros(n + 1, dtype=bool)
        self.err = self.noise.standard_normal((4, n + 1))  # gap, rate, pedal, wander
        self.v0 = self.fleet.v0.copy()
        self.pace: list[int] = []
        if ring:
            self.pace = [int(np.flatnonzero(self.lane0 == k)[0]) for k in (0, 1)]
            self.beat = [self._beats(demand) for _ in self.pace]
        self.changer = LaneChanges(self, lane_dice, allowed=not ring, merge=(MERGE_START, MERGE_END))
        self.behaviour.enter(np.array([n]), self.st)
        self.waiting = [list(np.flatnonzero(self.lane0 == k)) for k in range(3)]

    def _beats(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Times (s) and speeds (m/s) of a pace vehicle: slow and fast stretches in turn, now and then a stop."""
        total = self.scene.warm_up + self.scene.duration
        t = np.cumsum(rng.uniform(35.0, 80.0, int(total / 35.0) + 2)) - 35.0
        slow, fast = rng.uniform(1.0, 6.5, t.size), rng.uniform(11.0, 18.0, t.size)
        return t, np.where(np.arange(t.size) % 2 == 0, fast, slow)

    def _enter(self, t: float) -> None:
        st, f = self.st, self.fleet
        for k, queue in enumerate(self.waiting):
            while queue and self.t_in[queue[0]] <= t:
                i = int(queue[0])
                here = np.flatnonzero(self.on & ((self.lane == k) | (self.changer.target == k)))
                d = (st.x[here] - self.x_in[i]) % self.wrap
                speed = 15.0 if k == 2 else 0.8 * f.v0[i] if t > 0.0 else 9.0 if self.x_in[i] < MERGE_START else 20.0
                if self.scene.site == "ring":
                    speed = 9.0
                elif here.size and t > 0.0:
                    j = here[np.argmin(d)]
                    free = d.min() - f.length[j] - f.s0[i]
                    speed = min(speed, st.v[j] + 0.5) if free < 3.0 * speed else speed
                    if free < 0.9 * f.gap_time[i] * speed + 1.0:
                        break
                queue.pop(0)
                st.x[i], st.v[i], self.lane[i], self.on[i] = self.x_in[i], speed, k, True
                self.behaviour.enter(np.array([i]), st)

    def order(self) -> None:
        """Sort vehicles, list those that occupy each lane and set every leader."""
        act = np.flatnonzero(self.on)
        act = act[np.argsort(self.st.x[act] % self.wrap)]
        self.act, self.occ = act, []
        lane, target = self.lane[act], self.changer.target[act]
        self.side = np.full(self.on.size, -1)
        for k in range(3):
            occ = act[(lane == k) | (target == k)]
            self.occ.append(occ)
            if occ.size == 0:
                continue
            nxt = np.concatenate([occ[1:], occ[:1]])
            own = self.lane[occ] == k
            self.st.lead[occ[own]] = nxt[own]
            self.side[occ[~own]] = nxt[~own]

    def neighbours(self, i: Ints, lane: int) -> tuple[Ints, Ints]:
        """Next vehicle ahead of and behind the vehicles i among those that occupy a lane."""
        occ = self.occ[lane]
        pos = np.searchsorted(self.st.x[occ] % self.wrap, self.st.x[i] % self.wrap, side="right")
        return occ[pos % occ.size], occ[(pos - 1) % occ.size]

    def _look_aside(self) -> None:
        """Mean speed (m/s) of the nearest vehicles of the other main lane within 50 m; NaN without any."""
        st = self.st
        st.adj[:] = np.nan
        for k in (0, 1):
            i = self.act[self.lane[self.act] == k]
            if i.size == 0 or self.occ[1 - k].size == 0:
                continue
            front, back = self.neighbours(i, 1 - k)
            near_f = (st.x[front] - st.x[i]) % self.wrap < 50.0
            near_b = (st.x[i] - st.x[back]) % self.wrap < 50.0
            count = near_f.astype(float) + near_b
            total = np.where(near_f, st.v[front], 0.0) + np.where(near_b, st.v[back], 0.0)
            st.adj[i] = np.where(count > 0, total / np.maximum(count, 1.0), np.nan)

    def respond(self, i: Ints, j: Ints) -> Array:
        """Acceleration (m/s2) that the drivers i want behind the vehicles j, with errors and the effect."""
        st, f = self.st, self.fleet
        s, v, vl = self.behaviour.stimulus(i, j, st)
        seen = np.where(s < 200.0, s * np.exp(GAP_ERROR * self.err[0, i]), s)
        rate = np.where(s < 200.0, RATE_ERROR * s * self.err[1, i], 0.0)
        gap_time = f.gap_time[i] * self.changer.relax[i] * self.behaviour.gap_factor(i, j, st)
        acc = base_acceleration(self.scene.model, f, i, self.v0[i], gap_time, seen, v, np.maximum(vl + rate, 0.0))
        acc = acc + self.behaviour.extra(i, j, s, st)
        return guard(acc, st.gap(i, j, f.length), st.v[i], st.v[j], f.s0[i])

    def _accelerate(self) -> Array:
        act, ch = self.act, self.changer
        walls = act[(self.lane[act] == 2) & (ch.target[act] < 0) & (self.st.x[act] > MERGE_END - 250.0)]
        entering = act[ch.target[act] >= 0]
        helping = act[ch.soft[act] >= 0]
        n = self.on.size - 1
        i = np.concatenate([act, entering, walls, helping])
        j = np.concatenate([self.st.lead[act], self.side[entering], np.full(walls.size, n), ch.soft[helping]])
        acc = self.respond(i, j)
        first_soft = i.size - helping.size
        acc[first_soft:] = np.maximum(acc[first_soft:], SOFT)
        want = np.full(n + 1, np.inf)
        np.minimum.at(want, i, acc)
        return want[act]

    def run(self) -> Run:
        """Simulate the warm-up and the recorded time."""
        sc, st, n = self.scene, self.st, self.on.size - 1
        first, last = round(sc.warm_up / DT), round((sc.warm_up + sc.duration) / DT)
        rows = last - first
        rec = {k: np.full((rows, n), np.nan, dtype=np.float32) for k in "xvay"}
        lane = np.full((rows, n), -1, dtype=np.int8)
        lead = np.full((rows, n), -1, dtype=np.int16)
        contacts = 0
        decay = np.exp(-DT / np.array([ERROR_TIME, ERROR_TIME, PEDAL_TIME, WANDER_TIME]))[:, None]
        kick = np.sqrt(1.0 - decay**2)
        self._enter(0.0)
        for k in range(last):
            t = k * DT
            if k and k % 4 == 0:
                self._enter(t)
            self.order()
            act = self.act
            if self.behaviour.name == "side_friction":
                self._look_aside()
            if k % 10 == 0:
                self.changer.decide(t)
                self.order()
            self.behaviour.remember(st)
            for p, car in enumerate(self.pace):
                beat_t, beat_v = self.beat[p]
                self.v0[car] = beat_v[min(np.searchsorted(beat_t, t), beat_v.size - 1)]
            self.err = decay * self.err + kick * self.noise.standard_normal(self.err.shape)
            dice = self.noise.random(n + 1)
            want = self._accelerate()
            a = self.behaviour.act(act, want, PEDAL_ERROR * self.err[2, act], st, dice)
            v = st.v[act]
            new = np.maximum(v + np.clip(a, -8.5, 3.5) * DT, 0.0)
            st.a[act] = (new - v) / DT
            if k >= first:
                r = k - first
                rec["x"][r, act], rec["v"][r, act], rec["a"][r, act] = st.x[act], v, st.a[act]
                rec["y"][r, act] = self.changer.lateral(act) + WANDER * self.err[3, act]
                lane[r, act], lead[r, act] = self.lane[act], st.lead[act]
                contacts += int((st.gap(act, st.lead[act], self.fleet.length) < 0.0).sum())
            st.x[act] += 0.5 * (v + new) * DT
            st.v[act] = new
            self.changer.move(DT)
            if self.wrap == OPEN:
                self.on[act[st.x[act] > ROAD_END + 40.0]] = False
        return Run(
            sc,
            self.fleet,
            self.wrap,
            (first + np.arange(rows)) * DT,
            rec["x"],
            rec["v"],
            rec["a"],
            rec["y"],
            lane,
            lead,
            self.changer.log,
            self.pace,
            contacts,
        )
