from dataclasses import replace

import numpy as np

from benchmarks.highway import HighwayRoads


def traffic(run):
    return replace(run, cpu_s=0.0, wall_s=0.0)


def test_scenes_follow_from_the_seed_and_change_lanes():
    roads = HighwayRoads(6, 12, 2.0, cpu_s=1000.0)
    first = roads.measure(3, 5)
    assert (first.n_scenarios, first.seconds, first.n_substeps) == (3, 12, 3 * 6 * 12 * 15)
    assert first.lane_changes > 0
    assert 15 < first.mean_speed < 25
    assert first.cpu_s > 0
    assert traffic(roads.measure(3, 5)) == traffic(first)
    assert traffic(roads.measure(3, 6)) != traffic(first)


def test_ends_early_with_a_whole_second():
    run = HighwayRoads(3, 60, 2.0, cpu_s=1e-9).measure(1, 0)
    assert run.seconds == 1
    assert run.n_substeps == 3 * 15


def test_dense_traffic_collides():
    run = HighwayRoads(8, 4, 6.0, cpu_s=1000.0).measure(1, 0)
    assert run.crashed > 0


def test_every_road_is_filled_as_highway_env_does():
    road = HighwayRoads(7, 1, 2.0, cpu_s=1.0)._draw(np.random.default_rng(0))
    assert len(road.vehicles) == 7
    assert len({vehicle.DELTA for vehicle in road.vehicles}) == 7
    assert all(vehicle.check_collisions and 21 <= vehicle.speed <= 24 for vehicle in road.vehicles)
