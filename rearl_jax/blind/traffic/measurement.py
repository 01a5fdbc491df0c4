"""Measurement of generated traffic as a data provider would release it: frames, noise, derived speeds, faults."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import savgol_filter

from rearl_jax.blind.traffic.scenario import Scenario
from rearl_jax.blind.traffic.simulation import WARM_UP, Events

LANE_WIDTH = 3.75
"""[m]"""

CHANGE_TIME = 4.0
"""Time of the sideways motion of a lane change [s]; it begins with the decision, as the lane column changes."""

LATERAL_NOISE = 0.04
"""Standard deviation of the measured lateral position [m]."""

DERIVATIVE_TIME = 1.1
"""Window of the parabola fit whose slope is the released speed [s]."""

GATE = 0.95
"""Error of a position [m] above which a tracker attributes it to another vehicle."""

PAD = 4.4
"""Additional measured time before and after the recording [s], needed by filters and delayed columns."""

MAX_CLOCK_OFFSET = 0.5
"""Bound of clock offsets, early or late [s]."""

ARTEFACTS = (
    "lens", "clock_offset", "position_lag", "speed_lag", "speed_scale", "position_scale", "smoothing", "position_noise",
)  # fmt: skip
"""Faults by their name in a scenario."""


@dataclass(frozen=True)
class Frames:
    """Measured columns, arrays `[frames, vehicles]`; `seen` marks vehicles in the view of the camera."""

    position: np.ndarray
    lateral: np.ndarray
    lane: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    seen: np.ndarray


def frame_times(scenario: Scenario) -> tuple[np.ndarray, slice]:
    """Times of all measured frames [s], from PAD before the recording to PAD after it, and which of them it has."""
    pad, n_frames = round(PAD * scenario.frame_rate), round(scenario.duration * scenario.frame_rate) + 1
    return np.arange(-pad, n_frames + pad) / scenario.frame_rate, slice(pad, pad + n_frames)


def measure(scenario: Scenario, events: Events) -> Frames:
    """The columns as a data provider releases them."""
    fault = {item.name: item.strength for item in scenario.planted if item.name in ARTEFACTS}
    rng = np.random.default_rng([scenario.seed, 6])
    rate = scenario.frame_rate
    time, recorded = frame_times(scenario)
    position = _sampled(events, time, _clock_offsets(events, fault, rng))
    true_position = position
    position = position + _lens(position, fault, events)
    position = position + _errors(scenario, position.shape, fault, rng)
    if "smoothing" in fault:
        position = gaussian_filter1d(position, 0.9 * fault["smoothing"] * rate, axis=0, mode="nearest")
    window = 2 * round(0.5 * DERIVATIVE_TIME * rate) + 1
    speed, acceleration = (
        np.asarray(savgol_filter(position, window, 2, deriv=order, delta=1.0 / rate, axis=0)) for order in (1, 2)
    )
    speed = np.maximum(0.0, speed * (1.0 + 0.05 * fault.get("speed_scale", 0.0)))
    # After speeds are derived: a scale error shared by speeds would be a change of unit and undetectable.
    position = position * (1.0 + 0.05 * fault.get("position_scale", 0.0))

    def released(column: np.ndarray, late_by: float = 0.0) -> np.ndarray:
        frames_late = round(late_by * rate)
        return column[recorded.start - frames_late : recorded.stop - frames_late]

    road_start, road_length = seen_road(scenario, events)
    lane, lateral = across(events, time[recorded], CHANGE_TIME, 0.0, rng)
    delay = {name: 0.5 * fault.get(name, 0.0) for name in ("position_lag", "speed_lag")}
    return Frames(
        released(position, delay["position_lag"]) - road_start,
        lateral,
        lane,
        released(speed, delay["speed_lag"]),
        np.clip(released(acceleration, delay["speed_lag"]), -30.0, 30.0),
        (released(true_position) >= road_start) & (released(true_position) <= road_start + road_length),
    )


def _sampled(events: Events, time: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Positions at the times of the frames on every vehicle's own clock [m]."""
    if not offsets.any():
        steps = np.searchsorted(events.time, time - 1e-6)
        return events.position[steps]
    columns = (np.interp(time + o, events.time, x) for o, x in zip(offsets, events.position.T, strict=True))
    return np.stack(list(columns), axis=1)


def _clock_offsets(events: Events, fault: dict[str, float], rng: np.random.Generator) -> np.ndarray:
    """Clock offset of every vehicle's logger [s]; positive if early."""
    drawn = rng.standard_normal(events.position.shape[1])
    return np.clip(0.2 * fault.get("clock_offset", 0.0) * drawn, -MAX_CLOCK_OFFSET, MAX_CLOCK_OFFSET)


def _lens(position: np.ndarray, fault: dict[str, float], events: Events) -> np.ndarray:
    """A smooth shift of up to 5 m that depends on the position in the image [m]."""
    if "lens" not in fault:
        return np.zeros_like(position)
    first = events.position[round(WARM_UP / (events.time[1] - events.time[0]))].mean()
    return 5.0 * fault["lens"] * np.sin(2.0 * np.pi * (position - first) / 520.0)


def _errors(
    scenario: Scenario, shape: tuple[int, ...], fault: dict[str, float], rng: np.random.Generator
) -> np.ndarray:
    """Errors of measured positions [m], white or as a smoothing tracker leaves them."""
    drawn = rng.standard_normal(shape)
    if scenario.noise_time > 0.0:
        drawn = gaussian_filter1d(drawn, scenario.noise_time * scenario.frame_rate, axis=0, mode="wrap")
        drawn /= drawn.std()
    size = scenario.position_noise * (1.0 + 3.0 * fault.get("position_noise", 0.0))
    return np.clip(size * drawn, -GATE, GATE)


def across(
    events: Events, time: np.ndarray, change_time: float, lane_delay: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Lane, and lateral position from the left edge of the leftmost lane [m], in every frame. The sideways motion of a
    lane change begins with the decision and takes `change_time` [s]; the lane changes `lane_delay` [s] after it.
    """
    lane = events.lane[np.searchsorted(events.time, time - lane_delay - 1e-6)]
    lateral = events.wander[np.searchsorted(events.time, time - 1e-6)] + LANE_WIDTH * (events.lane[0] + 0.5)
    for step, vehicle in zip(*np.nonzero(np.diff(events.lane, axis=0)), strict=True):
        share = np.clip((time - events.time[step + 1]) / change_time, 0.0, 1.0)
        jump = int(events.lane[step + 1, vehicle]) - int(events.lane[step, vehicle])
        # A path of minimum jerk.
        lateral[:, vehicle] += LANE_WIDTH * jump * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    return lane, lateral + LATERAL_NOISE * rng.standard_normal(lateral.shape)


def seen_road(scenario: Scenario, events: Events) -> tuple[float, float]:
    """Start and length of the recorded part of the road [m]: all of it, or the view of a camera."""
    if scenario.view is None:
        return 0.0, np.inf
    return 0.5 * (sum(events.section) - scenario.view), scenario.view
