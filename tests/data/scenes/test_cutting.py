"""Scenes against a slow reading of their definition, and the boundary cases of that definition."""

import gc
import logging
import weakref
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config import PrepareTask
from rearl_jax.config.scenes import (
    Direction,
    FeatureDistance,
    FeaturesConfig,
    Pick,
    ScenesConfig,
    SpacingConfig,
    SpacingMetric,
    SpeedConfig,
    SpeedNorm,
)
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.data.scenes.cutting import build_scenes
from rearl_jax.data.scenes.scene_set import recorded_lane_change_rate, scale_speed
from rearl_jax.data.scenes.scene_windows import actions
from tests.refusal import refused

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


def test_ten_vehicles_are_enough_and_nine_in_one_snapshot_are_not():
    scenes = ScenesConfig(seconds=6)
    missing = np.delete(np.arange(60), 30)
    assert len(build([recording(*standing(10))], scenes)) == 1
    with refused("vehicles-too-few"):
        build([recording(*standing(9), {"id": 10, "frames": missing})], scenes)
    # Only snapshots count: frame 31 lies between two of them.
    missing = np.delete(np.arange(60), 31)
    assert len(build([recording(*standing(9), {"id": 10, "frames": missing})], scenes)) == 1


def test_short_tracks_count_as_vehicles_and_are_marked():
    long, short = standing(3, 120), {"id": 4, "frames": np.arange(60)}
    built = build([recording(*long, short)])
    assert len(built) == 1
    np.testing.assert_array_equal(built.is_long_track[0, 0], built.track_id[0, 0] != 4)


def test_a_rejected_first_window_does_not_shift_the_grid():
    late = {"id": 4, "frames": np.arange(1045, 1240)}
    built = build([recording(*standing(3, 240, first=1000), late)])
    np.testing.assert_array_equal(built.window, [1, 2, 3])
    np.testing.assert_array_equal(built.start_frame, [1060, 1120, 1180])
    np.testing.assert_array_equal(built.start_time, [6.0, 12.0, 18.0])
    assert (built.counts.windows, built.counts.rejected) == (4, 1)


def test_a_window_must_be_recorded_to_its_end():
    assert len(build([recording(*standing(4, 120))])) == 2
    assert len(build([recording(*standing(4, 119))])) == 1


def test_elapsed_picks_who_came_first_and_total_duration_who_stays_longest():
    first = {"id": 9, "frames": np.arange(0, 130)}
    lasting = {"id": 8, "frames": np.arange(1, 200)}
    late = {"id": 7, "frames": np.arange(2, 202)}

    def first_slots(pick):
        scenes = ScenesConfig(seconds=6, min_vehicles=3, slots=2, pick=pick)
        built = build([recording(late, lasting, first)], scenes)
        assert built.start_frame[0] == 60
        return built.track_id[0, 0]

    np.testing.assert_array_equal(first_slots(Pick.elapsed), [9, 8])
    np.testing.assert_array_equal(first_slots(Pick.total_duration), [7, 8])


def test_equally_old_vehicles_are_ordered_by_track_id():
    built = build([recording(*standing(7))])
    np.testing.assert_array_equal(built.track_id, np.broadcast_to([1, 2, 3, 4], built.track_id.shape))


def test_per_direction_makes_a_scene_of_every_carriageway():
    tracks = [track | {"direction": 1 + track["id"] % 2} for track in standing(9, 60)]
    built = build([recording(*tracks)], ScenesConfig(Direction.per_direction, seconds=6, min_vehicles=4, slots=4))
    assert (len(built), built.counts.windows) == (2, 2)
    np.testing.assert_array_equal(built.direction[:, 0, 0], [1, 2])
    assert (built.direction == built.direction[:, :1, :1]).all()
    np.testing.assert_array_equal(built.window, [0, 0])


def test_scaled_speed_reaches_both_ends_exactly_over_all_recordings():
    slow = recording(*standing(4, speed=np.linspace(3.3, 20.7, 60)), name="slow")
    fast = recording(*standing(4, speed=np.linspace(12.1, 44.9, 60)), name="fast")
    built = build([slow, fast])
    # Of the recorded extremes only those in a snapshot count: the last of them is frame 50.
    assert built.speed_min == 3.3
    assert built.speed_max == pytest.approx(12.1 + (44.9 - 12.1) * 50 / 59, rel=1e-15)
    assert (built.scaled_speed.min(), built.scaled_speed.max()) == (5.0, 32.0)
    assert built.scaled_speed[0].max() < 20.0, "extremes must be common to all scenes"
    np.testing.assert_allclose(np.diff(built.scaled_speed[0, :, 0], n=2), 0.0, atol=1e-12)


def test_other_ways_to_rescale():
    speed = np.array([0.0, 5.0, 20.0, 40.0])
    np.testing.assert_array_equal(scale_speed(speed, 0.0, 40.0, SpeedNorm.none), speed)
    np.testing.assert_array_equal(scale_speed(speed, 0.0, 40.0, SpeedNorm.clip), [5.0, 5.0, 20.0, 32.0])
    np.testing.assert_allclose(scale_speed(speed, 5.0, 20.0, SpeedNorm.minmax_p01_999), [5.0, 5.0, 32.0, 32.0])
    tracks = standing(4, 600, speed=np.linspace(10.0, 20.0, 600))
    tracks[0]["speed"] = np.r_[200.0, tracks[0]["speed"][1:10], 1.0, tracks[0]["speed"][11:]]
    plain, robust = (build([recording(*tracks)], norm=n) for n in (SpeedNorm.minmax, SpeedNorm.minmax_p01_999))
    assert (plain.speed_min, plain.speed_max) == (1.0, 200.0)
    assert 1.0 < robust.speed_min < robust.speed_max < 200.0
    assert (robust.scaled_speed.min(), robust.scaled_speed.max()) == (5.0, 32.0)
    assert robust.scaled_speed.std() > plain.scaled_speed.std()


def test_equal_speeds_cannot_be_rescaled():
    source = recording(*standing(4, speed=20.0))
    with refused("speeds-all-equal", key="speed.norm"):
        build([source])
    assert (build([source], norm=SpeedNorm.clip).scaled_speed == 20.0).all()


@pytest.mark.parametrize(
    ("lane", "next_lane", "change", "expected"),
    [
        (1, 0, 9.0, 0),
        (1, 2, -9.0, 2),
        (1, 1, 0.51, 3),
        (1, 1, -0.51, 4),
        (1, 1, 0.5, 1),
        (1, 1, -0.5, 1),
        (-1, 1, 0.0, 1),
        (1, -1, 0.6, 3),
    ],
)
def test_action_labels(lane, next_lane, change, expected):
    speed = np.array([20.0])
    assert actions(np.int8([lane]), np.int8([next_lane]), speed, speed + change) == expected


def test_spacing_pools_the_carriageways_in_the_ground_frame():
    # A 3-4-5 triangle across the carriageways, and a fourth vehicle on its first corner.
    place = {1: (0.0, 0.0), 2: (30.0, 0.0), 3: (30.0, 40.0), 4: (0.0, 0.0)}
    tracks = [
        {"id": i, "frames": np.arange(60), "x": x, "y": y, "direction": 1 + (i == 3), "position": 7.0 * i}
        for i, (x, y) in place.items()
    ]
    built = build([recording(*tracks)])
    np.testing.assert_allclose(built.spacing[0, 0], [80 / 3, 100 / 3, 140 / 3, 80 / 3])
    pairs = [np.hypot(*np.subtract(place[i], place[j])) for i, j in combinations(place, 2)]
    np.testing.assert_allclose(built.mean_spacing, np.mean(pairs))
    along = build([recording(*tracks)], metric=SpacingMetric.longitudinal)
    np.testing.assert_allclose(along.spacing[0, 0], [20.0, 20.0, 20.0, 20.0])


def test_feature_distance_counts_vehicles_that_are_not_picked():
    tracks = [track | {"x": 10.0 * track["id"]} for track in standing(5)]
    built = build([recording(*tracks)])
    np.testing.assert_allclose(built.spacing[0, 0], [20.0, 40 / 3, 40 / 3, 20.0])
    np.testing.assert_allclose(built.feature_distance[0, 0], [25.0, 17.5, 15.0, 17.5])


def test_the_leader_is_the_nearest_centre_even_behind_a_long_truck():
    place = {1: (0.0, 4.0), 2: (10.0, 4.0), 3: (12.0, 20.0), 4: (30.0, 4.0)}
    tracks = [
        {"id": i, "frames": np.arange(60), "position": position, "length": length}
        for i, (position, length) in place.items()
    ]
    built = build([recording(*tracks)], d=FeatureDistance.dhw)
    np.testing.assert_allclose(built.feature_distance[0, 0], [6.0, 0.0, 6.0, 0.0])


def test_unknown_lanes_are_refused_only_where_lanes_matter():
    built = build([recording(*standing(4, lane=pd.NA))])
    assert (built.lane == -1).all()
    assert (built.action == 1).all()
    with refused("lane-missing"):
        recorded_lane_change_rate(built)
    with refused("lane-missing", key="features.d"):
        build([recording(*standing(4, lane=pd.NA))], d=FeatureDistance.dhw)


def test_overlapping_windows_share_their_snapshots():
    source = busy_recording(3, 10.0)
    plain = build([source], ScenesConfig(seconds=6, min_vehicles=3, slots=3))
    dense = build([source], ScenesConfig(seconds=6, min_vehicles=3, slots=3, stride=1.0))
    assert len(plain) > 3
    assert len(dense) > 4 * len(plain)
    same = np.isin(dense.start_frame, plain.start_frame)
    np.testing.assert_array_equal(dense.spacing[same], plain.spacing)
    np.testing.assert_array_equal(dense.start_time[same], 6.0 * plain.window)
    assert (np.bincount((dense.start_time // 6.0).astype(int)) <= 6).all()


def test_a_frame_rate_that_is_no_whole_number():
    source = recording(*standing(4, 1000), rate=29.97)
    built = build([source])
    np.testing.assert_array_equal(built.start_frame, np.rint(29.97 * 6 * np.arange(5)))
    np.testing.assert_array_equal(built.start_time, 6.0 * np.arange(5))


def test_recordings_are_dropped_before_the_next_is_read():
    alive = []

    def recordings():
        for name in ("a", "b", "c"):
            gc.collect()
            assert not any(reference() is not None for reference in alive)
            one = recording(*standing(4), name=name)
            alive.append(weakref.ref(one))
            yield one
            del one

    assert len(build(recordings())) == 3
    assert len(alive) == 3


def test_progress_counts_and_log(caplog):
    calls = []
    sources = [recording(*standing(n), name=f"r{n}") for n in (4, 3, 5)]
    with caplog.at_level(logging.INFO):
        built = build(sources, progress=lambda name, n_scenes: calls.append((name, n_scenes)))
    assert calls == [("r4", 1), ("r3", 1), ("r5", 2)]
    assert "2 scenes of 3 windows; REARL reports 741 from highD" in caplog.text
    assert (built.counts.recordings, built.counts.recordings_without_scenes) == (3, 1)
    assert [info.id for info in built.infos] == ["r4", "r5"]
    assert built.generated
    np.testing.assert_array_equal(built.recording, ["r4", "r5"])
    assert built.settings["scenes.direction"] == "pooled"


def test_select_keeps_ids_and_extremes():
    built = build([busy_recording(3, 10.0)], ScenesConfig(seconds=6, min_vehicles=3, slots=3))
    part = built.select(np.array([2, 0]))
    np.testing.assert_array_equal(part.scene_id, [2, 0])
    np.testing.assert_array_equal(part.scaled_speed, built.scaled_speed[[2, 0]])
    assert part.data_id != built.data_id


@pytest.mark.parametrize(
    ("sources", "scenes", "code", "facts"),
    [
        ([], SMALL, "recordings-missing", ["data.format", "data.root"]),
        ([recording(*standing(4, 59))], SMALL, "recordings-too-short", [" a, 5.9 s", "scenes.seconds"]),
        (
            [recording(*standing(3), name="b"), recording(*standing(2), name="c")],
            SMALL,
            "vehicles-too-few",
            ["3 in every snapshot", "recording b", "scenes.min_vehicles=3", "scenes.slots=3"],
        ),
        ([recording(*standing(1))], SMALL, "vehicles-too-few", ["an id of its own"]),
        (
            [replace(recording(*standing(3)), dropped={"out_of_range": 60, "tracks": 1})],
            SMALL,
            "vehicles-too-few",
            ["out_of_range 60"],
        ),
        ([recording(*standing(4)), recording(*standing(4))], SMALL, "recording-twice", ["recording a"]),
        (
            [recording(*standing(4))],
            ScenesConfig(seconds=6, min_vehicles=4, slots=4, stride=0.05),
            "out-of-range",
            ["scenes.stride", "0.1 s"],
        ),
        ([recording(*standing(4))], ScenesConfig(min_vehicles=5), "out-of-range", ["min_vehicles", "slots = 10"]),
        ([recording(*standing(4, x=np.nan))], SMALL, "not-finite", ["recording a", "track 1"]),
    ],
)
def test_what_stops_with_a_remedy(sources, scenes, code, facts):
    with refused(code) as caught:
        build(sources, scenes)
    assert all(fact in str(caught.value) for fact in facts), str(caught.value)


def test_unsorted_and_empty_tables_are_refused():
    sound = recording(*standing(4))
    for order, row in (([1, 0, *range(2, 240)], 2), ([0, *range(240)], 2), ([*range(60, 240), *range(60)], 181)):
        with refused("unsorted", file="recording a", row=row):
            build([Recording(sound.info, sound.table.iloc[order])])
    with refused("no-rows"):
        build([Recording(sound.info, sound.table.iloc[:0])])
