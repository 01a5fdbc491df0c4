"""Lane numbers that stand for an unknown lane or count from another number, by the lateral positions of their rows."""

import pytest

from rearl_jax.config.data import BadRows
from tests.data.table_files import read_rows
from tests.refusal import refused


@pytest.mark.parametrize("number", [9, 4, 2])
def test_a_number_for_an_unknown_lane_is_a_fault_of_its_rows_and_makes_no_lane(timed_rows, number):
    timed_rows.loc[[20, 60, 130, 270], "lane"] = number
    with refused("lane-out-of-range", column="lane", row=21):
        read_rows(timed_rows)
    recording = read_rows(timed_rows, on_bad=BadRows.drop_row)
    assert recording.dropped["lane_out_of_range"] == 4
    assert recording.info.lane_count == {1: 2}


@pytest.mark.parametrize("on_bad", [BadRows.stop, BadRows.drop_row])
def test_lanes_that_count_from_below_0_stop_and_lose_no_lane(timed_rows, on_bad):
    with refused("wrong-origin", column="lane", row=1):
        read_rows(timed_rows.assign(lane=timed_rows["lane"] - 1), on_bad=on_bad)


def test_minus_1_in_all_lanes_is_an_unknown_lane(timed_rows):
    timed_rows.loc[[*range(10, 30), *range(110, 130)], "lane"] = -1
    with refused("lane-out-of-range", column="lane", row=11):
        read_rows(timed_rows)
    assert read_rows(timed_rows, on_bad=BadRows.drop_row).dropped["lane_out_of_range"] == 40


def test_laterals_that_count_from_the_middle_of_a_lane_are_noted(timed_rows):
    def notes(rows):
        return [note for note in read_rows(rows).info.notes if "middle of a lane" in note]

    assert not notes(timed_rows)
    assert len(notes(timed_rows.assign(lateral=timed_rows["lateral"] - 1.75))) == 1
