"""Lane changes: wish, preparation, gap acceptance, movement and relaxation.

The lane-change model follows LMRS (Schakel, Knoop and van Arem 2012): a wish between 0 and 1 from route and
speed, free / synchronised / cooperative changes at 0.365 / 0.577 / 0.788, gaps accepted with a time gap that
shrinks with the wish, and a time gap that recovers with 25 s after the change (see also Laval and Leclercq 2008).
Movement takes about 5 s (Toledo and Zohar 2007) on a smooth path; the lane flips when the centre crosses the line.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .models import Array, Ints, base_acceleration

if TYPE_CHECKING:
    from .traffic import Road

LANE_WIDTH = 3.6  # m
D_FREE, D_SYNC, D_COOP = 0.365, 0.577, 0.788  # wish levels
T_MIN, RECOVERY = 0.56, 25.0  # s
LOOK, TIME_TO_GO = 295.0, 43.0  # m, s: horizon of the route wish
V_GAIN = 13.0  # m/s, speed gain worth a full wish (19 m/s in the source; lower for busier roads)
B_SAFE = 2.1  # m/s2


class LaneChanges:
    """Lane-change state of all vehicles."""

    def __init__(self, road: Road, rng: np.random.Generator, allowed: bool, merge: tuple[float, float]) -> None:
        n = road.on.size
        self.road, self.allowed, self.merge = road, allowed, merge
        self.target = np.full(n, -1)  # lane being entered, until the centre crosses the marking
        self.source = np.zeros(n, dtype=np.int64)
        self.goal = np.zeros(n, dtype=np.int64)
        self.done = np.ones(n)  # part of the time of the current change that is over, 0 to 1
        self.soft = np.full(n, -1)  # vehicle followed softly in another lane
        self.relax = np.ones(n)  # factor on the time gap, back to 1 with RECOVERY
        self.moved = rng.uniform(-12.0, 0.0, n)  # s, last change
        self.length = np.clip(rng.normal(5.0, 1.1, n), 3.0, 8.5)  # s, time for a change
        self.gain = V_GAIN * np.exp(0.35 * rng.standard_normal(n))  # m/s
        self.dice = rng
        self.log: list[tuple[float, int, int, int, float]] = []

    def _expected(self, i: Ints, front: Ints) -> Array:
        """Speed (m/s) that the drivers i expect behind front and the vehicle before it."""
        st, v0 = self.road.st, self.road.v0[i]
        best = v0
        other = front
        reach = np.zeros(i.size)
        for _ in range(2):
            reach = (st.x[other] - st.x[i]) % st.wrap
            share = np.clip(reach / LOOK, 0.0, 1.0)
            best = np.minimum(best, (1.0 - share) * st.v[other] + share * v0)
            other = st.lead[other]
        return best

    def decide(self, t: float) -> None:
        """Update wishes, soft reactions and start accepted changes; t in s."""
        road = self.road
        draw = self.dice.random(self.target.size)
        if not self.allowed:
            return
        st, f = road.st, road.fleet
        self.soft[:] = -1
        taken: list[tuple[int, int]] = []
        for lane in (2, 0, 1):
            new = min(lane - 1, 1) if lane else 1
            i = road.act[(road.lane[road.act] == lane) & (self.target[road.act] < 0)]
            i = i[self.done[i] >= 1.0]
            if lane == 2:
                i = i[st.x[i] > self.merge[0]]
            if i.size == 0 or road.occ[new].size == 0:
                continue
            front, back = road.neighbours(i, new)
            if lane == 2:
                left = self.merge[1] - st.x[i]
                wish = np.maximum(1.0 - left / LOOK, 1.0 - left / np.maximum(st.v[i], 1.0) / TIME_TO_GO)
                wish = np.clip(np.maximum(wish, D_FREE + 0.01), 0.0, 1.0)
            else:
                gain = self._expected(i, front) - self._expected(i, st.lead[i])
                wish = np.clip(gain / self.gain[i], -1.0, 0.95)
                if new == 1:  # keep right where that costs nothing
                    wish = np.maximum(wish, np.where(self._expected(i, front) > 0.97 * road.v0[i], D_FREE + 0.02, -1))
                wish[f.truck[i] & (new == 0)] = -1.0
                wish[(t - self.moved[i] < 9.0) | (st.x[i] < 60.0) | (draw[i] > 0.35)] = -1.0
            self._prepare(i, front, back, wish)
            self._accept(i, front, back, wish, new, t, taken)

    def _prepare(self, i: Ints, front: Ints, back: Ints, wish: Array) -> None:
        """Adapt to the vehicle ahead in the new lane; make the one behind there open a gap."""
        st = self.road.st
        near = (st.x[front] - st.x[i]) % st.wrap < 120.0
        sync = (wish > D_SYNC) & near
        self.soft[i[sync]] = front[sync]
        behind = st.gap(back, i, self.road.fleet.length)
        coop = (wish > D_COOP) & (behind < 55.0) & (behind > 1.0) & (self.target[back] < 0)
        self.soft[back[coop]] = i[coop]

    def _accept(
        self, i: Ints, front: Ints, back: Ints, wish: Array, new: int, t: float, taken: list[tuple[int, int]]
    ) -> None:
        """Start the changes with good gaps, at most one per 80 m of the new lane at a time."""
        road = self.road
        st, f = road.st, road.fleet
        ahead, behind = st.gap(i, front, f.length), st.gap(back, i, f.length)

        def wanted(me: Ints, gap: Array, lead: Ints) -> Array:
            short = f.gap_time[me] * self.relax[me]
            short = np.minimum(short, (1.0 - wish) * short + wish * T_MIN)
            return base_acceleration(road.scene.model, f, me, road.v0[me], short, gap, st.v[me], st.v[lead])

        merging = road.lane[i] == 2
        floor = -B_SAFE * np.where(merging, np.maximum(wish, 0.6), np.maximum(wish, 0.0))
        good = (wish > D_FREE) & ((st.v[i] > 1.5) | merging)
        good &= (ahead > 1.5 + 0.3 * st.v[i]) & (behind > 1.5 + 0.3 * st.v[back])
        for gap, closing in ((ahead, st.v[i] - st.v[front]), (behind, st.v[back] - st.v[i])):
            good &= np.maximum(closing, 0.0) ** 2 < 2.0 * B_SAFE * np.maximum(gap - 1.0, 0.2)
        good &= (wanted(i, ahead, front) > floor) & (wanted(back, behind, i) > floor)
        for p in np.flatnonzero(good)[::-1]:
            me = int(i[p])
            if any(k == new and abs(st.x[me] - st.x[q]) < 80.0 for k, q in taken):
                continue
            taken.append((new, me))
            self.source[me], self.goal[me], self.target[me] = road.lane[me], new, new
            self.done[me], self.moved[me] = 0.0, t
            self.soft[me] = -1
            for who, gap in ((me, ahead[p]), (int(back[p]), behind[p])):
                gap_time = (gap - f.s0[who]) / max(st.v[who], 2.0)
                low = T_MIN / f.gap_time[who]
                self.relax[who] = min(self.relax[who], float(np.clip(gap_time / f.gap_time[who], low, 1.0)))
            self.log.append((t, me, int(road.lane[me]), new, float(st.x[me])))

    def _shift(self, i: Ints) -> Array:
        p = self.done[i]
        return p**3 * (10.0 - 15.0 * p + 6.0 * p * p)

    def move(self, dt: float) -> None:
        """Move sideways (slower below 2.5 m/s), flip lanes at the marking, let time gaps recover; dt in s."""
        self.relax += (1.0 - self.relax) * dt / RECOVERY
        i = np.flatnonzero(self.done < 1.0)
        rate = np.clip(self.road.st.v[i] / 2.5, 0.15, 1.0) / self.length[i]
        self.done[i] = np.minimum(self.done[i] + dt * rate, 1.0)
        i = i[(self.target[i] >= 0) & (self.done[i] >= 0.5)]
        self.road.lane[i] = self.target[i]
        self.target[i] = -1

    def lateral(self, i: Ints) -> Array:
        """Lateral position (m) of the vehicle centres without swaying, from the left edge of the road."""
        moving = self.source[i] + (self.goal[i] - self.source[i]) * self._shift(i)
        return (np.where(self.done[i] < 1.0, moving, self.road.lane[i]) + 0.5) * LANE_WIDTH
