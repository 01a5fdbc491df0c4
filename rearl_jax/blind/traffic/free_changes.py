"""Free (discretionary) lane changes.

Twice a second all drivers compare lanes and change at random, with a probability that grows with the gain.

The gain is the acceleration that the driver gains by the change: MOBIL without politeness (Kesting, Treiber & Helbing,
Transp. Res. Rec. 1999 (2007) 86). Its safety criterion holds for the driver and for the new follower. The choice is a
logit model of the gain (McFadden, in: Frontiers in Econometrics (1974) 105).
"""

from collections.abc import Sequence

import numpy as np

from rearl_jax.blind.traffic.effect import HiddenEffect
from rearl_jax.blind.traffic.snapshot import Choice, Snapshot

PERIOD = 25
"""Sub-steps from one decision to the next, half a second."""

LEAST_TIME_BETWEEN = 5.0
"""Time [s] after a change during which a driver does not change again."""

LEAST_GAP = 3.0
"""Smallest gap [m] ahead and behind for a change."""

SAFE_DECELERATION = 3.0
"""Largest deceleration [m/s^2] that a change may require of the driver or of the new follower."""

THRESHOLD, SCATTER = 0.3, 0.15
"""Gain [m/s^2] at which the logit probability is one half, and the scale of the logit [m/s^2]."""

READINESS = 0.4
"""Probability of a change per decision at a very large gain [-]."""


class FreeChanges:
    """Times and drivers of lane changes, by their gains."""

    def __init__(self, n: int, effects: Sequence[HiddenEffect], rng: np.random.Generator) -> None:
        self._effects, self._rng = effects, rng
        self._changed = np.full(n, -np.inf)

    def carry_out(self, now: Snapshot) -> None:
        """Draws the decisions of all drivers when they are due, and executes them; of conflicting changes only one."""
        if now.step % PERIOD:
            return
        rested = (now.time - self._changed >= LEAST_TIME_BETWEEN) & (now.fleet.rank > 0)
        decided, choices = [], (weigh(now, -1), weigh(now, +1))
        for choice in choices:
            value = choice.gain
            for effect in self._effects:
                value = effect.gain_of_change(value, choice, now)
            chance = READINESS / (1.0 + np.exp(np.clip((THRESHOLD - value) / SCATTER, -50.0, 50.0)))
            decided.append(choice.is_possible & rested & (self._rng.random(now.n) < chance))
        involved = np.zeros(now.n + 1, dtype=bool)
        moved = False
        for vehicle in self._rng.permutation(np.flatnonzero(decided[0] | decided[1])):
            sides = [k for k in (0, 1) if decided[k][vehicle]]
            choice = choices[sides[int(self._rng.integers(len(sides)))]]
            others = [now.leader[vehicle], now.follower[vehicle], choice.leader[vehicle], choice.rear[vehicle]]
            affected = np.array([vehicle, *(other for other in others if other < now.n)])
            if involved[affected].any():
                continue
            involved[affected] = True
            now.lane[vehicle] += choice.side
            self._changed[vehicle] = now.time
            moved = True
        if moved:
            now.look_along()


def weigh(now: Snapshot, side: int) -> Choice:
    """The lane change to one side as an option for every vehicle."""
    everyone, own_speed, speed, follower = np.arange(now.n), now.speed[: now.n], now.speed, now.follower
    own_length = now.length[: now.n]
    leader, rear = _neighbours(now, side)
    gap, rear_gap, follower_gap = now.gap_to(leader), now.gap_behind(rear), now.gap_behind(follower)
    # Interactions of the driver behind its present and its new leader.
    here = _interaction(now, everyone, now.gap_to(now.leader), speed[now.leader])
    there = _interaction(now, everyone, gap, speed[leader])
    # Interactions of the new follower after and before the change, and of the present follower after it.
    behind_me = _interaction(now, rear, rear_gap, own_speed)
    before = _interaction(now, rear, gap + rear_gap + own_length, speed[leader])
    freed_gap = follower_gap + now.gap_to(now.leader) + own_length
    freed = _interaction(now, follower, freed_gap, speed[now.leader])
    relief = _interaction(now, follower, follower_gap, own_speed) - freed
    drivers, scale = now.drivers(), now.model.scale
    rear_after = np.where(rear == now.n, 0.0, now.model.acceleration(now.drivers(rear), behind_me))
    own_after = now.model.acceleration(drivers, there)
    lane, gain = now.lane + side, scale(drivers) * (here - there)
    # The first vehicle of a lane drives as prescribed: it changes no lane, and nobody changes to a place before it.
    fits = (leader < now.n) & (gap > LEAST_GAP) & (rear_gap > LEAST_GAP) & (now.leader < now.n)
    fits &= (lane >= 0) & (lane < now.n_lanes) & (own_after > -SAFE_DECELERATION) & (rear_after > -SAFE_DECELERATION)
    cost_to_rear = scale(now.drivers(rear)) * (behind_me - before)
    return Choice(side, leader, rear, gap, gain, cost_to_rear, scale(now.drivers(follower)) * relief, fits)


def _neighbours(now: Snapshot, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Index of the vehicles ahead and behind on the adjacent lane of one side, n for none."""
    position = now.position[: now.n]
    group = now.fleet.recording * (now.n_lanes + 2) + now.lane + 1
    order = np.lexsort((position, group))
    # Lanes lie one behind the other on one line, so that one search finds the neighbours on all of them.
    span = np.ptp(position) + 1.0
    line = (group * span + position - position.min())[order]
    place = np.searchsorted(line, (group + side) * span + position - position.min(), side="right")
    ahead, behind = np.append(order, now.n)[place], np.append(now.n, order)[place]
    groups = np.append(group, -1)
    leader, rear = (np.where(groups[other] == group + side, other, now.n) for other in (ahead, behind))
    return leader, rear


def _interaction(now: Snapshot, who: np.ndarray, gap: np.ndarray, speed_ahead: np.ndarray) -> np.ndarray:
    """Interaction of the given vehicles behind a leader; 0 without a vehicle."""
    drivers = now.drivers(who)
    return np.where(who == now.n, 0.0, now.model.interaction(drivers, gap, drivers.speed - speed_ahead))
