"""Cutting tracks and leaving out pieces."""

import numpy as np
import pandas as pd

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.checks.losses import split_tracks
from rearl_jax.data.records import RecordingInfo
from rearl_jax.data.schema import validate


def test_a_cut_track_goes_on_under_a_new_id_and_followers_follow():
    frames = np.arange(6)
    table = pd.DataFrame(
        {
            "track_id": np.repeat([1, 2], 6),
            "frame": np.tile(frames, 2),
            "leader_id": pd.array([None] * 6 + [1] * 6, dtype="Int64"),
        }
    )
    starts = np.zeros(12, dtype=bool)
    starts[[2, 4, 9]] = True
    cut = split_tracks(table, starts)
    assert cut["track_id"].tolist() == [1, 1, 2, 2, 2, 3, 3, 4, 4, 5, 5, 5]
    leaders = cut.set_index(["track_id", "frame"])["leader_id"]
    assert leaders[2].tolist() == [1, 1, 3]
    assert leaders[5].tolist() == [3, 4, 4]
    assert leaders[[1, 3, 4]].isna().all()


def test_a_leader_without_a_row_becomes_unknown():
    table = pd.DataFrame(
        {
            "track_id": [1, 1, 2, 2, 2],
            "frame": [0, 2, 0, 1, 2],
            "leader_id": pd.array([None, None, 1, 1, 1], dtype="Int64"),
        }
    )
    cut = split_tracks(table, np.array([False, True, False, False, False]))
    assert cut["track_id"].tolist() == [1, 2, 2, 2, 3]
    leader = cut["leader_id"].to_numpy(np.float64, na_value=np.nan)[1:4]
    np.testing.assert_array_equal(leader, [1.0, np.nan, 3.0])


def test_rows_of_an_unknown_track_leave_the_new_ids_alone():
    table = pd.DataFrame({"track_id": [1.0, 1.0, 1.0, 2.0, np.nan], "frame": [0, 2, 3, 0, 0]})
    cut = split_tracks(table, np.array([False, True, False, False, False]))
    np.testing.assert_array_equal(cut["track_id"], [1.0, 2.0, 3.0, 3.0, np.nan])


def test_pieces_below_one_second_go_and_are_counted(vehicle_rows):
    info = RecordingInfo("made", 10.0, {1: 2}, 300.0, "", "", "")
    spoiled = vehicle_rows.copy()
    spoiled.loc[[40, 45], "speed"] = np.nan
    table, dropped = validate(spoiled, info, DataConfig(on_bad=BadRows.drop_row))
    # Rows 41 to 44 stand between the two holes.
    assert dropped == {"not_finite": 2, "gap_cuts": 2, "fragment": 4, "tracks": 1}
    assert table.groupby("track_id").size().sort_values().tolist() == [40, 54, 100, 100]
    short_but_whole = vehicle_rows[(vehicle_rows["track_id"] != 2) | (vehicle_rows["frame"] < 12)]
    table, dropped = validate(short_but_whole, info, DataConfig(on_bad=BadRows.drop_row))
    assert dropped == {}
    assert (table["track_id"] == 2).sum() == 5


def test_an_empty_table_stays_empty():
    table = pd.DataFrame({"track_id": [], "frame": [], "leader_id": []})
    assert split_tracks(table, np.zeros(0, dtype=bool)).empty
