"""The measurement chain of fixed cameras: noise, seams, clocks, smoothing, speeds, lanes by marking.

Sources
-------
Thiemann, Treiber & Kesting (2008), Estimating acceleration and lane-changing dynamics from NGSIM data, TRR 2088: noise
    of positions; symmetric exponential moving averages of 0.5 s.
Punzo, Borzacchiello & Ciuffo (2011), Assessment of vehicle trajectory data accuracy, Transp. Res. C 19: errors differ
    between cameras and are correlated in time.
Montanino & Punzo (2013, 2015), Trajectory data reconstruction, TRR 2390, Transp. Res. B 80: low-pass filters, 1 Hz.
Coifman & Li (2017), Critical evaluation of NGSIM, Transp. Res. B 105: errors at the seams of cameras.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import pandas as pd
from scipy.signal import butter, lfilter, savgol_filter, sosfiltfilt

from .traffic import Setting

COLUMNS = (
    "track_id", "frame", "time", "position", "lateral", "speed", "acceleration", "lane", "length", "width",
    "vehicle_class",
)  # fmt: skip


@dataclass
class Chain:
    """Parameters of the measurement, in SI units."""

    cameras: int
    shake: float  # standard deviation of a camera's common error of position [m]
    shake_time: float  # its correlation time [s]
    track_noise: float  # standard deviation of a track's own error of position [m]
    track_time: float  # its correlation time [s]
    lateral_noise: float  # [m]
    distortion: float  # amplitude of the error of rectification along the road [m]
    distortion_wave: float  # its wave length [m]
    size_error: float  # of lengths [m]
    release: str  # smoothing before release: none, exponential, butterworth, savgol
    release_time: float  # its time [s]
    speeds: str  # from positions, or measured with noise of their own
    speed_noise: float  # standard deviation of speeds that are measured [m/s]
    clock_offset: float  # lateness of every second camera [s]

    def as_dict(self) -> dict:
        return asdict(self)


def draw_chain(rng: np.random.Generator, length: float, clock_offset: float) -> Chain:
    """A measurement chain as researchers have it: half of the releases are smoothed."""
    return Chain(
        cameras=max(2, round(length / rng.uniform(200.0, 350.0))),
        shake=float(rng.uniform(0.03, 0.10)),
        shake_time=float(rng.uniform(1.5, 5.0)),
        track_noise=float(rng.uniform(0.06, 0.22)),
        track_time=float(rng.uniform(0.8, 2.0)),
        lateral_noise=float(rng.uniform(0.04, 0.10)),
        distortion=float(rng.uniform(0.05, 0.30)),
        distortion_wave=float(rng.uniform(150.0, 400.0)),
        size_error=float(rng.uniform(0.05, 0.20)),
        release=str(rng.choice(["none", "none", "none", "exponential", "butterworth", "savgol"])),
        release_time=float(rng.uniform(0.5, 1.0)),
        speeds=str(rng.choice(["positions", "positions", "own"])),
        speed_noise=float(rng.uniform(0.10, 0.25)),
        clock_offset=clock_offset,
    )


def coloured(rng: np.random.Generator, n: int, tau: float, dt: float) -> np.ndarray:
    """Gaussian noise of unit variance with correlation time `tau` [s], differentiable: two low passes in series."""
    keep = float(np.exp(-2.0 * dt / tau))
    before = int(4 * tau / dt)
    white = rng.standard_normal(n + before)
    once = lfilter([1.0 - keep], [1.0, -keep], white)
    twice = np.asarray(lfilter([1.0 - keep], [1.0, -keep], once))[before:]
    # variance of two equal first-order filters in series
    gain = (1.0 - keep) ** 4 * (1.0 + keep**2) / (1.0 - keep**2) ** 3
    return twice / np.sqrt(gain)


def smoothed(values: np.ndarray, kind: str, seconds: float, fps: int) -> np.ndarray:
    """Smooth a track before release; `seconds` is the width of the kernel, or the inverse of twice the cut-off."""
    n = len(values)
    if kind == "none" or n < 10:
        return values
    if kind == "exponential":
        reach = int(min(3 * seconds * fps, n - 1))
        kernel = np.exp(-np.abs(np.arange(-reach, reach + 1)) / (0.5 * seconds * fps))
        ends = np.concatenate(
            [2 * values[0] - values[reach:0:-1], values, 2 * values[-1] - values[-2 : -reach - 2 : -1]]
        )
        return np.convolve(ends, kernel / kernel.sum(), mode="valid")
    if kind == "butterworth":
        cut = min(0.5 / seconds, 0.45 * fps)
        return np.asarray(sosfiltfilt(butter(2, cut, fs=fps, output="sos"), values, padlen=min(n - 1, 3 * fps)))
    width = min(int(seconds * fps) | 1, (n - 1) | 1)
    width = width if width <= n else width - 2
    return np.asarray(savgol_filter(values, max(width, 5), 2))


def slope(values: np.ndarray, seconds: float, fps: int) -> np.ndarray:
    """Derivative by local parabolas over `seconds`."""
    width = max(5, int(seconds * fps) | 1)
    if len(values) < width:
        return np.gradient(values) * fps
    return np.asarray(savgol_filter(values, width, 2, deriv=1, delta=1.0 / fps))


class Cameras:
    """Cameras that stand along the road; near a seam the images of two are blended over 30 m."""

    def __init__(self, chain: Chain, setting: Setting, frames: int, rng: np.random.Generator):
        self.chain, self.fps = chain, setting.fps
        self.seams = np.linspace(0.0, setting.length, chain.cameras + 1)[1:-1]
        dt = 1.0 / setting.fps
        self.shake = chain.shake * np.array([coloured(rng, frames, chain.shake_time, dt) for _ in range(chain.cameras)])
        self.sway = 0.4 * np.array([coloured(rng, frames, chain.shake_time, dt) for _ in range(chain.cameras)])
        self.sway *= chain.shake
        self.phase = rng.uniform(0.0, 2.0 * np.pi)

    def blend(self, x: np.ndarray) -> np.ndarray:
        """Camera number with fractions near seams."""
        return np.sum([np.clip((x - seam) / 30.0 + 0.5, 0.0, 1.0) for seam in self.seams], axis=0)

    def common(self, errors: np.ndarray, x: np.ndarray, frame: np.ndarray) -> np.ndarray:
        """Error that all vehicles before a camera share."""
        place = self.blend(x)
        low = np.minimum(place.astype(int), len(errors) - 2)
        part = place - low
        return (1.0 - part) * errors[low, frame] + part * errors[low + 1, frame]

    def late(self, x: np.ndarray) -> np.ndarray:
        """Lateness [s] of the camera that sees position `x`: odd cameras have it."""
        place = self.blend(x)
        low = np.floor(place).astype(int)
        part = place - low
        return self.chain.clock_offset * ((1.0 - part) * (low % 2) + part * ((low + 1) % 2))

    def bend(self, x: np.ndarray) -> np.ndarray:
        """Error of rectification, fixed in place."""
        return self.chain.distortion * np.sin(2.0 * np.pi * x / self.chain.distortion_wave + self.phase)


def measure(
    raw: dict[str, np.ndarray], sizes: pd.DataFrame, setting: Setting, chain: Chain, seed: np.random.SeedSequence
) -> tuple[pd.DataFrame, np.ndarray]:
    """The released table, and the vehicle of each track.

    `raw` has veh, frame, x (centre), y, v, sorted by vehicle and frame; rows of `sizes` are vehicles.
    """
    rng = np.random.default_rng(seed)
    fps, dt = setting.fps, 1.0 / setting.fps
    frames = int(raw["frame"].max()) + 1
    cameras = Cameras(chain, setting, frames, rng)
    starts = np.flatnonzero(np.diff(raw["veh"], prepend=-1))
    ends = np.append(starts[1:], len(raw["veh"]))
    parts: dict[str, list[np.ndarray]] = {name: [] for name in COLUMNS}
    tall, broad, lorry = (sizes[name].to_numpy() for name in ("length", "width", "truck"))
    for begin, end in zip(starts, ends, strict=True):
        own = np.random.default_rng(rng.integers(2**63))
        frame, x, y, v = (raw[k][begin:end] for k in ("frame", "x", "y", "v"))
        n = end - begin
        if n < 2.0 * fps:
            continue
        if chain.clock_offset:
            now = frame * dt
            then = now - cameras.late(x)
            early = np.minimum(then - now[0], 0.0) * v[0]
            x = np.interp(then, now, x) + early
            v = np.interp(then, now, v)
        error = cameras.common(cameras.shake, x, frame) + cameras.bend(x)
        error += chain.track_noise * coloured(own, n, chain.track_time, dt)
        aside = cameras.common(cameras.sway, x, frame) + chain.lateral_noise * coloured(own, n, chain.track_time, dt)
        place = smoothed(x + error, chain.release, chain.release_time, fps)
        lateral = smoothed(y + aside, chain.release, chain.release_time, fps)
        if chain.speeds == "positions":
            # without smoothing before release, speeds come from parabolas over 0.8 s
            speed = slope(place, 0.8 if chain.release == "none" else 5.0 / fps, fps)
        else:
            speed = v * (1.0 + 0.004 * own.standard_normal()) + chain.speed_noise * coloured(own, n, 0.6, dt)
            speed = smoothed(speed, chain.release, chain.release_time, fps)
        speed = np.maximum(speed, 0.0)
        veh = int(raw["veh"][begin])
        size = max(3.0, float(tall[veh]) + chain.size_error * own.standard_normal())
        breadth = float(broad[veh]) + 0.4 * chain.size_error * own.standard_normal()
        lane = np.clip(np.floor(lateral / setting.lane_width), 0, setting.lanes - 1)
        rows = (veh, frame, frame * dt, place, lateral, speed, slope(speed, 1.0, fps), lane, size, breadth, lorry[veh])
        for name, values in zip(COLUMNS, rows, strict=True):
            parts[name].append(np.broadcast_to(values, n))
    columns = {name: np.concatenate(values) for name, values in parts.items()}
    # number the tracks by first appearance; the rows of a track are contiguous and begin with its first frame
    veh, first, length = np.unique(columns["track_id"], return_index=True, return_counts=True)
    order = np.lexsort((veh, columns["frame"][first]))
    rows = np.concatenate([np.arange(int(first[k]), int(first[k] + length[k])) for k in order])
    columns = {name: values[rows] for name, values in columns.items()}
    columns["track_id"] = np.repeat(np.arange(1, len(order) + 1), length[order])
    columns["vehicle_class"] = np.where(columns["vehicle_class"], "truck", "car")
    for name in ("position", "lateral", "speed", "acceleration"):
        columns[name] = np.round(columns[name], 3)
    for name, digits in (("time", 4), ("length", 2), ("width", 2)):
        columns[name] = np.round(columns[name], digits)
    for name in ("track_id", "frame", "lane"):
        columns[name] = columns[name].astype(np.int64)
    return pd.DataFrame(columns), veh[order]
