"""NGSIM: the shipped US-101 table, the published tables in feet, the I-80 pairs."""

import numpy as np
import pandas as pd

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.formats.ngsim import debounced
from rearl_jax.data.formats.ngsim_pairs import find_pairs, pairs_recordings, read_pairs
from rearl_jax.data.formats.ngsim_published import PublishedFile, find_published
from rearl_jax.data.recordings import count_recordings, iterate_recordings
from rearl_jax.problems import MissingInputError
from tests.data.formats.ngsim_files import published, text_of
from tests.data.made_rows import with_values
from tests.refusal import refused

STOP = DataConfig()
DROP_ROW = DataConfig(on_bad=BadRows.drop_row)


# US-101, shipped


def test_the_shipped_set_is_read_without_a_loss():
    recordings = list(iterate_recordings(DataConfig()))
    assert count_recordings(DataConfig()) == 3
    assert [r.info.id for r in recordings] == ["us101_0750", "us101_0805", "us101_0820"]
    assert [r.table["track_id"].nunique() for r in recordings] == [290, 67, 13]
    assert [len(r.table) for r in recordings] == [155_604, 47_852, 10_811]
    assert all(r.dropped == {} for r in recordings)
    # Lane changes counted outside this package after a 2 s median filter: about 378.
    assert 370 <= sum(_lane_changes(r.table) for r in recordings) <= 390
    for recording in recordings:
        assert recording.info.licence == "CC BY-SA 4.0"
        assert "10.21949/1504477" in recording.info.attribution
        assert any("4.5 m" in note for note in recording.info.notes)
        assert any("only vehicles that change lanes" in note for note in recording.info.notes)
        assert recording.table["lane"].between(0, 5).all()
        assert recording.table["width"].isna().all()


def test_the_centre_is_half_a_length_behind_the_front_whatever_the_length():
    short, long = (
        next(iterate_recordings(DataConfig(recordings="us101_0820", default_length=length))).table
        for length in (4.0, 6.0)
    )
    np.testing.assert_allclose(short["position"] + 2.0, long["position"] + 3.0)
    assert (long["length"] == 6.0).all()


def _lane_changes(table: pd.DataFrame) -> int:
    lane = table["lane"].astype(int)
    return int(((lane.diff() != 0) & (table["track_id"].diff() == 0)).sum())


def test_debouncing_forgets_flicker_and_keeps_changes_within_a_track():
    lane = np.repeat([1, 2], 60)
    lane[[0, 10, 20, 21, 59, 90]] = 2, 2, 2, 2, 2, 1
    lane[62:68] = 1, 2, 1, 2, 1, 2
    assert np.count_nonzero(np.diff(lane)) == 14
    as_one_track = debounced(lane, np.full(120, 7))
    assert np.count_nonzero(np.diff(as_one_track)) == 1
    assert 55 <= np.flatnonzero(np.diff(as_one_track))[0] <= 68
    # A second vehicle in the other lane has no part in the first one's median.
    np.testing.assert_array_equal(debounced(lane, np.repeat([7, 8], 60)), np.repeat([1, 2], 60))


# Published tables


def _write(folder, rows: pd.DataFrame, name: str = "trajectories.csv") -> PublishedFile:
    rows.to_csv(folder / name, index=False)
    return PublishedFile(find_published(folder)[0], DROP_ROW)


def test_a_leader_0_is_a_vehicle_only_where_one_with_this_id_is_ahead(tmp_path):
    rows = published()
    for none in (0, -1, 9999):
        stated = rows.assign(Preceding=rows["Preceding"].replace(0, none))
        leader = _write(tmp_path, stated).read("us101_0750").table.groupby("track_id")["leader_id"].first()
        assert leader.isna().tolist() == [True, False, True]
    # Vehicle 2 follows vehicle 0; for vehicle 0 itself and for vehicle 3, 0 means none.
    stated = rows.assign(Preceding=0, Vehicle_ID=rows["Vehicle_ID"].replace(1, 0))
    recording = _write(tmp_path, stated).read("us101_0750")
    leader = recording.table.groupby("track_id")["leader_id"].first()
    assert leader.isna().to_dict() == {0: True, 2: False, 3: True}
    assert recording.dropped == {}


def test_feet_become_metres_and_the_front_becomes_the_centre(tmp_path):
    file = _write(tmp_path, published())
    assert file.recordings() == ["us101_0750"]
    recording = file.read("us101_0750")
    table = recording.table
    assert recording.dropped == {}
    assert dict(recording.info.lane_count) == {1: 8}
    car, truck = table[table["track_id"] == 2], table[table["track_id"] == 3]
    np.testing.assert_allclose(car["position"], 30.0 + 1.2 * np.arange(60) - 2.25)
    np.testing.assert_allclose(truck["position"], 40.0 + 1.2 * np.arange(60) - 6.0)
    for name, value in {"lateral": 5.25, "y": 5.25, "length": 4.5, "width": 1.8, "speed": 12.0}.items():
        np.testing.assert_allclose(car[name], value, err_msg=name)
    np.testing.assert_allclose(car["acceleration"], 0.5)
    assert (car["lane"] == 1).all()
    assert (car["leader_id"] == 1).all()
    assert truck["leader_id"].isna().all()
    assert set(truck["vehicle_class"]) == {"truck"}


def test_recordings_are_told_apart_by_their_clock_and_arterials_are_passed_over(tmp_path):
    later = published(start=863_000)
    street = published().assign(Location="lankershim")
    file = _write(tmp_path, pd.concat([published(), later, street, published("i-80")]))
    assert file.recordings() == ["i80_0400", "us101_0750", "us101_0805"]
    for name in file.recordings():
        assert len(file.read(name).table) == 180


def test_a_time_of_another_frame_stops_instead_of_hiding_the_recording(tmp_path):
    rows = published()
    rows.loc[70, "Global_Time"] += 100
    with refused("time-contradicts-frame", column="Global_Time", row=71):
        _write(tmp_path, rows).recordings()


def test_row_order_and_spelling_of_columns_do_not_matter(tmp_path):
    expected = _write(tmp_path, published()).read("us101_0750").table
    other = published().sample(frac=1.0, random_state=0)
    other = other.rename(columns={"v_Length": "v_length", "Preceding": "Preceeding", "Lane_ID": "lane id"})
    (tmp_path / "b").mkdir()
    found = _write(tmp_path / "b", other.rename(columns=str.upper)).read("us101_0750")
    assert found.dropped == {}
    pd.testing.assert_frame_equal(found.table, expected)


def test_original_text_files_without_a_header_are_read(tmp_path):
    expected = _write(tmp_path, published()).read("us101_0750").table
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "US-101-trajectories-0750am-0805am.txt").write_text(text_of(published()))
    file = PublishedFile(find_published(tmp_path / "b")[0], STOP)
    assert file.recordings() == ["us101_0750"]
    pd.testing.assert_frame_equal(file.read("us101_0750").table, expected, rtol=1e-5)


def test_exact_copies_stop_or_are_counted(tmp_path):
    rows = published()
    _write(tmp_path, pd.concat([rows, rows.iloc[20:50]]))
    path = find_published(tmp_path)[0]
    with refused("exact-duplicate", row=181):
        PublishedFile(path, STOP).read("us101_0750")
    for on_bad in (BadRows.drop_row, BadRows.drop_track):
        recording = PublishedFile(path, DataConfig(on_bad=on_bad)).read("us101_0750")
        assert recording.dropped == {"exact_duplicate": 30}
        assert len(recording.table) == 180


def test_an_id_used_again_in_a_recording_becomes_another_vehicle(tmp_path):
    again = published(n=40)
    again = again.assign(Frame_ID=again["Frame_ID"] + 500, Global_Time=again["Global_Time"] + 50_000)
    recording = _write(tmp_path, pd.concat([published(), again])).read("us101_0750")
    assert recording.dropped == {"gap_cuts": 3}
    assert recording.table.groupby("track_id").size().tolist() == [60, 60, 60, 40, 40, 40]
    # Vehicle 2 follows vehicle 1 into its second life.
    second = recording.table[recording.table["track_id"] == 5]
    assert set(second["leader_id"]) == {4}


def test_a_table_in_metres_and_an_unknown_class_are_found(tmp_path):
    metres = published()
    metres[["Local_X", "Local_Y", "v_Length", "v_Width", "v_Vel", "v_Acc"]] *= 0.3048
    with refused("wrong-units", column="v_Length", row=1) as caught:
        _write(tmp_path, metres).read("us101_0750")
    assert "metres, read as feet?" in str(caught.value)
    _write(tmp_path, published().assign(v_Class=lambda t: t["v_Class"].replace(3, 5)))
    with refused("unknown-class", column="v_Class", row=121, fault="class 5 is unknown (and 59 more rows)"):
        PublishedFile(find_published(tmp_path)[0], STOP).read("us101_0750")


def test_a_bad_row_adds_no_lane_and_does_not_lengthen_the_road(tmp_path):
    rows = published().assign(Location="ngsim")
    sound = _write(tmp_path, rows).read("ngsim_0750").info
    assert sound.lane_count == {1: 3}
    rows.loc[70, "Lane_ID"], rows.loc[90, "Local_Y"] = 99, 99999.0
    recording = _write(tmp_path, rows).read("ngsim_0750")
    assert recording.dropped["lane_out_of_range"] == 1
    assert (recording.info.lane_count, recording.info.road_length) == (sound.lane_count, sound.road_length)


def test_lanes_that_count_from_0_stop_instead_of_losing_one(tmp_path):
    rows = published()
    with refused("wrong-origin", column="Lane_ID", row=1):
        _write(tmp_path, rows.assign(Lane_ID=rows["Lane_ID"] - 2)).read("us101_0750")


def test_missing_columns_and_values_stop(tmp_path):
    _write(tmp_path, published().drop(columns="v_Vel"))
    with refused("column-missing", column="v_Vel"):
        PublishedFile(find_published(tmp_path)[0], STOP).recordings()
    rows = published().astype({"Vehicle_ID": "Int64"})
    rows.loc[9, "Vehicle_ID"] = None
    _write(tmp_path, rows)
    with refused("not-finite", column="Vehicle_ID", row=10):
        PublishedFile(find_published(tmp_path)[0], STOP).recordings()
    dropped = PublishedFile(find_published(tmp_path)[0], DROP_ROW).read("us101_0750").dropped
    assert dropped == {"not_finite": 1, "gap_cuts": 1, "fragment": 9, "tracks": 1}
    no_length = published()
    no_length.loc[9, "v_Length"] = np.nan
    _write(tmp_path, no_length)
    with refused("not-finite", column="v_Length", row=10):
        PublishedFile(find_published(tmp_path)[0], STOP).read("us101_0750")


# I-80 pairs


def _pairs() -> pd.DataFrame:
    """Vehicle 3 follows 2 follows 1 (a truck); the second pair pauses from 4 s to 6 s."""
    rows = []
    t = np.arange(0, 100)
    for number, (follower, leader, y_f, y_l, length, lane) in enumerate(
        [(2, 1, 40.0, 70.0, 12.0, 3.0), (3, 2, 20.0, 40.0, 4.2, np.nan)]
    ):
        keep = t if number == 0 else t[(t < 40) | (t >= 60)]
        rows.append(
            pd.DataFrame(
                {
                    "run": "0400pm-0415pm",
                    "follower": follower,
                    "leader": leader,
                    "t_s": 5.0 + keep / 10.0,
                    "y_f_m": y_f + 0.8 * keep,
                    "v_f_mps": 8.0,
                    "a_f_mps2": 0.1,
                    "y_l_m": y_l + 0.8 * keep,
                    "v_l_mps": 8.0,
                    "a_l_mps2": -0.1,
                    "leader_length_m": length,
                    "lane": lane,
                }
            )
        )
    return pd.concat(rows, ignore_index=True)


def _read_pairs(folder, pairs: pd.DataFrame, policy: DataConfig = STOP):
    pairs.to_parquet(folder / "pairs.parquet")
    path = find_pairs(folder)
    (name, run), *others = pairs_recordings(path).items()
    assert others == []
    return read_pairs(path, name, run, policy)


def test_pairs_join_to_vehicles_that_appear_once_per_frame(tmp_path):
    recording = _read_pairs(tmp_path, _pairs())
    table = recording.table
    assert recording.info.id == "i80_0400"
    assert recording.dropped == {}
    assert not table.duplicated(["track_id", "frame"]).any()
    # 1 and 2 are seen throughout, 3 comes back as 4.
    assert table.groupby("track_id").size().tolist() == [100, 100, 40, 40]
    assert "came back under a new id" in recording.info.notes[-1]
    second = table[table["track_id"] == 2]
    assert set(second["leader_id"]) == {1}
    assert set(second["lane"]) == {2}
    assert set(second["acceleration"]) == {0.1}
    assert table.groupby("track_id")["length"].first().tolist() == [12.0, 4.2, 4.5, 4.5]
    assert table.groupby("track_id")["vehicle_class"].first().tolist() == ["truck", "car", "car", "car"]
    assert table.loc[table["track_id"] >= 3, "lane"].isna().all()
    assert table["lateral"].isna().all()


def test_bumper_gaps_of_the_source_hold(tmp_path):
    pairs = _pairs()
    table = _read_pairs(tmp_path, pairs).table
    leader = table[["track_id", "frame", "position", "length"]].rename(columns={"track_id": "leader_id"})
    both = table.merge(leader, on=["leader_id", "frame"], suffixes=("", "_leader"))
    gap = both["position_leader"] - both["position"] - (both["length_leader"] + both["length"]) / 2
    assert len(gap) == len(pairs)
    np.testing.assert_allclose(gap[both["track_id"] == 2], 70.0 - 12.0 - 40.0)
    np.testing.assert_allclose(gap[both["track_id"] >= 3], 40.0 - 4.2 - 20.0)


def test_pairs_that_disagree_about_a_vehicle_stop_or_are_counted(tmp_path):
    pairs = _pairs()
    pairs.loc[105, "y_l_m"] += 0.5
    with refused("contradiction", column="y_f_m", row=6):
        _read_pairs(tmp_path, pairs)
    dropped = _read_pairs(tmp_path, pairs, DROP_ROW).dropped
    assert dropped["contradiction"] == 2


def test_a_pair_in_a_run_of_its_own_stops(tmp_path):
    pairs = pd.concat([_pairs().assign(follower=n, leader=100 + n) for n in range(1, 30)], ignore_index=True)
    pairs.loc[pairs["follower"] == 7, "run"] = "0500pm-0515pm"
    pairs.to_parquet(tmp_path / "pairs.parquet")
    first = int(np.argmax(pairs["follower"] == 7)) + 1
    with refused("recording-contradicts", column="run", row=first):
        pairs_recordings(find_pairs(tmp_path))


def test_runs_of_one_name_stop(tmp_path):
    _pairs().assign(run=["0400pm-0415pm", "0400pm-0430pm"] * 90).to_parquet(tmp_path / "pairs.parquet")
    with refused("run-twice", column="run"):
        pairs_recordings(find_pairs(tmp_path))


def test_a_row_without_a_run_is_named(tmp_path):
    with_values(_pairs(), 40, run=None).to_parquet(tmp_path / "pairs.parquet")
    with refused("run-unnamed", column="run", row=41):
        pairs_recordings(tmp_path / "pairs.parquet")


def test_a_vehicle_of_several_lengths_stops(tmp_path):
    pairs = _pairs()
    pairs.loc[20, "leader_length_m"] = 9.0
    with refused("lengths-contradict", column="leader_length_m", row=1):
        _read_pairs(tmp_path, pairs, DROP_ROW)


def test_huge_lengths_stop_as_lengths(tmp_path):
    # So large that the sum of two of them is infinite.
    with refused("wrong-units", column="leader_length_m"):
        _read_pairs(tmp_path, _pairs().assign(leader_length_m=1.2e308))


def test_a_folder_without_the_one_file_stops(tmp_path):
    with refused("recordings-missing", MissingInputError):
        find_pairs(tmp_path)
    _pairs().drop(columns="y_l_m").to_parquet(tmp_path / "a.parquet")
    with refused("column-missing", column="y_l_m"):
        pairs_recordings(find_pairs(tmp_path))
