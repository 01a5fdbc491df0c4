"""Released parts of the traffic: noise, derived columns, faults, and their files."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from rearl_jax.blind.traffic import Planted, Scenario, write_dataset
from rearl_jax.blind.traffic.__main__ import main
from rearl_jax.blind.traffic.catalogue import HIDDEN
from rearl_jax.blind.traffic.measurement import ARTEFACTS, CHANGE_TIME, measure
from rearl_jax.blind.traffic.simulation import simulate
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.recordings import is_generated, iterate_recordings
from tests.refusal import refused

SHORT = {"n_recordings": 2, "duration": 12.0}


@pytest.fixture(scope="module")
def events():
    return simulate(Scenario(2, **SHORT))


def released(events, *planted, **changes):
    return measure(Scenario(2, planted, **SHORT | changes), events)


def true_position(events, frames):
    steps = np.searchsorted(events.time, np.arange(len(frames.position)) / 10 - 1e-6)
    return events.position[steps], events.speed[steps], events.acceleration[steps]


def test_positions_are_noisy_as_asked(events):
    frames = released(events)
    error = frames.position - true_position(events, frames)[0]
    assert error.std() == pytest.approx(0.1, rel=0.05)
    assert abs(np.mean(error[1:] * error[:-1])) < 0.05 * error.var()
    coloured = released(events, noise_time=0.3)
    error = coloured.position - true_position(events, coloured)[0]
    assert error.std() == pytest.approx(0.1, rel=0.05)
    assert np.mean(error[1:] * error[:-1]) > 0.8 * error.var()
    exact = released(events, position_noise=0.0)
    np.testing.assert_array_equal(exact.position, true_position(events, exact)[0])


def test_speed_and_acceleration_are_derived_from_positions(events):
    frames = released(events)
    _, speed, acceleration = true_position(events, frames)
    assert (frames.speed - speed).std() == pytest.approx(0.1, rel=0.4)
    assert np.corrcoef(frames.acceleration.ravel(), acceleration.ravel())[0, 1] > 0.5


def test_the_motion_sideways_begins_when_the_lane_changes(events):
    frames = released(events)
    changed = np.argwhere(np.diff(frames.lane, axis=0) != 0)
    assert len(changed) > 10
    halfway = round(CHANGE_TIME / 2 * 10)  # frames at 10 Hz
    for frame, vehicle in changed:
        old, new = frames.lane[frame, vehicle], frames.lane[frame + 1, vehicle]
        assert frames.lateral[frame, vehicle] == pytest.approx(3.75 * (old + 0.5), abs=1.0)
        if frame + halfway < len(frames.lane):
            assert frames.lateral[frame + halfway, vehicle] == pytest.approx(3.75 * max(old, new), abs=1.0)
    off = frames.lateral - 3.75 * (frames.lane + 0.5)
    assert 0.2 < off.std() < 1.2


def test_lens_shifts_by_place(events):
    shift = (
        released(events, Planted("lens"), position_noise=0.0).position - released(events, position_noise=0.0).position
    )
    assert np.abs(shift).max() == pytest.approx(5.0, abs=0.1)
    position = released(events, position_noise=0.0).position.ravel()
    order = np.argsort(position)
    # One shift for one place: neighbours on the road are shifted alike, whoever they are.
    assert np.abs(np.diff(shift.ravel()[order]))[np.diff(position[order]) < 1.0].max() < 0.1


def test_clocks_are_off_by_vehicle(events):
    late = released(events, Planted("clock_offset"), position_noise=0.0).position
    true, speed, _ = true_position(events, released(events, position_noise=0.0))
    offset = np.median((late - true) / speed, axis=0)
    assert 0.1 < offset.std() < 0.3
    assert np.abs((late - true) - offset * speed).max() < 0.7


@pytest.mark.parametrize(("name", "column"), [("position_lag", "position"), ("speed_lag", "speed")])
def test_a_column_is_late(events, name, column):
    late, right = released(events, Planted(name)), released(events)
    np.testing.assert_array_equal(getattr(late, column)[5:], getattr(right, column)[:-5])
    other = {"position": "speed", "speed": "position"}[column]
    np.testing.assert_array_equal(getattr(late, other), getattr(right, other))


def test_scales(events):
    right = released(events)
    fast = released(events, Planted("speed_scale"))
    np.testing.assert_allclose(fast.speed, 1.05 * right.speed)
    np.testing.assert_array_equal(fast.position, right.position)
    far = released(events, Planted("position_scale"))
    np.testing.assert_allclose(far.position, 1.05 * right.position)
    np.testing.assert_array_equal(far.speed, right.speed)  # or nobody could tell


def test_smoothing_and_noise(events):
    true, _, acceleration = true_position(events, released(events))
    smooth = released(events, Planted("smoothing"))
    assert smooth.acceleration.std() < 0.9 * acceleration.std()
    # Also at the ends, where a filter without what came before would bend the tracks.
    assert np.abs(smooth.acceleration[[0, -1]]).max() < np.abs(acceleration).max()
    noisy = released(events, Planted("position_noise"))
    assert (noisy.position - true).std() == pytest.approx(0.4, rel=0.06)


def test_a_folder_reads_as_canonical_tables(tmp_path):
    write_dataset(tmp_path, Scenario(5, (Planted("grade"),)))
    recordings = list(iterate_recordings(DataConfig(format=DataFormat.table, root=str(tmp_path))))
    assert len(recordings) == 3
    for recording in recordings:
        assert recording.dropped == {}
        assert recording.info.generated
        assert recording.table["track_id"].nunique() == 39
        assert len(recording.table) == 39 * 601
        assert recording.table["leader_id"].isna().all()


@pytest.mark.parametrize("name", ARTEFACTS)
def test_faulty_data_are_still_readable(tmp_path, name):
    write_dataset(tmp_path, Scenario(6, (Planted(name, 2.0 if name == "position_noise" else 1.0),), **SHORT))
    for recording in iterate_recordings(DataConfig(format=DataFormat.table, root=str(tmp_path))):
        assert recording.dropped == {}


def test_a_folder_says_nothing_about_what_is_hidden(tmp_path):
    """Same files, columns and keys of metadata whatever is hidden; nothing in them is called after anything hidden."""
    forms = []
    for number, planted in enumerate([(), (Planted("grade"),), (Planted("lens"),), (Planted("speed_limit", 0.5),)]):
        folder = tmp_path / str(number)
        write_dataset(folder, Scenario(7, planted, **SHORT))
        form = []
        for file in sorted(folder.iterdir()):
            schema = pq.read_schema(file)
            (info,) = json.loads(schema.metadata[b"rearl_jax.recordings"])
            assert info["speed_limit"] is None
            info["road_length"] = info["speed_limit"] = None
            form.append((file.name, schema.names, sorted(schema.metadata), info))
            said = json.dumps([file.name, schema.names, list(info.values())]).lower()
            assert not [name for name in (*HIDDEN, *ARTEFACTS, "seed", "planted", "strength", "truth") if name in said]
        forms.append(form)
    assert all(form == forms[0] for form in forms)


def test_equal_scenarios_are_equal_files(tmp_path):
    for folder in ("a", "b"):
        write_dataset(tmp_path / folder, Scenario(7, **SHORT))
    first, second = (sorted((tmp_path / folder).iterdir()) for folder in ("a", "b"))
    assert [file.read_bytes() for file in first] == [file.read_bytes() for file in second]


def test_a_camera_sees_a_part_of_the_road(tmp_path):
    keys = {"view": 400.0, "duration": 30.0, "n_recordings": 1}
    truth = write_dataset(tmp_path, Scenario(8, (Planted("grade"),), **keys))
    (recording,) = iterate_recordings(DataConfig(format=DataFormat.table, root=str(tmp_path)))
    assert -0.5 <= recording.table["position"].min()
    assert recording.table["position"].max() < 401.0
    start, end = (truth["planted"][0]["parameters"][name] for name in ("start", "end"))
    assert (start, end) == (100.0, 300.0)


def test_highd_files_hold_the_same(tmp_path):
    scenario = Scenario(8, n_recordings=1, duration=20.0, view=420.0, frame_rate=25.0)
    write_dataset(tmp_path / "highd", scenario, as_highd=True)
    write_dataset(tmp_path / "table", scenario)
    highd = DataConfig(format=DataFormat.highd, root=str(tmp_path / "highd"))
    assert is_generated(highd)
    assert json.loads((tmp_path / "highd" / "generator.json").read_text()) == {"generated": True}
    (ours,) = iterate_recordings(highd)
    (table,) = iterate_recordings(DataConfig(format=DataFormat.table, root=str(tmp_path / "table")))
    assert ours.dropped == {}
    assert len(ours.table) == pytest.approx(len(table.table), rel=0.1)
    key = ours.table["time"].round(2).astype(str) + " " + ours.table["length"].round(2).astype(str)
    other = table.table["time"].round(2).astype(str) + " " + table.table["length"].round(2).astype(str)
    both = ours.table.assign(key=key).merge(table.table.assign(key=other), on="key", suffixes=("", "_table"))
    both = both[(both["lane"] == both["lane_table"]) & (abs(both["position"] - both["position_table"]) < 2)]
    assert len(both) > 0.8 * len(ours.table)
    # highD's files count from the first box edge, rounded to a centimetre.
    assert (both["position"] - both["position_table"]).std() < 0.02
    assert (both["speed"] - both["speed_table"]).abs().max() < 0.011
    with pytest.raises(ValueError, match="view=420"):
        write_dataset(tmp_path, Scenario(8, **SHORT), as_highd=True)


def test_a_data_set_by_hand_says_what_it_does_not_know(tmp_path):
    with pytest.raises(SystemExit, match="no such key: pase; one of highd, .*pace"):
        main(["grade", "3", "1", str(tmp_path), "pase=2"])
    with pytest.raises(SystemExit, match="planted must be one of .*, got magic"):
        main(["magic", "3", "1", str(tmp_path)])
    assert list(tmp_path.iterdir()) == []


def test_unknown_effects_are_refused(tmp_path):
    with refused("out-of-range", key="planted", value="magic"):
        write_dataset(tmp_path, Scenario(1, (Planted("magic"),)))
