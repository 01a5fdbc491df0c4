"""Boundary cases of the definition of a scene."""

import gc
import logging
import weakref
from dataclasses import replace
from itertools import combinations

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.scenes import (
    Direction,
    FeatureDistance,
    Pick,
    ScenesConfig,
    SpacingMetric,
    SpeedNorm,
)
from rearl_jax.data.records import Recording
from rearl_jax.data.scenes.scene_set import recorded_lane_change_rate, scale_speed
from rearl_jax.data.scenes.scene_windows import actions
from tests.data.scenes.made_recordings import SMALL, build, busy_recording, recording, standing
from tests.refusal import refused


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
