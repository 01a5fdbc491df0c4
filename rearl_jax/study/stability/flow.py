"""Flow of drivers drawn at random: the fundamental diagram on rings, a queue that discharges on a road, collisions.

Densities of a ring are vehicles over its length, flows density times mean speed. The starting wave of a discharging
queue moves against traffic; the outflow is the flow of the vehicles that have started, at a cross-section downstream.
"""

from dataclasses import replace

import equinox as eqx
import jax
import numpy as np
import pandas as pd
from jaxtyping import Array, Float, Int, Key

from rearl_jax.config.stability import StabilityConfig
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import rollout
from rearl_jax.core.spawn import spawn
from rearl_jax.export.platoon import STEPS_PER_SECOND
from rearl_jax.models.population import Population
from rearl_jax.models.traffic import populate
from rearl_jax.study.stability.cases import Case
from rearl_jax.study.stability.roads import Motion, drive

MAX_DISPLACEMENT = 0.5
"""Largest displacement from equal spacing at the start [m]."""

MIN_WAVE_SPEED_SD = 1.0
"""Least standard deviation of the speeds on a ring [m/s] for which the speed of the wave is measured."""

STRONG_SHARE = 0.5
"""Least amplitude of the measured wave, as a share of the greatest amplitude of a wave with any number of crests [-]:
one narrow jam makes waves of all numbers about equally large.
"""

STARTED_SPEED = 2.0
"""Speed above which a vehicle of a queue counts as started [m/s]."""

DETECTOR_DISTANCE = 1000.0
"""Distance of the measured cross-section from the head of the queue [m], where most vehicles drive at their speed."""

N_FREE_LEADERS = 10
"""Vehicles at the head of the queue that are left out of outflow and wave speed: they drive more freely."""

QUEUE_SECONDS = 400
"""Simulated time of the queue [s]."""

SCENE_MODEL = TrafficModel(n_lanes=4, speed_limit=None, ticks_per_second=STEPS_PER_SECOND)
SCENE_VEHICLES, SCENE_SECONDS = 30, 60
"""Vehicles and length [s] of scenes with lane changes: those of `core.spawn`, as `rearl evaluate` simulates them."""

FLOW_COLUMNS = ("start", "density", "flow", "speed", "speed_sd", "wave_speed", "overlaps")
QUEUE_COLUMNS = ("outflow", "wave_speed", "overlaps")


def flow_table(case: Case, options: StabilityConfig) -> pd.DataFrame:
    """One row per start (`even`, `jam`) and density [vehicles/km], with FLOW_COLUMNS: `flow` [vehicles/h], `speed` and
    `speed_sd` [m/s], `wave_speed` of the largest wave (null without one) [m/s], `overlaps` of vehicles.
    """
    n, standing = options.flow_vehicles, case.standing_spacing
    density = np.array([value for value in options.densities if 1000 / value > standing])
    if not len(density):
        return pd.DataFrame(columns=list(FLOW_COLUMNS))
    spacing, order = 1000 / density, np.arange(n)[:, None]
    even = -order * spacing + np.random.default_rng(options.seed).uniform(-MAX_DISPLACEMENT, MAX_DISPLACEMENT, (n, 1))
    speed = np.tile([case.speed_at(distance - case.length) for distance in spacing], (n, 1))
    circumference = n * np.tile(spacing, 2)
    motion = drive(
        case.population,
        np.concatenate([even, np.tile(-order * standing, len(density))], axis=1),
        np.concatenate([speed, np.zeros_like(speed)], axis=1),
        seconds=options.flow_seconds,
        seed=options.seed,
        circumference=circumference,
    )
    last_third = motion.speed[-(options.flow_seconds // 3) :]
    mean, deviation = last_third.mean(axis=(0, 1)), last_third.std(axis=1).mean(axis=0)
    waves = wave_speeds(motion, circumference, len(last_third))
    columns = (
        np.repeat(["even", "jam"], len(density)),
        np.tile(density, 2),
        3.6 * np.tile(density, 2) * mean,
        mean,
        deviation,
        np.where(deviation >= MIN_WAVE_SPEED_SD, waves, np.nan),
        motion.overlaps.sum(axis=0),
    )
    return pd.DataFrame(dict(zip(FLOW_COLUMNS, columns, strict=True)))


def wave_speeds(
    motion: Motion, circumference: Float[np.ndarray, " rings"], seconds: int
) -> Float[np.ndarray, " rings"]:
    """Speed along the road of the largest wave [m/s], over the last seconds, from its phase over time.

    The wave is that with the fewest crests whose amplitude is at least STRONG_SHARE of the greatest.
    """
    position, speed = motion.position[-seconds:], motion.speed[-seconds:]
    angle = 2 * np.pi * position / circumference
    deviation, crests = speed - speed.mean(axis=1, keepdims=True), np.arange(1, speed.shape[1] // 2 + 1)
    waves = np.stack([(deviation * np.exp(-1j * n * angle)).sum(axis=1) for n in crests])  # [crests, seconds, rings]
    amplitude = np.abs(waves).mean(axis=1)
    chosen = (amplitude >= STRONG_SHARE * amplitude.max(axis=0)).argmax(axis=0)
    turned = -np.unwrap(np.angle(waves[chosen, :, np.arange(len(chosen))]), axis=1).T
    return np.polyfit(np.arange(seconds), turned, 1)[0] * circumference / (2 * np.pi * crests[chosen])


def queue_table(case: Case, options: StabilityConfig) -> pd.DataFrame:
    """One row: `outflow` [vehicles/h] and `wave_speed` [m/s] of a queue that discharges, null if it has not done so in
    QUEUE_SECONDS, and `overlaps` of its vehicles.
    """
    position = -np.arange(options.queue_vehicles)[:, None] * case.standing_spacing
    motion = drive(case.population, position, np.zeros_like(position), seconds=QUEUE_SECONDS, seed=options.seed)
    start = _first_time(motion.speed[:, :, 0], STARTED_SPEED)[N_FREE_LEADERS:]
    passed = _first_time(motion.position[:, :, 0], DETECTOR_DISTANCE)[N_FREE_LEADERS:]
    outflow = wave_speed = np.nan
    if np.isfinite(passed).all():
        outflow = 3600 * (len(passed) - 1) / (passed[-1] - passed[0])
        wave_speed = np.polyfit(start, position[N_FREE_LEADERS:, 0], 1)[0]
    return pd.DataFrame([(outflow, wave_speed, int(motion.overlaps.sum()))], columns=list(QUEUE_COLUMNS))


def _first_time(values: Float[np.ndarray, "seconds vehicles"], threshold: float) -> Float[np.ndarray, " vehicles"]:
    """Time [s] at which each series first reaches a threshold, interpolated; nan where it does not."""
    reached = values >= threshold
    after = reached.argmax(axis=0)
    before, vehicle = np.maximum(after - 1, 0), np.arange(values.shape[1])
    step = values[after, vehicle] - values[before, vehicle]
    share = (threshold - values[before, vehicle]) / np.where(step > 0, step, 1.0)
    return np.where(reached.any(axis=0), before + 1 + np.where(step > 0, share, 0.0), np.nan)


def traffic_table(case: Case, flow: pd.DataFrame, queue: pd.DataFrame, options: StabilityConfig) -> pd.DataFrame:
    """One row per `traffic`: vehicles that `collided` (on one lane those that came to overlap their
    leader), `vehicle_hours` [h] and `per_vehicle_hour` [1/h].
    """
    hours = {
        "rings": len(flow) * options.flow_vehicles * options.flow_seconds / 3600,
        "queue": options.queue_vehicles * QUEUE_SECONDS / 3600,
        "scenes with lane changes": options.scenes * SCENE_VEHICLES * SCENE_SECONDS / 3600,
    }
    crashed = _crashed(jax.random.split(jax.random.key(options.seed), options.scenes), case.population)
    collided = (sum(flow["overlaps"].tolist()), sum(queue["overlaps"].tolist()), int(crashed))
    table = pd.DataFrame({"traffic": list(hours), "collided": collided, "vehicle_hours": list(hours.values())})
    return table.assign(per_vehicle_hour=table["collided"] / table["vehicle_hours"].replace(0.0, np.nan))


@eqx.filter_jit
def _crashed(keys: Key[Array, " scenarios"], population: Population) -> Int[Array, ""]:
    """Vehicles that collide in scenes with lane changes."""
    # Politeness is known only when the program runs, so any lane changing counts as cooperative.
    scene = replace(SCENE_MODEL, cooperative=population.lane_changing is not None)
    state, drivers = spawn(keys, scene, n_vehicles=SCENE_VEHICLES, dtype=population.median.dtype)
    state, drivers = populate(state, drivers, keys, population, scene)
    after, _ = rollout(state, drivers, scene, n_seconds=SCENE_SECONDS)
    return after.crashed.sum()
