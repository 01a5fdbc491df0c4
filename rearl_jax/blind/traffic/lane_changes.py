"""Forced lane changes: at random times a vehicle moves into a gap on another lane, also into short gaps."""

import numpy as np

from rearl_jax.blind.traffic.scenario import Scenario
from rearl_jax.blind.traffic.snapshot import Snapshot

RETRY = 0.5
"""Time [s] after which a change that found no gap is tried again."""

REST = 8.0
"""Time [s] after a change during which a driver does not change again."""


class ForcedChanges:
    """Random times of lane changes; every recording has its own."""

    def __init__(self, scenario: Scenario, n: int, rng: np.random.Generator) -> None:
        self._rng, self._per = rng, scenario.n_vehicles
        share = (np.arange(scenario.lane_changes) + 0.5) / max(scenario.lane_changes, 1)
        jitter = rng.uniform(-0.3, 0.3, (scenario.n_recordings, scenario.lane_changes))
        times = 1.0 + (scenario.duration - 6.0) * (share + jitter / max(scenario.lane_changes, 1))
        self._due = [list(line) for line in times]
        self._changed = np.full(n, -np.inf)

    def carry_out(self, now: Snapshot) -> None:
        """Executes due lane changes and updates the neighbours."""
        for recording, due in enumerate(self._due):
            if due and due[0] <= now.time:
                chosen = self._choose(now, recording)
                if chosen is None:
                    due[0] = now.time + RETRY
                    continue
                due.pop(0)
                vehicle, lane = chosen
                now.lane[vehicle], self._changed[vehicle] = lane, now.time
                now.look_along()

    def _choose(self, now: Snapshot, recording: int) -> tuple[int, int] | None:
        """A random vehicle and its new lane, among all safe changes; None if there is none."""
        members = np.arange(recording * self._per, (recording + 1) * self._per)
        position, speed, lane = now.position[members], now.speed[members], now.lane[members]
        possible = []
        for own in range(self._per):
            if now.fleet.rank[members[own]] == 0 or now.time - self._changed[members[own]] < REST:
                continue
            for target in {max(lane[own] - 1, 0), min(lane[own] + 1, now.n_lanes - 1)} - {lane[own]}:
                if self._fits(own, np.flatnonzero(lane == target), position, speed, now.length[members]):
                    possible.append((int(members[own]), int(target)))
        return possible[int(self._rng.integers(len(possible)))] if possible else None

    def _fits(self, own: int, there: np.ndarray, position: np.ndarray, speed: np.ndarray, length: np.ndarray) -> bool:
        """True if there is a leader on the target lane and both gaps allow the change without hard braking."""
        ahead, behind = there[position[there] > position[own]], there[position[there] <= position[own]]
        if ahead.size == 0:
            return False
        leader = ahead[np.argmin(position[ahead])]
        gap = position[leader] - position[own] - 0.5 * (length[leader] + length[own])
        if gap < 4.0 + 0.35 * speed[own] + 2.0 * max(0.0, speed[own] - speed[leader]) or gap > 80.0:
            return False
        if behind.size == 0:
            return True
        follower = behind[np.argmax(position[behind])]
        gap = position[own] - position[follower] - 0.5 * (length[follower] + length[own])
        return bool(gap > 4.0 + 0.35 * speed[follower] + 2.5 * max(0.0, speed[follower] - speed[own]))
