from dataclasses import replace

import pytest

pytest.importorskip("libsumo", reason="the extra `bench` is not installed")

from benchmarks.sumo import SumoRoads  # noqa: E402 (only where the library is)


def test_all_vehicles_drive_and_change_lanes():
    roads = SumoRoads(20, 60, 2.0)
    run = roads.measure(2, 1)
    assert (run.n_scenarios, run.seconds, run.n_substeps) == (2, 60, 2 * 20 * 900)
    assert run.lane_changes > 0
    assert 15 < run.mean_speed < 25
    again = roads.measure(2, 1)
    assert replace(again, cpu_s=0.0, wall_s=0.0) == replace(run, cpu_s=0.0, wall_s=0.0)


def test_the_road_is_long_enough_for_everybody():
    assert SumoRoads(1000, 2, 2.0).measure(1, 1).n_substeps == 1000 * 2 * 15
