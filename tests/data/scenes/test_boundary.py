"""Recorded traffic around the vehicles of scenes, cut from a small recording."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config import PrepareTask
from rearl_jax.config.core import CoreConfig
from rearl_jax.config.scenes import BoundarySource, ScenesConfig, SpeedConfig, SpeedNorm
from rearl_jax.core.replayed import NOT_RECORDED
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.data.scenes.boundary import NO_VEHICLE, BoundaryOptions, cut_boundary
from rearl_jax.data.scenes.cutting import build_scenes
from rearl_jax.data.scenes.initial_states import bounded_state, recorded_surroundings
from tests.refusal import refused

RATE, SECONDS, STEPS = 5, 4, 10
#: Vehicle: lane, first position [m], speed [m/s], first and last frame. Vehicle 5 enters later; 1 leaves in second 2.
VEHICLES = {
    1: (0, 100.0, 20.0, 0, 8),
    2: (1, 80.0, 18.0, 0, 40),
    3: (0, 60.0, 21.0, 2, 40),
    4: (1, 150.0, 15.0, 4, 40),
    5: (2, 20.0, 25.0, 11, 23),
}


def rows():
    parts = []
    for track, (lane, x, speed, first, last) in VEHICLES.items():
        frame = np.arange(first, last + 1)
        # A speed that is not constant, so that interpolation matters.
        place = x + speed * frame / RATE + 0.2 * np.sin(frame)
        part = {"track_id": track, "frame": frame, "direction": 1, "x": place, "y": 4.0 * lane, "position": place}
        parts.append(pd.DataFrame(part | {"lane": lane, "speed": speed + 0.1 * frame, "length": 4.0 + 0.1 * track}))
    return pd.concat(parts, ignore_index=True).sort_values(["track_id", "frame"], ignore_index=True)


@pytest.fixture(scope="module")
def task():
    scenes = ScenesConfig(seconds=SECONDS, slots=2, min_vehicles=2, stride=SECONDS)
    return PrepareTask(scenes=scenes, speed=SpeedConfig(SpeedNorm.none))


@pytest.fixture(scope="module")
def recordings():
    info = RecordingInfo("a", float(RATE), {1: 3}, 500.0, "a set", "CC0", "somebody")
    table = rows().assign(acceleration=0.5, vehicle_class="car")
    return [Recording(info, table.astype({"lane": "Int8", "direction": "int8"}))]


@pytest.fixture(scope="module")
def scenes(recordings, task):
    return build_scenes(recordings, task)


def cut(recordings, scenes, source):
    return cut_boundary(recordings, scenes, np.arange(len(scenes)), BoundaryOptions(source, STEPS, False))


@pytest.fixture(scope="module")
def measured(recordings, scenes):
    return cut(recordings, scenes, BoundarySource.measured)


def test_vehicles_keep_their_places_and_others_enter_where_they_were_recorded(measured, scenes):
    assert len(scenes) == 2
    first = measured.track_id[0]
    np.testing.assert_array_equal(first, [[1, 2], [1, 2], [3, 2], [3, 2]])
    np.testing.assert_array_equal(measured.is_new[0], [[0, 0], [0, 0], [1, 0], [0, 0]])
    origin = scenes.position[0].min()
    table = rows().set_index(["track_id", "frame"])
    for second in range(SECONDS):
        for place, track in enumerate(first[second]):
            row = table.loc[(track, second * RATE)]
            found = (
                measured.x[0, second, place] + origin,
                measured.speed[0, second, place],
                measured.lane[0, second, place],
            )
            np.testing.assert_allclose(found, (row["x"], row["speed"], row["lane"]))
    # The highest speed of the vehicle, not of those that had the place before.
    np.testing.assert_allclose(measured.highest_speed[0, :, 0], [20.5, 20.5, 21 + 1.5, 21 + 1.5])


def test_a_vehicle_that_stays_is_simulated_to_the_end_and_nobody_takes_its_place(recordings, scenes):
    options = BoundaryOptions(BoundarySource.measured, STEPS, False, keeps_first=True)
    kept = cut_boundary(recordings, scenes, np.arange(len(scenes)), options)
    np.testing.assert_array_equal(kept.track_id[0], [[1, 2]] * SECONDS)
    assert not kept.is_new[0].any()
    assert 1 not in kept.replayed_id[0]  # nor is it replayed in addition to being simulated
    assert (kept.replayed_id[0, 2:] == 3).any(axis=1).all()  # whom nobody simulates now
    assert kept.lane[0, 2:, 0].tolist() == [NOT_RECORDED] * 2


def test_replayed_vehicles_are_exactly_where_they_were_recorded(measured, scenes):
    table = rows()
    seen = set()
    for scene in range(len(scenes)):
        origin = scenes.position[scene].min()
        for second, step, place in np.argwhere(measured.replayed_lane[scene] != NOT_RECORDED):
            track = measured.replayed_id[scene, second, place]
            own = table[table["track_id"] == track]
            frame = scenes.start_frame[scene] + RATE * (second + step / STEPS)
            assert own["frame"].min() <= frame <= own["frame"].max()
            x = np.interp(frame, own["frame"], own["position"]) - origin
            np.testing.assert_allclose(measured.replayed_x[scene, second, step, place], x, atol=1e-4)
            speed = np.interp(frame, own["frame"], own["speed"])
            np.testing.assert_allclose(measured.replayed_speed[scene, second, step, place], speed, rtol=1e-6)
            assert measured.replayed_lane[scene, second, step, place] == own["lane"].iloc[0]
            np.testing.assert_allclose(measured.replayed_length[scene, second, place], 4.0 + 0.1 * track, rtol=1e-6)
            seen.add((scene, int(track)))
    assert seen == {(0, 3), (0, 4), (0, 5), (1, 4), (1, 5)}


def test_every_recorded_vehicle_is_simulated_or_replayed_and_never_both(measured, scenes):
    table = rows()
    for scene in range(len(scenes)):
        for second in range(SECONDS):
            frame = scenes.start_frame[scene] + RATE * second
            there = set(table.loc[table["frame"] == frame, "track_id"])
            at_start = measured.replayed_lane[scene, second, 0] != NOT_RECORDED
            replayed = set(measured.replayed_id[scene, second, at_start].tolist())
            assert replayed.isdisjoint(measured.track_id[scene, second])
            assert replayed | set(measured.track_id[scene, second].tolist()) == there
    empty = measured.replayed_id == NO_VEHICLE
    assert empty.any()
    assert (np.moveaxis(measured.replayed_lane, 2, 3)[empty] == NOT_RECORDED).all()
    numbers = {(scene, int(t)): set() for scene in range(len(scenes)) for t in VEHICLES}
    for scene, second, place in np.argwhere(~empty):
        track = int(measured.replayed_id[scene, second, place])
        numbers[scene, track].add(int(measured.replayed_number[scene, second, place]))
    assert max(map(len, numbers.values())) == 1
    assert min(min(found) for found in numbers.values() if found) >= 2


def test_leaders_are_ahead_of_the_foremost_on_their_lane(recordings, scenes):
    leaders = cut(recordings, scenes, BoundarySource.leaders)
    # On lane 1 vehicle 4 is ahead of 2 until it is simulated; nobody is ahead on lane 0, nobody simulated on lane 2.
    np.testing.assert_array_equal(leaders.replayed_id[0, :, 0], NO_VEHICLE)
    np.testing.assert_array_equal(leaders.replayed_id[0, :, 1], [NO_VEHICLE, 4, 4, 4])
    np.testing.assert_array_equal(leaders.replayed_id[0, :, 2], NO_VEHICLE)


def test_the_simulation_gets_entrants_at_the_end_of_the_second_before(measured):
    core = CoreConfig(n_vehicles=2, n_lanes=3, ticks_per_second=STEPS)
    state, table = bounded_state(measured, core), recorded_surroundings(measured, core)
    np.testing.assert_allclose(state.x, measured.x[:, 0].T, rtol=1e-6)
    np.testing.assert_allclose(state.desired_speed, measured.highest_speed[:, 0].T, rtol=1e-6)
    assert table.motion.x.shape == (SECONDS, STEPS, measured.replayed_id.shape[2], 2)
    np.testing.assert_array_equal(np.argwhere(table.entrants.is_new[..., 0]), [[1, 0]])
    np.testing.assert_allclose(table.entrants.x[1, 0, 0], measured.x[0, 2, 0], rtol=1e-6)
    assert ((table.entrants.wait > 0) & (table.entrants.wait <= 1)).all()
    with refused("out-of-range", key="core.n_lanes"):
        bounded_state(measured, replace(core, n_lanes=2))


def test_vehicles_without_lane_and_recordings_that_are_gone_are_refused(recordings, scenes):
    options = BoundaryOptions(BoundarySource.measured, STEPS, False)
    with refused("recording-missing"):
        cut_boundary([], scenes, np.arange(2), options)
    table = recordings[0].table.copy()
    table.loc[table["track_id"] == 4, "lane"] = pd.NA
    with refused("lane-missing", key="scenes.boundary"):
        cut_boundary([replace(recordings[0], table=table)], scenes, np.arange(2), options)


def test_the_boundary_does_not_change_which_scenes_are_cut(recordings, scenes, task):
    others = replace(task, scenes=replace(task.scenes, boundary=BoundarySource.measured))
    assert build_scenes(recordings, others).data_id == scenes.data_id
