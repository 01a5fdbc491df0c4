"""The ten behaviours that the base models lack. README.md has the table with forms, strengths and sources."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .models import Array, Fleet, Ints

EFFECTS = (
    "control",
    "reaction_delay",
    "second_leader",
    "brake_light",
    "speed_gap",
    "hysteresis",
    "resignation",
    "truck_gap",
    "sag",
    "side_friction",
    "action_points",
)

# name: (median of the strength, spread of its logarithm over drivers)
STRENGTH: dict[str, tuple[float, float]] = {
    "reaction_delay": (0.5, 0.15),  # s, Johansson and Rumar 1971; Davis 2003
    "second_leader": (0.25, 0.30),  # 1/s, half of Helly's 0.5 1/s: Hoogendoorn and Ossen 2006
    "brake_light": (0.45, 0.30),  # 1, Zhao and Gao 2005; Knospe et al. 2000
    "speed_gap": (0.60, 0.30),  # 1, Banks 2003; Brackstone, Waterson and McDonald 2009
    "hysteresis": (0.22, 0.30),  # 1, Newell 1965; Zhang and Kim 2005; Yeo and Skabardonis 2009
    "resignation": (0.80, 0.20),  # 1, jam time gap 1.8 times the fresh one: Treiber and Helbing 2003
    "truck_gap": (0.35, 0.30),  # 1, Aghabayk, Sarvi and Young 2012; Sarvi 2013
    "sag": (1.0, 0.20),  # 1, factor on the uncompensated gradient: Goni-Ros et al. 2014, 2016
    "side_friction": (0.55, 0.30),  # 1 per 10 m/s, Ponnu and Coifman 2015
    "action_points": (2.2, 0.25),  # s, mean time between jumps: Wagner and Lubashevsky 2003
}
RESIGN_TIME = 300.0  # s, memory time (the source uses 600 s for jams that last hours)
PHASE_TIME = 3.0  # s, memory of the acceleration phase
SAG_DOWN, SAG_UP, SAG_BEND, SAG_CLIMB = -0.01, 0.030, 250.0, 350.0  # gradients; m of curve; m of climb
COMPENSATION = 0.00042  # 1/s, rate at which drivers make up for a gradient (Goni-Ros et al. 2014)
FREE_HEADWAY = 70.0  # m, gap over which reactions to vehicles beyond the leader's gap fade out


@dataclass
class State:
    """What drivers can see; arrays run over the whole fleet. x m, v m/s, a m/s2, lead index, adj m/s or NaN."""

    x: Array
    v: Array
    a: Array
    lead: Ints
    adj: Array
    wrap: float

    def gap(self, i: Ints, j: Ints, length: Array, x: Array | None = None) -> Array:
        """Bumper gap (m) from vehicle i forward to vehicle j."""
        pos = self.x if x is None else x
        d = (pos[j] - pos[i]) % self.wrap
        return np.where(d == 0.0, self.wrap, d) - length[j]


def gradient(x: Array, start: float, wrap: float) -> Array:
    """Road gradient (1) at x (m): level, short dip, curve up, climb, and a crest back to level."""
    d = (x - start) % wrap
    knots = np.array([0.0, 60.0, 160.0, 160.0 + SAG_BEND, 160.0 + SAG_BEND + SAG_CLIMB, 260.0 + SAG_BEND + SAG_CLIMB])
    return np.interp(d, knots, [0.0, SAG_DOWN, SAG_DOWN, SAG_UP, SAG_UP, 0.0])


@dataclass
class Behaviour:
    """One effect (or none) with its per-driver strength and memory."""

    name: str
    fleet: Fleet
    rng: np.random.Generator
    dt: float  # s
    sag_start: float  # m
    lived: Array | None = None  # initial satisfaction, 0 to 1

    def __post_init__(self) -> None:
        if self.name not in EFFECTS:
            raise ValueError(f"unknown effect {self.name!r}; choose from {EFFECTS}")
        n = len(self.fleet)
        median, spread = STRENGTH.get(self.name, (0.0, 0.0))
        self.size = median * np.exp(spread * np.clip(self.rng.standard_normal(n), -2.0, 2.0))
        self.phase = np.zeros(n)
        self.content = np.ones(n) if self.lived is None else self.lived.copy()
        self.made_up = np.zeros(n)
        self.held = np.zeros(n)
        self.steps = np.rint(self.size / self.dt).astype(np.int64)
        self.depth = int(self.steps.max()) + 1 if self.name == "reaction_delay" else 0
        self.old_x = np.zeros((self.depth, n))
        self.old_v = np.zeros((self.depth, n))
        self.now = 0

    def enter(self, new: Ints, st: State) -> None:
        """Fill the memory of vehicles that enter the road, as if they had come at constant speed."""
        if self.depth:
            age = ((self.now - np.arange(self.depth)) % self.depth)[:, None] * self.dt
            self.old_x[:, new] = st.x[new] - age * st.v[new]
            self.old_v[:, new] = st.v[new]

    def remember(self, st: State) -> None:
        """Store the present state; call once at the start of each step."""
        if self.depth:
            self.now = (self.now + 1) % self.depth
            self.old_x[self.now], self.old_v[self.now] = st.x, st.v

    def stimulus(self, i: Ints, j: Ints, st: State) -> tuple[Array, Array, Array]:
        """Gap (m), own speed and leader speed (m/s) to which the drivers i answer now; own speed is felt at once."""
        length = self.fleet.length
        if not self.depth:
            return st.gap(i, j, length), st.v[i], st.v[j]
        row = (self.now - self.steps[i]) % self.depth
        d = (self.old_x[row, j] - self.old_x[row, i]) % st.wrap
        return d - length[j], st.v[i], st.v[i] + self.old_v[row, j] - self.old_v[row, i]

    def gap_factor(self, i: Ints, j: Ints, st: State) -> Array | float:
        """Factor on the desired time gap of the drivers i behind j."""
        v, k = st.v[i], self.size[i]
        if self.name == "speed_gap":
            return 1.0 + k * np.clip(1.0 - v / 20.0, 0.0, 1.0)
        if self.name == "hysteresis":
            return 1.0 + k * self.phase[i]
        if self.name == "resignation":
            return 1.0 + k * (1.0 - self.content[i])
        if self.name == "truck_gap":
            return 1.0 + k * (self.fleet.truck[j] & ~self.fleet.truck[i])
        if self.name == "side_friction":
            return 1.0 + k * np.nan_to_num(np.clip((v - st.adj[i]) / 10.0, -0.6, 1.0))
        return 1.0

    def extra(self, i: Ints, j: Ints, s: Array, st: State) -> Array | float:
        """Acceleration (m/s2) on top of the base model for the drivers i behind j at gap s (m)."""
        k, fade = self.size[i], np.clip(2.0 - s / FREE_HEADWAY, 0.0, 1.0)
        if self.name == "second_leader":
            j2 = st.lead[j]
            s2 = s + st.gap(j, j2, self.fleet.length) + self.fleet.length[j]
            near = np.clip(2.0 - s2 / FREE_HEADWAY, 0.0, 1.0)
            return k * near * np.clip(st.v[j2] - st.v[i], -6.0, 6.0)
        if self.name == "brake_light":
            return k * fade * np.minimum(st.a[j] + 0.2, 0.0)
        if self.name == "sag":
            return -9.81 * k * (gradient(st.x[i], self.sag_start, st.wrap) - self.made_up[i])
        return 0.0

    def act(self, i: Ints, want: Array, noise: Array, st: State, dice: Array) -> Array:
        """Acceleration (m/s2) that the drivers i apply, given the wanted one; also updates their memory."""
        dt = self.dt
        applied = want + noise
        if self.name == "action_points":
            sudden = (want < self.held[i] - 0.8) | (np.abs(want - self.held[i]) > 1.2)
            applied = self.held[i] = np.where(sudden | (dice[i] < dt / self.size[i]), applied, self.held[i])
        if self.name == "hysteresis":
            self.phase[i] += dt / PHASE_TIME * (np.tanh(applied / 0.4) - self.phase[i])
        elif self.name == "resignation":
            self.content[i] += dt / RESIGN_TIME * (np.minimum(st.v[i] / self.fleet.v0[i], 1.0) - self.content[i])
        elif self.name == "sag":
            lack = gradient(st.x[i], self.sag_start, st.wrap) - self.made_up[i]
            self.made_up[i] += np.minimum(lack, COMPENSATION * dt)
        return applied
