"""From recordings to measured drivers."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config import DiscoverConfig
from rearl_jax.core.order import NO_VEHICLE
from rearl_jax.data.records import Recording
from rearl_jax.discovery.observe.parts import measured_drivers
from rearl_jax.discovery.read import reading, smoothing
from rearl_jax.discovery.read.kernels import UNSMOOTHED, Kernel
from rearl_jax.discovery.read.smoothness import smoothing_kernel
from rearl_jax.discovery.read.split import split_drivers
from rearl_jax.discovery.read.surroundings import look_around
from rearl_jax.problems import InvalidInputError


def scene(**columns):
    """Vehicles at one moment of a road with two lanes."""
    n = len(columns["position"])
    table = pd.DataFrame({"frame": 0, "direction": 1, "track_id": np.arange(n), "leader_id": pd.NA, **columns})
    return table.astype({"leader_id": "Int64", "lane": "Int8", "direction": "int8"})


def test_leaders_followers_and_neighbours_are_those_a_person_would_name():
    table = scene(position=[10.0, 30.0, 50.0, 35.0, 200.0], lane=[0, 0, 0, 1, 1])
    around = look_around(table, np.array([20.0, 21.0, 22.0, 12.0, 5.0]))
    assert around.leader.tolist() == [1, 2, NO_VEHICLE, 4, NO_VEHICLE]
    assert around.follower.tolist() == [NO_VEHICLE, 0, 1, NO_VEHICLE, 3]
    assert around.left.tolist() == [NO_VEHICLE, NO_VEHICLE, NO_VEHICLE, 2, NO_VEHICLE]
    assert around.beside_speed.tolist() == [12.0, 12.0, 12.0, 20.0, np.inf]
    assert around.n_beside.tolist() == [1, 1, 1, 3, 0]


def test_a_leader_that_the_source_states_counts():
    table = scene(position=[10.0, 30.0, 50.0], lane=[0, 0, 0])
    table["leader_id"] = pd.array([2, pd.NA, pd.NA], dtype="Int64")
    assert look_around(table, np.full(3, 20.0)).leader.tolist() == [2, NO_VEHICLE, NO_VEHICLE]


def test_smoothing_keeps_a_parabola_and_takes_noise_away():
    dt, rng = 0.1, np.random.default_rng(0)
    time = np.arange(200) * dt
    driven = 5 + 20 * time + 0.4 * time**2
    x, v, a = smoothing.smoothed(driven, dt, 3.0)
    np.testing.assert_allclose(x, driven, atol=1e-6)
    np.testing.assert_allclose(v[2:-2], (20 + 0.8 * time)[2:-2], atol=1e-6)
    np.testing.assert_allclose(a[5:-5], 0.8, atol=1e-4)
    noisy = driven + 0.1 * rng.standard_normal(200)
    assert np.std(smoothing.smoothed(noisy, dt, 3.0)[0] - driven) < 0.05
    assert smoothing.position_noise(noisy, np.array([0]), np.array([200])) == pytest.approx(0.1, rel=0.25)
    assert smoothing.cut_off(0.1, dt) == pytest.approx(smoothing.CUT_OFF)
    assert smoothing.cut_off(0.4, dt) < smoothing.CUT_OFF < smoothing.cut_off(0.01, dt)


def test_neighbouring_frames_become_one(recordings_of):
    recording = recordings_of()[0]
    fast = Recording(replace(recording.info, frame_rate=25.0), recording.table)
    table, dt = smoothing.thinned(fast)
    assert dt == pytest.approx(3 / 25)
    first = recording.table[recording.table["track_id"] == table["track_id"].iloc[0]]
    whole = first[first["frame"] // 3 == table["frame"].iloc[1]]
    assert len(whole) == 3
    assert table["position"].iloc[1] == pytest.approx(whole["position"].mean())


def test_every_driver_with_a_leader_is_measured(recordings_of, measured_of):
    data, recording = measured_of(), recordings_of()[0]
    assert data.n_drivers == 12  # fifteen vehicles, the first of three lanes follow nobody
    assert data.dt == pytest.approx(0.1)
    assert data.noise == pytest.approx(0.1, rel=0.2)
    # The moments that count are those with a leader, and none of padding.
    assert data.weight[: int(reading.SETTLING / data.dt)].sum() == 0
    assert (data.surroundings.has_leader[data.weight > 0] == 1).all()
    assert data.seconds < 12 * 40.0
    gap = data.surroundings.leader_rear - (data.smooth + data.length / 2)
    assert gap[data.weight > 0].min() > 0
    vehicle = recording.table[recording.table["track_id"] == data.vehicle[0]]
    np.testing.assert_array_equal(data.y[: len(vehicle), 0], vehicle["position"])


def test_a_cut_in_is_remembered(measured_of):
    data = measured_of()
    since, lost = data.surroundings.time_since_change, data.surroundings.gap_lost
    assert (lost > 1.0).any(), "nobody cut in"
    step, piece = np.argwhere((since[1:] == 0) & (lost[1:] > 1.0))[0] + (1, 0)
    gap = data.surroundings.leader_rear - (data.smooth + data.length / 2)
    assert lost[step, piece] == pytest.approx(min(gap[step - 1, piece] - gap[step, piece], 60.0))
    assert since[step + 5, piece] == pytest.approx(5 * data.dt)
    assert data.leader[step, piece] != data.leader[step - 1, piece]
    halfway = data.halfway()
    # Nothing is averaged over the moment in which somebody else is ahead.
    assert halfway.leader_rear[step - 1, piece] == data.surroundings.leader_rear[step - 1, piece]
    smooth = data.leader[step, piece] == data.leader[step + 1, piece]
    assert smooth
    expected = (data.surroundings.leader_rear[step, piece] + data.surroundings.leader_rear[step + 1, piece]) / 2
    assert halfway.leader_rear[step, piece] == pytest.approx(expected)
    # Half a step later the change is longer ago; before it, the time until it is shorter.
    assert halfway.time_since_change[step, piece] == pytest.approx(0.5 * data.dt)
    assert data.surroundings.time_to_next[step - 1, piece] == pytest.approx(data.dt)
    assert halfway.time_to_next[step - 3, piece] == pytest.approx(2.5 * data.dt)


def test_parts_share_no_driver(tables_of):
    together = reading.measure(tables_of())
    parts = split_drivers(together)
    assert [len(np.unique(part.recording)) for part in parts] == [1, 1, 1]
    alone = split_drivers(reading.measure(tables_of()[:1]))
    vehicles = [set(part.vehicle.tolist()) for part in alone]
    assert sum(len(one) for one in vehicles) == 12 == len(set.union(*vehicles))
    assert min(len(one) for one in vehicles) >= 3


def test_no_part_consists_of_one_driver_who_drove_as_long_as_all_others(tables_of):
    whole = reading.measure(tables_of())
    n = len(whole.driver)
    alone = replace(whole, driver=np.where(whole.recording == 0, 0, 1 + np.arange(n)))
    alone = alone.select(np.arange(n))
    assert min(part.n_drivers for part in split_drivers(alone)) >= 3


def test_parts_side_by_side_are_the_whole(tables_of):
    whole = reading.measure(tables_of())
    mixed = np.random.default_rng(0).permutation(whole.driver.max() + 1)[whole.driver]
    first, second = (np.flatnonzero(mixed % 3 == part) for part in (0, 1))
    both, expected = (
        whole.select(first).with_drivers(whole.select(second)),
        whole.select(np.concatenate([first, second])),
    )
    assert both.n_drivers == expected.n_drivers > whole.select(first).n_drivers > 5
    for name in ("y", "weight", "smooth", "smooth_speed", "length", "is_truck", "vehicle", "leader", "recording"):
        np.testing.assert_array_equal(getattr(both, name), getattr(expected, name))
    np.testing.assert_array_equal(both.surroundings.leader_rear, expected.surroundings.leader_rear)
    # Numbered in their order within each part, and nobody twice.
    assert len(set(zip(both.driver, expected.driver, strict=True))) == both.n_drivers
    assert both.driver.max() + 1 == both.n_drivers


def test_the_rightmost_lane_is_that_of_the_direction(tables_of):
    (table, dt), *_ = tables_of()
    wider = table.assign(direction=np.int8(2), lane=table["lane"] + 1, track_id=table["track_id"] + 100)
    data = reading.measure([(pd.concat([table, wider], ignore_index=True), dt)])
    used, first = data.weight > 0, data.vehicle <= 100
    for part, lane in ((first, 2), (~first, 3)):
        rightmost = data.surroundings.lane[:, part][used[:, part] & (data.surroundings.is_rightmost[:, part] == 1)]
        assert len(rightmost) > 100
        assert set(rightmost) == {lane}


def test_nobody_who_follows_is_an_error(recordings_of):
    recording = recordings_of()[0]
    table = recording.table
    alone = Recording(recording.info, table[table["track_id"] == table["track_id"].iloc[0]].reset_index(drop=True))
    with pytest.raises(InvalidInputError) as error:
        reading.measure([smoothing.thinned(alone)])
    assert error.value.code == "nobody-follows"
    with pytest.raises(InvalidInputError) as error:
        measured_drivers([], DiscoverConfig())
    assert error.value.code == "nobody-follows"
    other = Recording(replace(recording.info, frame_rate=5.0), recording.table)
    with pytest.raises(InvalidInputError) as error:
        reading.one_frame_rate([recording, other])
    assert (error.value.code, error.value.problem.key) == ("frame-rates-differ", "data.recordings")
    assert recording.info.id in error.value.problem.fault
    rounded = Recording(replace(recording.info, frame_rate=0.999 * recording.info.frame_rate), recording.table)
    assert reading.one_frame_rate([recording, rounded]) == recording.info.frame_rate
    of_camera = Recording(replace(recording.info, frame_rate=29.97), recording.table)
    assert smoothing.thinned(of_camera, 30.0)[1] == pytest.approx(4 / 30), "steps of other recordings have four frames"


def test_positions_without_noise_get_a_little(tables_of):
    exact = [(without_noise(table), dt) for table, dt in tables_of()]
    data = reading.measure(exact)
    assert data.noise == pytest.approx(reading.LEAST_NOISE, rel=1e-3)
    added = (data.y - data.smooth)[data.weight > 0]
    assert added.std() == pytest.approx(reading.LEAST_NOISE, rel=0.2)
    np.testing.assert_array_equal(data.y, reading.measure(exact).y)


def test_of_smoothed_positions_few_moments_count(tables_of):
    tables, kernel = tables_of(), 0.5
    data = reading.measure(tables, kernel=Kernel("gaussian", kernel))
    assert data.stride == round(reading.APART * kernel / data.dt) > 1
    counts = data.weight.sum(axis=1) > 0
    assert counts[:: data.stride].any()
    assert not counts[data.is_corrected() == 0].any()
    edge = round(reading.EDGE * kernel / data.dt)
    assert not counts[:edge].any()
    plain = reading.measure(tables)
    assert plain.stride == 1
    assert plain.seconds > 2 * data.seconds / 3 > 100.0, "a moment that counts stands for those left out after it"


def without_noise(table):
    """The same tracks at constant accelerations."""
    first = table.groupby("track_id")["position"].transform("first")
    time = table["time"] - table.groupby("track_id")["time"].transform("first")
    return table.assign(position=first + 20.0 * time + 0.02 * time**2)


def test_a_position_that_jumps_is_found_and_one_that_scatters_is_not():
    dt, rng = 0.1, np.random.default_rng(1)
    time = np.arange(600) * dt
    braking = 25 * time - np.where(time > 30, 3.0 * (time - 30) ** 2, 0.0)
    assert not smoothing.jumps(braking, dt).any(), "full braking at once is driving"
    for noise in (0.0, 0.02, 0.3):
        scattered = braking + noise * rng.standard_normal(600)
        assert not smoothing.jumps(scattered, dt).any()
        scattered[200:] += 20 * noise + 1.0
        found = np.flatnonzero(smoothing.jumps(scattered, dt))
        assert len(found)
        assert np.abs(found - 200).max() <= 2


def test_nothing_counts_where_the_driver_or_the_leader_has_jumped(tables_of):
    ((measured, dt), *_) = tables_of()
    data = reading.measure([(measured, dt)])
    vehicle, counts = np.unique(data.leader[(data.leader != NO_VEHICLE) & (data.weight > 0)], return_counts=True)
    leader = vehicle[np.argmax(counts)]
    table = measured.copy()
    table.loc[(table["track_id"] == leader) & (table["time"] > 20.0), "position"] += 3.0
    jumped = reading.measure([(table, dt)])
    assert data.jumps == 0
    assert jumped.jumps > 0
    np.testing.assert_array_equal(jumped.vehicle, data.vehicle)
    concerned = (data.leader == leader) | (data.vehicle == leader)
    around = (data.surroundings.time > 19.6) & (data.surroundings.time < 21.3)
    assert data.weight[concerned & around].sum() > 10
    assert jumped.weight[concerned & around].sum() == 0
    np.testing.assert_array_equal(jumped.weight[~concerned], data.weight[~concerned])
    np.testing.assert_array_equal(
        jumped.weight[data.surroundings.time < 19.0],
        data.weight[data.surroundings.time < 19.0],
        "before the jump all is as it was",
    )


@pytest.mark.slow
def test_a_simulation_without_noise_is_not_taken_for_smoothed(recordings_of):
    exact = recordings_of(driver_noise=0.0, position_noise=0.0)
    tables = [smoothing.thinned(recording) for recording in exact]
    assert smoothing_kernel(tables, exact[0].info.frame_rate) == UNSMOOTHED
    findings, data = measured_drivers(exact, DiscoverConfig())
    assert (findings, data.stride) == ([], 1)
    findings, data = measured_drivers(recordings_of("smoothing"), DiscoverConfig())
    assert [finding.name for finding in findings] == ["smoothing"]
    assert data.stride > 1


def test_labels_stay_with_their_drivers(recordings_of):
    recordings = []
    for one in recordings_of():
        odd = (one.table["track_id"] % 2).astype(str)
        recordings.append(Recording(replace(one.info, labels=("kind",)), one.table.assign(kind="odd_" + odd)))
    _, data = measured_drivers(recordings, DiscoverConfig(by="kind", same="recording"))
    names = np.concatenate([one.table["track_id"].unique() for one in recordings])
    assert data.n_drivers == 36 <= len(names)
    first = data.of_drivers(data.label("recording") == recordings[0].info.id)
    assert first.label("kind").tolist() == [f"odd_{vehicle % 2}" for vehicle in np.unique(first.vehicle)]
    assert set(first.identity_of_driver) == {0}
    assert sorted(set(data.identity_of_driver)) == [0, 1, 2]
    shuffled = data.select(np.random.default_rng(1).permutation(len(data.driver)))
    both = first.with_drivers(shuffled)
    for part, expected in ((slice(0, 12), first), (slice(12, None), data)):
        assert both.label("kind")[part].tolist() == expected.label("kind").tolist()
        assert both.identity_of_driver[part].tolist() == expected.identity_of_driver.tolist()
    _, few = measured_drivers(recordings, DiscoverConfig(by="kind", max_drivers=9))
    assert [(few.label("kind") == kind).sum() for kind in ("odd_0", "odd_1")] == [9, 9]
    assert set(few.identity_of_driver) == {-1}
