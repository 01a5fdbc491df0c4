"""Forced lane changes: at random times a vehicle moves into a gap on another lane, also into short gaps."""

import numpy as np

from rearl_jax.blind.traffic.scenario import Scenario
from rearl_jax.blind.traffic.snapshot import Snapshot

RETRY = 0.5
"""Time [s] after which a change that found no gap is tried again."""

REST = 8.0
"""Time [s] after a change during which a driver does not change again."""


class ForcedChanges:
    """Lane changes at random times, different ones in every recording."""

    def __init__(self, scenario: Scenario, n: int, rng: np.random.Generator) -> None:
        self._rng, self._n_vehicles = rng, scenario.n_vehicles
        share = (np.arange(scenario.lane_changes) + 0.5) / max(scenario.lane_changes, 1)
        jitter = rng.uniform(-0.3, 0.3, (scenario.n_recordings, scenario.lane_changes))
        times = 1.0 + (scenario.duration - 6.0) * (share + jitter / max(scenario.lane_changes, 1))
        self._due = [list(line) for line in times]
        self._changed = np.full(n, -np.inf)

    def carry_out(self, now: Snapshot) -> None:
        """Executes due lane changes and updates the neighbours."""
        for recording, due in enumerate(self._due):
            if due and due[0] <= now.time:
                change = self._choose(now, recording)
                if change is None:
                    due[0] = now.time + RETRY
                    continue
                due.pop(0)
                vehicle, lane = change
                now.lane[vehicle], self._changed[vehicle] = lane, now.time
                now.look_along()

    def _choose(self, now: Snapshot, recording: int) -> tuple[int, int] | None:
        """A random vehicle and its new lane, among all safe changes; None if there is none."""
        members = np.arange(recording * self._n_vehicles, (recording + 1) * self._n_vehicles)
        position, speed, lane = now.position[members], now.speed[members], now.lane[members]
        possible = []
        for member in range(self._n_vehicles):
            if now.fleet.rank[members[member]] == 0 or now.time - self._changed[members[member]] < REST:
                continue
            for target in {max(lane[member] - 1, 0), min(lane[member] + 1, now.n_lanes - 1)} - {lane[member]}:
                if self._fits(member, np.flatnonzero(lane == target), position, speed, now.length[members]):
                    possible.append((int(members[member]), int(target)))
        return possible[int(self._rng.integers(len(possible)))] if possible else None

    def _fits(
        self, member: int, on_target: np.ndarray, position: np.ndarray, speed: np.ndarray, length: np.ndarray
    ) -> bool:
        """True if there is a leader on the target lane and both gaps allow the change without hard braking."""
        is_ahead = position[on_target] > position[member]
        ahead, behind = on_target[is_ahead], on_target[~is_ahead]
        if ahead.size == 0:
            return False
        leader = ahead[np.argmin(position[ahead])]
        gap = position[leader] - position[member] - 0.5 * (length[leader] + length[member])
        if gap < 4.0 + 0.35 * speed[member] + 2.0 * max(0.0, speed[member] - speed[leader]) or gap > 80.0:
            return False
        if behind.size == 0:
            return True
        follower = behind[np.argmax(position[behind])]
        gap = position[member] - position[follower] - 0.5 * (length[follower] + length[member])
        return bool(gap > 4.0 + 0.35 * speed[follower] + 2.5 * max(0.0, speed[follower] - speed[member]))
