"""Small recordings for tests of scenes, and scenes cut from them."""

import numpy as np
import pandas as pd

from rearl_jax.config import PrepareTask
from rearl_jax.config.scenes import (
    FeatureDistance,
    FeaturesConfig,
    ScenesConfig,
    SpacingConfig,
    SpacingMetric,
    SpeedConfig,
    SpeedNorm,
)
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.data.scenes.cutting import build_scenes

SMALL = ScenesConfig(seconds=6, min_vehicles=4, slots=4)


def build(
    recordings,
    scenes=SMALL,
    norm=SpeedNorm.minmax,
    d=FeatureDistance.mean_all,
    metric=SpacingMetric.euclid2d,
    progress=None,
):
    keys = PrepareTask(
        scenes=scenes, speed=SpeedConfig(norm), features=FeaturesConfig(d), spacing=SpacingConfig(metric)
    )
    return build_scenes(recordings, keys, progress)


def recording(*tracks, name="a", rate=10.0) -> Recording:
    """A recording of tracks: dictionaries with `id`, `frames` and, where they matter, the other columns."""
    rows = []
    for track in tracks:
        frames = np.asarray(track["frames"])
        position = track.get("position", 5.0 * track["id"] + 2.0 * (frames - frames[0]))
        rows.append(
            pd.DataFrame(
                {
                    "track_id": track["id"],
                    "frame": frames,
                    "direction": np.int8(track.get("direction", 1)),
                    "x": track.get("x", position),
                    "y": track.get("y", 0.0),
                    "position": position,
                    "lane": track.get("lane", 0),
                    "speed": track.get("speed", 10.0 + track["id"]),
                    "length": track.get("length", 4.5),
                }
            )
        )
    table = pd.concat(rows, ignore_index=True).astype({"lane": "Int8", "x": float, "speed": float})
    info = RecordingInfo(name, rate, {1: 2, 2: 2}, 400.0, "made for a test", "none", "nobody", generated=True)
    return Recording(info, table)


def standing(n_vehicles, n_frames=60, first=0, **columns):
    """Vehicles 1 to n that are recorded from `first` on for `n_frames` frames."""
    return [{"id": i + 1, "frames": np.arange(first, first + n_frames), **columns} for i in range(n_vehicles)]


def busy_recording(seed: int, rate: float, name: str = "busy") -> Recording:
    """Traffic of both directions, entries, exits and lane changes at random; about seven vehicles at once."""
    rng = np.random.default_rng(seed)
    tracks = []
    for i in range(1, 90):
        n_frames = int(rng.integers(int(0.5 * rate), int(9 * rate)))
        first = 17 + int(rng.integers(0, int(60 * rate)))
        direction = int(rng.integers(1, 3))
        speed = np.abs(rng.normal(25, 4) + np.cumsum(rng.normal(0, 2 / np.sqrt(rate), n_frames)))
        position = np.cumsum(speed) / rate
        lane = (rng.integers(0, 2) + (np.arange(n_frames) > rng.integers(0, n_frames))) % 2
        x = position if direction == 2 else 400.0 - position
        y = 4.0 * lane + 12.0 * direction
        track = {
            "frames": np.arange(first, first + n_frames),
            "direction": direction,
            "length": rng.uniform(4, 15),
        }
        tracks.append(track | {"id": i * 3, "x": x, "y": y, "position": position, "lane": lane, "speed": speed})
    return recording(*tracks, name=name, rate=rate)
