"""Lane changes: whether drivers want one, whether they accept the gap, and how they move sideways.

Sources
-------
Toledo, Koutsopoulos & Ben-Akiva (2003), Modeling integrated lane-changing behavior, TRR 1857: utility of lanes, random
    terms, critical lead and lag gaps that grow with the speed difference.
Hidas (2005), Modelling vehicle interactions in microscopic simulation of merging and weaving, Transp. Res. C 13: the
    follower behind the gap begins to make room before the lane change.
Toledo & Zohar (2007), TRR 1999: durations. Laval & Leclercq (2008), Transp. Res. B 42: drivers accept short spacings
    and give them up over several seconds (here in the form of Keane & Gao 2021).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .traffic import Traffic

EVERY = 0.5  # s between decisions of a driver
RATE = 0.10  # 1/s, at which a driver who certainly wants to begins
PATIENCE = 12.0  # s between two lane changes of a driver


def smooth(p: np.ndarray) -> np.ndarray:
    """Share of the way sideways after share `p` of the time: the quintic of least jerk."""
    return p**3 * (10.0 - 15.0 * p + 6.0 * p**2)


def neighbours(traffic: Traffic, who: np.ndarray, lane: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Leader and follower (-1: none) that vehicles `who` would have in the lanes `lane`."""
    keys, veh = traffic.all_keys, traffic.all_veh
    at = np.searchsorted(keys, lane * traffic.STRIDE + traffic.x[who])
    ahead = np.minimum(at, len(keys) - 1)
    behind = np.maximum(at - 1, 0)
    lead = np.where((at < len(keys)) & (keys[ahead] // traffic.STRIDE == lane), veh[ahead], -1)
    follow = np.where((at > 0) & (keys[behind] // traffic.STRIDE == lane), veh[behind], -1)
    return lead, follow


def expected_speed(traffic: Traffic, who: np.ndarray, lead: np.ndarray) -> np.ndarray:
    """Speed [m/s] that drivers expect behind the leader `lead`: its speed, more if there is room ahead."""
    d = traffic.drivers
    k = np.maximum(lead, 0)
    gap = traffic.x[k] - d.length[k] - traffic.x[who]
    room = np.maximum(gap - d.s0[who] - d.time_gap[who] * traffic.v[who], 0.0)
    return np.where(lead >= 0, np.minimum(d.v0[who], traffic.v[k] + room / 8.0), d.v0[who])


def accepts(traffic: Traffic, i: int, lane: int) -> bool:
    """True if driver `i` accepts the gap in `lane`."""
    who = np.array([i])
    lead, follow = (int(k[0]) for k in neighbours(traffic, who, np.array([lane])))
    d, v = traffic.drivers, float(traffic.v[i])
    for k, behind in ((lead, False), (follow, True)):
        if k < 0:
            continue
        if behind:
            gap = float(traffic.x[i] - d.length[i] - traffic.x[k])
            closing = float(traffic.v[k]) - v
            at = float(traffic.v[k])
        else:
            gap = float(traffic.x[k] - d.length[k] - traffic.x[i])
            closing = v - float(traffic.v[k])
            at = v
        critical = (2.0 + 0.35 * at) * np.exp(0.10 * max(closing, 0.0)) * float(d.critical[i])
        brake = max(closing, 0.0) ** 2 / (2.0 * max(gap - 1.5, 0.1))
        if gap < max(critical, 1.5) or brake > 1.0:
            return False
    return True


def decide(traffic: Traffic, rng: np.random.Generator) -> None:
    """Let all drivers who may change lanes decide, and begin those lane changes that find a gap."""
    s, d = traffic.setting, traffic.drivers
    act = traffic.active
    calm = (traffic.target[act] < 0) & (s.now - traffic.changed[act] > PATIENCE) & (traffic.v[act] > 2.0)
    who = act[calm]
    if not len(who):
        return
    lead, _ = neighbours(traffic, who, traffic.lane[who])
    here = expected_speed(traffic, who, lead)
    free = traffic.v[who] > 0.75 * d.v0[who]
    chance = np.zeros((2, len(who)))
    for k, side in enumerate((-1, 1)):
        lane = traffic.lane[who] + side
        allowed = (lane >= 0) & (lane < s.lanes) & ~(d.truck[who] & (lane == 0))
        there, _ = neighbours(traffic, who, np.clip(lane, 0, s.lanes - 1))
        gain = expected_speed(traffic, who, there) - here
        keep_right = 1.2 * d.threshold[who] * (side > 0) * free  # return to the right when it costs no speed
        want = 1.0 / (1.0 + np.exp(-(gain - d.threshold[who] + keep_right) / 0.7))
        chance[k] = allowed * want * RATE * EVERY * np.minimum(1.0, traffic.v[who] / 10.0)
    draw = rng.random(len(who))
    go = np.where(draw < chance[0], -1, np.where(draw < chance[0] + chance[1], 1, 0))
    for j in rng.permutation(np.flatnonzero(go)):
        i, lane = int(who[j]), int(traffic.lane[who[j]] + go[j])
        if accepts(traffic, i, lane):
            begin(traffic, i, lane)


def begin(traffic: Traffic, i: int, lane: int) -> None:
    """Begin a lane change: the driver attends to the new leader from now on."""
    traffic.target[i], traffic.origin[i], traffic.progress[i] = lane, traffic.lane[i], 0.0
    lead, _ = neighbours(traffic, np.array([i]), np.array([lane]))
    relax(traffic, i, int(lead[0]), lane)
    traffic.sort()


def relax(traffic: Traffic, i: int, lead: int, lane: int) -> None:
    """Remember how much shorter than wanted the gap of driver `i` behind the new leader is."""
    d = traffic.drivers
    short = 0.0
    if lead >= 0:
        gap = traffic.x[lead] - d.length[lead] - traffic.x[i]
        short = 0.7 * max(0.0, float(d.s0[i] + d.time_gap[i] * traffic.v[i] - gap))
    traffic.short[i], traffic.short_since[i], traffic.short_lane[i] = short, traffic.setting.now, lane


def move(traffic: Traffic, dt: float) -> None:
    """Advance lane changes by `dt` [s]: sideways places, the lane, and followers who notice."""
    d = traffic.drivers
    act = traffic.active
    who = act[traffic.target[act] >= 0]
    if len(who):
        before = traffic.progress[who]
        pace = np.minimum(1.0, traffic.v[who] / 4.0)  # nobody moves sideways at standstill
        after = before + pace * dt / d.duration[who]
        traffic.progress[who] = after
        for i in who[(before < d.notice[who]) & (after >= d.notice[who])]:
            _, follow = neighbours(traffic, np.array([i]), np.array([traffic.target[i]]))
            if follow[0] >= 0:
                relax(traffic, int(follow[0]), int(i), int(traffic.target[i]))
        cross = who[(before < 0.5) & (after >= 0.5)]
        traffic.lane[cross] = traffic.target[cross]
        traffic.changes += len(cross)
        done = who[after >= 1.0]
        traffic.target[done], traffic.progress[done] = -1, 0.0
        traffic.changed[done] = traffic.setting.now
    moving = traffic.target[act] >= 0
    middle = np.where(moving, traffic.origin[act], traffic.lane[act]) * 1.0
    middle += np.where(moving, traffic.target[act] - traffic.origin[act], 0) * smooth(traffic.progress[act])
    # the wander is a twice smoothed random walk: steering is continuous
    traffic.weave[act] += (0.15 * traffic.steer.value[act] - traffic.weave[act]) * min(1.0, dt / 1.5)
    traffic.steer.step(act)
    traffic.y[act] = (middle + 0.5) * traffic.setting.lane_width + d.offset[act] + traffic.weave[act]
