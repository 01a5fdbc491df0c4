"""The simulated road: who follows whom, time steps, inflow and bottleneck. Units are SI; `x` is the front bumper.

Sources
-------
Treiber & Kesting (2013), Traffic Flow Dynamics: ballistic update (sec. 10.2), flow-conserving bottleneck of longer time
    gaps and lower speeds (ch. 18).
Treiber, Kesting & Helbing (2006), Physica A 360: errors in judging gap (10 per cent, 20 s) and approach rate.
Laval, Toth & Zhou (2014), Transp. Res. B 70: noise of acceleration makes oscillations grow.
Krauss (1998): the safe speed, here with full braking, as a last resort against collisions.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from . import lanes
from .drivers import Drivers, Wander, arrival_times, draw_drivers
from .effects import Effect
from .models import MODELS, Situation

HARD = 8.0  # m/s^2, strongest braking


@dataclass
class Setting:
    """Scenario of one recording."""

    fps: int
    length: float  # observed road [m]
    duration: float  # observed time [s]
    warm_up: float  # time before [s]
    flow: float  # demand per lane [vehicles/s]
    trucks: float  # share of lorries on the whole carriageway [-]
    model: str
    zone_distance: float  # from the end of the observed road to the bottleneck [m]
    approach: float = 700.0
    zone: float = 300.0
    lanes: int = 3
    lane_width: float = 3.6
    slow: list[tuple[float, float]] = field(default_factory=list)  # (time, speed in the bottleneck), linear between
    now: float = 0.0

    @property
    def every(self) -> int:
        """Frames per time step: between steps of 0.08 or 0.1 s accelerations are constant."""
        return 2 if self.fps > 15 else 1

    @property
    def dt(self) -> float:
        """Time step of the simulation [s]."""
        return self.every / self.fps

    @property
    def window_begin(self) -> float:
        return self.approach

    @property
    def window_end(self) -> float:
        return self.approach + self.length

    @property
    def zone_begin(self) -> float:
        return self.window_end + self.zone_distance

    @property
    def road_end(self) -> float:
        return self.zone_begin + self.zone + 250.0


@dataclass
class View:
    """The drivers' surroundings: one entry per vehicle in its lane, and one more in the other lane of a lane change."""

    veh: np.ndarray
    lane: np.ndarray
    lead: np.ndarray  # vehicle ahead, -1: none
    place: np.ndarray  # index of the entry's leader among the sorted visible entries
    seen_veh: np.ndarray
    seen_lane: np.ndarray
    gap: np.ndarray
    vl: np.ndarray
    al: np.ndarray

    def ahead(self, k: int) -> np.ndarray:
        """The k-th vehicle ahead, -1: none."""
        at = self.place + k - 1
        inside = np.minimum(at, len(self.seen_veh) - 1)
        return np.where((at < len(self.seen_veh)) & (self.seen_lane[inside] == self.lane), self.seen_veh[inside], -1)


class Traffic:
    """State of all vehicles that will ever drive; `active` lists those on the road."""

    STRIDE = 100000.0  # key of a vehicle in a lane: lane * STRIDE + x

    def __init__(self, setting: Setting, effect: Effect, seeds: list[np.random.SeedSequence]):
        self.setting, self.effect = setting, effect
        who, noise, own, self.choice = (np.random.default_rng(s) for s in seeds)
        until = setting.warm_up + setting.duration
        factor = [1.0, 1.03, 0.85][: setting.lanes] if setting.lanes == 3 else [1.0] * setting.lanes
        queues = [arrival_times(who, setting.flow * f, until) for f in factor]
        first = int(setting.road_end / 25.0) + 1
        lane = np.concatenate([np.full(first + len(q), k) for k, q in enumerate(queues)])
        share = setting.trucks * np.array([0.0, 0.7, 2.4])[np.clip(lane - setting.lanes + 3, 0, 2)]
        n = len(lane)
        self.drivers: Drivers = draw_drivers(who, who.random(n) < share)
        self.lane = lane
        self.x, self.v, self.a, self.y, self.progress, self.weave = (np.zeros(n) for _ in range(6))
        self.target, self.origin, self.short_lane = (np.full(n, -1) for _ in range(3))
        self.short, self.short_since, self.changed = np.zeros(n), np.full(n, -1e9), np.full(n, -1e9)
        dt = setting.dt
        self.mood, self.jitter = Wander(noise, n, 20.0, dt, 2.0), Wander(noise, n, 4.0, dt, 0.5)
        self.misjudge, self.steer = Wander(noise, n, 20.0, dt, 2.0), Wander(noise, n, 6.0, dt, 0.5)
        self.depth = int(np.ceil(effect.remembers / dt)) + 2 if effect.remembers else 0
        self.history = np.zeros((2, self.depth, n))
        self.step_number = self.changes = self.guarded = self.moved = 0
        self.next = [int(np.flatnonzero(lane == k)[0]) + first for k in range(setting.lanes)]
        self.arrivals = [np.concatenate([np.zeros(0), q]) for q in queues]
        self.arrived = [0] * setting.lanes
        self.active = self._fill(first)
        effect.prepare(self, own)
        self.sort()

    def _fill(self, first: int) -> np.ndarray:
        """Put the first vehicles on the road, at somewhat more than their wanted distances."""
        placed = []
        for k in range(self.setting.lanes):
            x = self.setting.road_end
            for i in range(self.next[k] - first, self.next[k]):
                self.v[i] = min(20.0, self.drivers.v0[i])
                x -= float(self.drivers.s0[i] + 1.5 * self.drivers.time_gap[i] * self.v[i])
                if x < 30.0:
                    break
                self.x[i] = x
                placed.append(i)
                x -= float(self.drivers.length[i])
        who = np.array(placed)
        self._remember_new(who)
        return who

    def _remember_new(self, who: np.ndarray) -> None:
        for age in range(self.depth):
            row = (self.step_number - age) % self.depth
            self.history[0, row, who] = self.x[who] - self.v[who] * age * self.setting.dt
            self.history[1, row, who] = self.v[who]

    def past(self, who: np.ndarray, ago: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and speeds of vehicles `who`, `ago` seconds before now."""
        steps = ago / self.setting.dt
        low = np.floor(steps).astype(int)
        part = steps - low
        one, two = (self.step_number - low) % self.depth, (self.step_number - low - 1) % self.depth
        x, v = ((1 - part) * h[one, who] + part * h[two, who] for h in self.history)
        return x, v

    def sort(self) -> None:
        """Sort vehicles by lane and position; a vehicle that changes lanes takes up both."""
        act = self.active
        both = act[self.target[act] >= 0]
        other = np.where(self.progress[both] < 0.5, self.target[both], self.origin[both])
        veh, lane = np.concatenate([act, both]), np.concatenate([self.lane[act], other])
        keys = lane * self.STRIDE + self.x[veh]
        p = self.progress[both]
        seen = np.where(p < 0.5, p >= self.drivers.notice[both], p < 0.7)
        self.entry_veh, self.entry_lane, self.entry_keys = veh, lane, keys
        order = np.argsort(keys)
        self.all_keys, self.all_veh, self.all_lane = keys[order], veh[order], lane[order]
        visible = np.concatenate([np.ones(len(act), bool), seen])[order]
        self.seen_keys = self.all_keys[visible]
        self.seen_veh, self.seen_lane = self.all_veh[visible], self.all_lane[visible]

    def _leaders(self, keys: np.ndarray, veh: np.ndarray, lane: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        at = np.searchsorted(keys, self.entry_keys, side="right")
        inside = np.minimum(at, len(keys) - 1)
        return np.where((at < len(keys)) & (lane[inside] == self.entry_lane), veh[inside], -1), at

    def view(self) -> View:
        """Leaders, gaps and leaders' speeds of all entries."""
        lead, place = self._leaders(self.seen_keys, self.seen_veh, self.seen_lane)
        veh, k = self.entry_veh, np.maximum(lead, 0)
        has = lead >= 0
        gap = np.where(has, self.x[k] - self.drivers.length[k] - self.x[veh], 1000.0)
        vl = np.where(has, self.v[k], self.drivers.v0[veh])
        al = np.where(has, self.a[k], 0.0)
        return View(veh, self.entry_lane, lead, place, self.seen_veh, self.seen_lane, gap, vl, al)

    def bottleneck(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Speed limit [m/s] and factor on time gaps at positions `x`."""
        s = self.setting
        times, speeds = zip(*s.slow, strict=True)
        limit = float(np.interp(s.now, times, speeds))
        depth = np.clip((x - s.zone_begin) / 120.0 + 1.0, 0.0, 1.0) * (x < s.zone_begin + s.zone)
        return np.where(depth > 0, limit + (1.0 - depth) * (35.0 - limit), 99.0), 1.0 + 0.15 * (depth >= 1.0)

    def accelerations(self) -> np.ndarray:
        """Accelerations [m/s^2] of the active vehicles."""
        s, d, act = self.setting, self.drivers, self.active
        view = self.view()
        veh, true_gap, has = view.veh, view.gap.copy(), view.lead >= 0
        self.effect.sense(self, view)
        left = 1.0 - (s.now - self.short_since[veh]) / d.relaxation[veh]
        relaxed = np.where(self.short_lane[veh] == view.lane, self.short[veh] * np.clip(left, 0.0, 1.0), 0.0)
        error = np.exp(0.06 * self.misjudge.value[veh])
        gap = np.where(has, view.gap * error + relaxed, 1000.0)
        vl = np.where(has, view.vl + 0.008 * self.jitter.value[veh] * np.minimum(true_gap, 80.0), view.vl)
        limit, longer = self.bottleneck(self.x[veh])
        time_gap = d.time_gap[veh] * longer * self.effect.time_gap(self, view)
        situation = Situation(
            v=self.v[veh], gap=np.maximum(gap, 0.05), vl=np.maximum(vl, 0.0), al=view.al, last=self.a[veh],
            v0=np.minimum(d.v0[veh], limit), time_gap=time_gap, s0=d.s0[veh], a=d.a[veh], b=d.b[veh],
            mood=self.mood.value[veh],
        )  # fmt: skip
        acc = self.effect.add(self, view, MODELS[s.model](situation))
        n = len(act)
        both = self.target[act] >= 0
        other = np.full(n, np.inf)
        other[both] = acc[n:]
        # after most of the lane change the old lane is left to itself
        other[both & (self.progress[act] > 0.6)] = np.inf
        acc = np.minimum(acc[:n], other) + d.noise[act] * self.jitter.value[act] * np.minimum(self.v[act] / 3.0, 1.0)
        acc = np.clip(self.effect.hold(self, act, acc), -6.0, 1.5 * d.a[act])
        return self._guard(acc)

    def _guard(self, acc: np.ndarray) -> np.ndarray:
        """Brake at full strength where the wanted acceleration would end in a collision."""
        act, dt = self.active, self.setting.dt
        lead, _ = self._leaders(self.all_keys, self.all_veh, self.all_lane)
        k = np.maximum(lead, 0)
        room = self.x[k] - self.drivers.length[k] - self.x[self.entry_veh] - 0.8
        room = np.where(lead >= 0, room - 0.5 * self.v[self.entry_veh] * dt, 1e6)
        vl = np.maximum(self.v[k] - HARD * dt, 0.0)
        safe = -HARD * dt + np.sqrt(np.maximum((HARD * dt) ** 2 + vl**2 + 2.0 * HARD * room, 0.0))
        most = (np.maximum(safe, 0.0) - self.v[self.entry_veh]) / dt
        n = len(act)
        both = self.target[act] >= 0
        most[:n][both] = np.minimum(most[:n][both], most[n:])
        self.guarded += int(np.sum(most[:n] < acc - 0.5))
        self.moved += n
        return np.minimum(acc, np.maximum(most[:n], -9.0))

    def step(self) -> None:
        """One time step."""
        s, dt = self.setting, self.setting.dt
        act = self.active
        acc = self.accelerations()
        old = self.v[act]
        new = np.maximum(old + acc * dt, 0.0)
        self.x[act] += 0.5 * (old + new) * dt
        self.v[act], self.a[act] = new, (new - old) / dt
        s.now += dt
        self.step_number += 1
        lanes.move(self, dt)
        for process in (self.mood, self.jitter, self.misjudge):
            process.step(act)
        if self.depth:
            row = self.step_number % self.depth
            self.history[0, row, act], self.history[1, row, act] = self.x[act], new
        self.active = act[self.x[act] - self.drivers.length[act] < s.road_end]
        self._enter()
        self.sort()
        if self.step_number % max(1, round(lanes.EVERY / dt)) == 0:
            lanes.decide(self, self.choice)

    def _enter(self) -> None:
        """Let vehicles that have arrived enter, if there is room."""
        s, d = self.setting, self.drivers
        for k in range(s.lanes):
            j = self.arrived[k]
            if j >= len(self.arrivals[k]) or self.arrivals[k][j] > s.now:
                continue
            i = self.next[k] + j
            there = self.active[(self.lane[self.active] == k) | (self.target[self.active] == k)]
            speed = min(float(d.v0[i]), 30.0)
            if len(there):
                last = int(there[np.argmin(self.x[there])])
                room = float(self.x[last] - d.length[last])
                least = float(d.s0[i] + 0.8 * d.time_gap[i] * self.v[last])
                if room < least:
                    continue
                speed = min(speed, float(self.v[last]) + (room - least) / 4.0)
            self.x[i], self.v[i], self.a[i], self.lane[i] = 0.0, speed, 0.0, k
            self.y[i] = (k + 0.5) * s.lane_width + d.offset[i]
            self.active = np.append(self.active, i)
            self.arrived[k] = j + 1
            self._remember_new(np.array([i]))
