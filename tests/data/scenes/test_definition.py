"""Scenes against a slow reading of their definition."""

from types import SimpleNamespace

import numpy as np
import pytest

from rearl_jax.config.scenes import (
    Direction,
    FeatureDistance,
    Pick,
    ScenesConfig,
    SpacingMetric,
)
from rearl_jax.data.records import Recording
from rearl_jax.data.scenes.scene_set import recorded_lane_change_rate
from tests.data.scenes.made_recordings import SMALL, build, busy_recording


def oracle(recording: Recording, scenes: ScenesConfig, d: FeatureDistance, metric: SpacingMetric):
    """Accepted scenes by plain loops: [(window, [[slot, ...] per snapshot])], and the number of windows."""
    rate, table = recording.info.frame_rate, recording.table
    by_track = {i: rows.set_index("frame") for i, rows in table.groupby("track_id")}
    pooled = scenes.direction is Direction.pooled
    groups = [(1, 2)] if pooled else [(1,), (2,)]
    first, last = table["frame"].min(), table["frame"].max()

    def distance(a, b):
        return abs(a.x - b.x) if metric is SpacingMetric.longitudinal else np.hypot(a.x - b.x, a.y - b.y)

    def feature(own, others):
        if d is FeatureDistance.mean_all:
            return np.mean([distance(own, other) for other in others])
        lane = [o for o in others if (o.lane, o.direction) == (own.lane, own.direction) and o.position > own.position]
        leader = min(lane, key=lambda o: o.position, default=None)
        if leader is None:
            return 0.0
        return max(0.0, leader.position - own.position - (leader.length + own.length) / 2)

    def snapshot(frame, directions):
        present = []
        for i, rows in by_track.items():
            if frame in rows.index and rows.loc[frame, "direction"] in directions:
                elapsed = frame - rows.index[0]
                seniority = elapsed if scenes.pick is Pick.elapsed else len(rows)
                row = SimpleNamespace(**rows.loc[frame].to_dict(), id=i, seniority=seniority)
                row.next = rows.loc[frame + rate].to_dict() if frame + rate in rows.index else None
                present.append(row)
        present.sort(key=lambda row: (-row.seniority, row.id))
        for row in present:
            row.feature = feature(row, [o for o in present if o is not row]) if len(present) > 1 else None
        return present

    accepted, n_windows, window = [], 0, 0
    while first + rate * (window * scenes.stride_seconds + scenes.seconds) - 1 <= last:
        start = int(first + rate * window * scenes.stride_seconds)
        for directions in groups:
            frames = [snapshot(start + int(k * rate), directions) for k in range(scenes.seconds)]
            n_windows += 1
            if min(len(vehicles) for vehicles in frames) >= scenes.min_vehicles:
                picked = [vehicles[: scenes.slots] for vehicles in frames]
                for vehicles in picked:
                    for row in vehicles:
                        row.spacing = np.mean([distance(row, other) for other in vehicles if other is not row])
                accepted.append((window, start, picked))
        window += 1
    return accepted, n_windows


@pytest.mark.parametrize(
    ("rate", "scenes", "d", "metric"),
    [
        (25.0, SMALL, FeatureDistance.mean_all, SpacingMetric.euclid2d),
        (
            10.0,
            ScenesConfig(seconds=5, min_vehicles=4, slots=3, stride=2.0),
            FeatureDistance.dhw,
            SpacingMetric.longitudinal,
        ),
        (
            10.0,
            ScenesConfig(Direction.per_direction, 4, 2, 2, Pick.total_duration, 1.0),
            FeatureDistance.mean_all,
            SpacingMetric.euclid2d,
        ),
    ],
)
def test_scenes_equal_a_slow_reading_of_the_definition(rate, scenes, d, metric):
    source = busy_recording(3, rate)
    expected, n_windows = oracle(source, scenes, d, metric)
    built = build([source], scenes, d=d, metric=metric)
    assert 2 <= len(expected) < n_windows
    assert built.counts.windows == n_windows
    assert (built.counts.accepted, built.counts.rejected) == (len(expected), n_windows - len(expected))
    np.testing.assert_array_equal(built.window, [window for window, _, _ in expected])
    np.testing.assert_array_equal(built.start_frame, [start for _, start, _ in expected])

    def values(of):
        return np.array([[[of(row) for row in frame] for frame in frames] for _, _, frames in expected])

    np.testing.assert_array_equal(built.track_id, values(lambda row: row.id))
    for name in ("x", "y", "position", "lane", "direction", "length", "speed"):
        np.testing.assert_array_equal(getattr(built, name), values(lambda row, name=name: getattr(row, name)))
    np.testing.assert_allclose(built.spacing, values(lambda row: row.spacing), rtol=1e-12)
    np.testing.assert_allclose(built.feature_distance, values(lambda row: row.feature), rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(built.has_next, values(lambda row: row.next is not None))
    np.testing.assert_array_equal(built.next_lane, values(lambda row: row.next["lane"] if row.next else -1))

    def action(row):
        if row.next is None:
            return 1
        if row.next["lane"] != row.lane:
            return 0 if row.next["lane"] < row.lane else 2
        change = row.next["speed"] - row.speed
        return 3 if change > 0.5 else 4 if change < -0.5 else 1

    np.testing.assert_array_equal(built.action, values(action))
    changed = (built.next_lane != built.lane) & built.has_next
    assert set(np.unique(built.action)) == {0, 1, 2, 3, 4}, "every action must occur for the comparison to count"
    np.testing.assert_allclose(recorded_lane_change_rate(built), changed.mean(axis=(1, 2)))
    assert not built.has_next.all()
