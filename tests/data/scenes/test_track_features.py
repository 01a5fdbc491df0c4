"""Feature curves against plain loops, and what happens to short and lonely tracks."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config import PrepareTask
from rearl_jax.config.scenes import (
    Direction,
    FeatureDistance,
    FeaturesConfig,
    ScenesConfig,
    TracksConfig,
)
from rearl_jax.data.records import Recording
from rearl_jax.data.scenes.track_features import track_features
from tests.data.scenes.made_recordings import recording


def traffic(spans: dict[int, tuple[int, int]], seed: int = 0) -> Recording:
    """Tracks by id, recorded from the first to before the last of two frames."""
    rng = np.random.default_rng(seed)
    tracks = []
    for track_id, (first, end) in spans.items():
        frames = np.arange(first, end)
        speed = 20.0 + np.cumsum(rng.normal(0, 0.3, len(frames)))
        position = rng.uniform(0, 50) + np.cumsum(speed) / 10.0
        track = {"id": track_id, "frames": frames, "direction": 1 + track_id % 2, "lane": track_id % 3}
        tracks.append(track | {"y": 4.0 * (track_id % 3), "position": position, "speed": speed, "length": 4.0})
    return recording(*tracks)


def curves(source, points=16, d=FeatureDistance.mean_all, direction=Direction.pooled, min_frames=20):
    tracks = TracksConfig(min_frames, points)
    return track_features(
        source, PrepareTask(scenes=ScenesConfig(direction), tracks=tracks, features=FeaturesConfig(d))
    )


@pytest.mark.parametrize("direction", Direction)
def test_curves_equal_plain_loops(direction):
    source = traffic({1: (0, 80), 2: (10, 95), 5: (5, 60), 6: (20, 90), 7: (0, 19), 8: (15, 35), 9: (33, 90)})
    table = source.table
    built = curves(source, direction=direction)
    np.testing.assert_array_equal(built.track_id, [1, 2, 5, 6, 8, 9])
    np.testing.assert_array_equal(built.n_frames, [80, 85, 55, 70, 20, 57])
    assert (built.n_short, built.n_alone) == (1, 0)
    for row, track_id in enumerate(built.track_id):
        own = table[table["track_id"] == track_id]
        distance = []
        for frame, x, y in zip(own["frame"], own["x"], own["y"], strict=True):
            others = table[(table["frame"] == frame) & (table["track_id"] != track_id)]
            if direction is Direction.per_direction:
                others = others[others["direction"] == own["direction"].iloc[0]]
            values = np.hypot(others["x"] - x, others["y"] - y)
            distance.append(values.mean() if len(values) else np.nan)
        distance = pd.Series(distance).ffill().bfill()
        at = np.linspace(own["frame"].iloc[0], own["frame"].iloc[-1], 16)
        for name, values in (("speed", own["speed"]), ("position", own["position"]), ("distance", distance)):
            expected = np.interp(at, own["frame"], values)
            np.testing.assert_allclose(getattr(built, name)[row], expected, rtol=1e-6)


def test_distance_headway_of_curves():
    source = traffic({3: (0, 50), 9: (0, 50)})
    built = curves(source, points=50, d=FeatureDistance.dhw)
    ahead = np.diff(source.table["position"].to_numpy().reshape(2, 50), axis=0)[0]
    assert (np.abs(ahead) > 4.0).any()
    np.testing.assert_allclose(built.distance[0], np.where(ahead > 0, np.maximum(ahead - 4.0, 0.0), 0.0), rtol=1e-5)
    np.testing.assert_allclose(built.distance[1], np.where(ahead < 0, np.maximum(-ahead - 4.0, 0.0), 0.0), rtol=1e-5)


def test_a_lonely_track_is_left_out_and_counted():
    built = curves(traffic({1: (0, 40), 2: (20, 60), 3: (100, 140)}))
    np.testing.assert_array_equal(built.track_id, [1, 2])
    assert built.n_alone == 1
    # Alone at first: the first value in company holds back to the entry.
    assert (built.distance[0, :8] == built.distance[0, 0]).all()
    assert np.isfinite(built.distance).all()
