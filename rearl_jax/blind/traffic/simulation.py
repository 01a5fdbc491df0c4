"""Simulation of the traffic of a scenario, all recordings at once.

Positions follow the ballistic rule, x + (v + v') dt / 2 (Treiber & Kanagaraj, Physica A 419 (2015) 183).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from rearl_jax.blind.traffic.catalogue import HIDDEN, LANE_CHOICE
from rearl_jax.blind.traffic.driving import wanted_acceleration, with_emergencies
from rearl_jax.blind.traffic.effect import HiddenEffect
from rearl_jax.blind.traffic.fleet import Fleet, draw_fleet
from rearl_jax.blind.traffic.free_changes import FreeChanges
from rearl_jax.blind.traffic.lane_changes import ForcedChanges
from rearl_jax.blind.traffic.models import BASES, Drivers
from rearl_jax.blind.traffic.platoon_leaders import draw_profiles
from rearl_jax.blind.traffic.scenario import SUB_STEP, Scenario
from rearl_jax.blind.traffic.snapshot import Snapshot

WARM_UP = 12.0
"""Simulated time before the recording [s]."""

COOL_DOWN = 5.0
"""Simulated time after the recording [s], which delayed measurements need."""

WANDER, WANDER_TIME = 0.25, 4.0
"""Standard deviation [m] and correlation time [s] of the vehicle's lateral offset from the centre of the lane."""

SAMPLING_STEPS = 5
"""Sub-steps from one sample of the accelerations that hidden effects cause to the next."""

MARGIN = 60.0
"""Position of the last vehicle at the start of the warm-up [m]."""


@dataclass(frozen=True)
class Events:
    """True motion of all vehicles: arrays `[sub-steps, vehicles]`.

    Attributes:
        time: Time of each sub-step from the start of the recording [s], negative in the warm-up.
        position, speed, acceleration, wander: Position [m], speed [m/s], acceleration [m/s^2], lateral offset from the
            centre of the lane [m].
        lane: Lane, 0 = leftmost.
        leader: Index of the vehicle ahead; the number of vehicles if there is none.
        fleet: The vehicles.
        effects: Hidden effects.
        section: Part of the road that most vehicles reach and leave [m].
        n_emergencies: Number of emergency-braking sub-steps, summed over the followers.
        effect_size: Root mean square of the accelerations that hidden effects cause in recorded followers [m/s^2].
    """

    time: np.ndarray
    position: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    wander: np.ndarray
    lane: np.ndarray
    leader: np.ndarray
    fleet: Fleet
    effects: tuple[HiddenEffect, ...]
    section: tuple[float, float]
    n_emergencies: int
    effect_size: float = 0.0


def simulate(scenario: Scenario) -> Events:
    """The traffic of all recordings of a data set."""
    streams = np.random.default_rng([scenario.seed, 5]).spawn(7)
    seconds = WARM_UP + scenario.duration + COOL_DOWN
    fleet = draw_fleet(scenario, streams[0])
    profiles = draw_profiles(scenario.n_recordings * scenario.n_lanes, seconds, scenario.pace, streams[1])
    platoon_leaders = np.flatnonzero(fleet.rank == 0)
    effect_classes = HIDDEN | LANE_CHOICE
    effects = tuple(
        effect_classes[item.name](item.strength) for item in scenario.planted if item.name in effect_classes
    )
    position, speed, travelled = place_platoons(scenario, fleet, profiles)
    now = Snapshot(scenario, fleet, position, speed)
    now.time = -WARM_UP
    section = common_section(scenario, now, travelled, platoon_leaders, streams[2])
    for effect in effects:
        effect.begin(now, section, streams[5])
    n_steps = profiles.shape[1] - 1
    noise = _ornstein_uhlenbeck(n_steps, now.n, scenario.driver_noise_time, streams[3]) * scenario.driver_noise
    noise *= np.exp(scenario.noise_spread * streams[6].standard_normal(now.n))
    wander = np.clip(WANDER * _ornstein_uhlenbeck(n_steps, now.n, WANDER_TIME, streams[4]), -0.65, 0.65)
    changes = ForcedChanges(scenario, now.n, streams[2])
    if scenario.free_changes:
        changes = FreeChanges(now.n, effects, streams[2])
    log, n_emergencies, effect_size = _drive(scenario, now, effects, profiles, noise, wander, changes)
    time = SUB_STEP * np.arange(n_steps) - WARM_UP
    return Events(
        time, **log, wander=wander, fleet=fleet, effects=effects, section=section, n_emergencies=n_emergencies,
        effect_size=effect_size,
    )  # fmt: skip


def _drive(
    scenario: Scenario,
    now: Snapshot,
    effects: Sequence[HiddenEffect],
    profiles: np.ndarray,
    noise: np.ndarray,
    wander: np.ndarray,
    changes: ForcedChanges | FreeChanges,
) -> tuple[dict[str, np.ndarray], int, float]:
    """Motion in every sub-step, `[sub-steps, vehicles]`, and `n_emergencies` and `effect_size` as in `Events`."""
    n_steps, n, platoon_leaders = len(noise), now.n, np.flatnonzero(now.fleet.rank == 0)
    log = {name: np.empty((n_steps, now.n)) for name in ("position", "speed", "acceleration")}
    log |= {"lane": np.empty((n_steps, now.n), dtype=np.int8), "leader": np.empty((n_steps, now.n), dtype=np.int32)}
    n_emergencies, by_effects = 0, [np.zeros(n)]  # the zeros are used only if there are no samples
    for step in range(n_steps):
        now.step, now.time, now.wander = step, step * SUB_STEP - WARM_UP, wander[step]
        changes.carry_out(now)
        for effect in effects:
            effect.observe(now, SUB_STEP)
        without_effects = wanted_acceleration(now, ()) if effects and step % SAMPLING_STEPS == 0 else None
        wanted = wanted_acceleration(now, effects)
        if without_effects is not None and 0.0 <= now.time <= scenario.duration:
            by_effects.append(wanted - without_effects)
        driver_noise = noise[step] * (1.0 + scenario.noise_growth * np.abs(now.acceleration[:n]))
        value, in_emergency = with_emergencies(wanted + driver_noise, now)
        value[platoon_leaders] = (profiles[:, step + 1] - profiles[:, step]) / SUB_STEP
        new_speed = np.maximum(0.0, now.speed[:n] + SUB_STEP * value)
        log["position"][step], log["speed"][step] = now.position[:n], now.speed[:n]
        log["lane"][step], log["leader"][step] = now.lane, now.leader
        now.acceleration[:n] = log["acceleration"][step] = (new_speed - now.speed[:n]) / SUB_STEP
        now.position[:n] += 0.5 * SUB_STEP * (now.speed[:n] + new_speed)
        now.speed[:n] = new_speed
        n_emergencies += int(np.count_nonzero(in_emergency & (now.fleet.rank > 0)))
    of_followers = np.stack(by_effects[1:] or by_effects)[:, now.fleet.rank > 0]
    return log, n_emergencies, float(np.sqrt(np.mean(of_followers**2)))


def place_platoons(scenario: Scenario, fleet: Fleet, profiles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Initial positions [m] and speeds [m/s], and the distances that platoon leaders have travelled at every sub-step.

    Every driver starts near the desired gap. The distances [m] are an array `[platoon leaders, sub-steps]`, like
    `profiles`, the speeds of the platoon leaders [m/s].
    """
    per_lane = scenario.n_vehicles // scenario.n_lanes
    speed = np.minimum(np.repeat(profiles[:, 0], per_lane), 0.85 * fleet.desired_speed)
    drivers = Drivers(speed, fleet.desired_speed, fleet.time_gap, fleet)
    gap = scenario.spacing * BASES[scenario.base].equilibrium_gap(drivers)
    length = fleet.length.reshape(-1, per_lane)
    step = gap.reshape(-1, per_lane) + 0.5 * (length + np.roll(length, 1, axis=1))
    step[:, 0] = 0.0
    distance = np.cumsum(0.5 * SUB_STEP * (profiles[:, 1:] + profiles[:, :-1]), axis=1)
    travelled = np.concatenate([np.zeros((len(profiles), 1)), distance], axis=1)
    # Slower lanes start further ahead, so that all lanes are side by side in the middle of the recording.
    position = -np.cumsum(step, axis=1) - 0.5 * (travelled[:, -1:] - travelled[:, -1:].mean())
    speed[fleet.rank == 0] = profiles[:, 0]
    return (position - position.min() + MARGIN).ravel(), speed, travelled


def common_section(
    scenario: Scenario, now: Snapshot, travelled: np.ndarray, platoon_leaders: np.ndarray, rng: np.random.Generator
) -> tuple[float, float]:
    """Start and end of a section of the road that most vehicles pass while recorded [m].

    `travelled` are the distances travelled by the platoon leaders, from `place_platoons`.
    """
    middle = travelled[:, travelled.shape[1] // 2]
    platoon = now.position[platoon_leaders].mean() - now.position[: now.n].min()
    centre = float(np.mean(now.position[platoon_leaders] + middle) - 0.45 * platoon + rng.uniform(-60.0, 60.0))
    half = float(rng.uniform(100.0, 170.0)) if scenario.view is None else 0.25 * scenario.view
    return centre - half, centre + half


def _ornstein_uhlenbeck(n_steps: int, n: int, correlation_time: float, rng: np.random.Generator) -> np.ndarray:
    """Ornstein-Uhlenbeck processes of unit variance and a correlation time [s], `[sub-steps, vehicles]`."""
    decay = np.exp(-SUB_STEP / correlation_time)
    drawn = np.sqrt(1.0 - decay**2) * rng.standard_normal((n_steps, n))
    drawn[0] = rng.standard_normal(n)
    return np.asarray(lfilter([1.0], [1.0, -decay], drawn, axis=0))
