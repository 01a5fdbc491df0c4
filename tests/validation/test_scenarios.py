import dataclasses

import numpy as np
import pytest

from rearl_jax.config.validation import SceneCountsConfig, ValidationConfig
from rearl_jax.validation.scenarios import SETS, SIZES, Source
from rearl_jax.validation.task import n_scenes

BY_NAME = {chosen.name: chosen for chosen in SETS}


def draw(name, index=0, seed=0, n_seconds=20):
    return BY_NAME[name].scenario(index, seed=seed, n_seconds=n_seconds)


def test_every_set_has_a_number_in_the_configuration_and_a_size_in_the_report():
    assert [chosen.name for chosen in SETS] == [field.name for field in dataclasses.fields(SceneCountsConfig)]
    assert {chosen.size for chosen in SETS} == set(SIZES)


@pytest.mark.parametrize("name", BY_NAME)
def test_drawn_again_a_scene_is_the_same_and_no_two_are_alike(name):
    drawn = {(index, seed): draw(name, index, seed) for index in range(3) for seed in (0, 1)}
    assert len({scenario.identity() for scenario in drawn.values()}) == 6
    for (index, seed), scenario in drawn.items():
        again = draw(name, index, seed)
        assert again == scenario
        assert again.identity() == scenario.identity()
        assert (scenario.set_name, scenario.index) == (name, index)


def test_sets_of_the_same_kind_do_not_share_their_scenes():
    seeds = [draw(name).seed for name in BY_NAME]
    assert len(set(seeds)) == len(seeds)


@pytest.mark.parametrize("name", ["multi10", "edge10"])
def test_a_longer_scene_begins_like_a_shorter_one(name):
    short, long = draw(name, n_seconds=5), draw(name, n_seconds=9)
    assert (short.n_seconds, long.n_seconds) == (5, 9)
    assert long.actions[:5] == short.actions
    assert dataclasses.replace(long, actions=short.actions) == short


@pytest.mark.parametrize("name", BY_NAME)
def test_a_scene_holds_the_vehicles_and_actions_of_its_set(name):
    chosen, scenario = BY_NAME[name], draw(name, index=1)
    actions = np.array(scenario.actions).reshape(20, -1)
    assert actions.shape == (20, chosen.n_meta)
    if chosen.n_meta:
        assert set(actions.ravel()) == {0, 1, 2, 3, 4}
    assert scenario.n_vehicles == chosen.n_idm + chosen.n_meta >= chosen.size
    assert (scenario.injection is not None) == (chosen.source is Source.injected)
    if scenario.injection is not None:
        assert sum(scenario.injection.is_meta) == chosen.n_meta
        for column in ("x", "y", "heading", "speed", "desired_speed", "is_meta"):
            assert len(getattr(scenario.injection, column)) == chosen.n_vehicles


def test_stress_scenes_are_shuffled_and_of_very_different_speeds():
    injection = draw("stress30").injection
    assert list(injection.x) != sorted(injection.x)
    assert np.ptp(injection.speed) > 15
    assert set(injection.y) == {0.0, 4.0, 8.0, 12.0}


def test_two_vehicles_share_a_lane_in_every_other_scene():
    pairs = [draw("stress2", index).injection.y for index in range(12)]
    assert all(first == second for first, second in pairs[::2])
    assert any(first != second for first, second in pairs[1::2])


def test_edge_scenes_start_before_the_road_and_about_its_end():
    before, end = draw("edge10", 0).injection, draw("edge10", 1).injection
    assert -300 <= min(before.x) < 0
    assert 9_000 <= max(end.x) <= 10_020


def test_drivers_differ_in_every_parameter():
    injection = draw("drivers10").injection
    names = [name for name, _ in injection.parameters]
    assert len(set(names)) == len(names) == 13
    pooled = {name: set() for name in names}
    for index in range(4):
        for name, values in draw("drivers10", index).injection.parameters:
            assert len(values) == 10
            pooled[name] |= set(values)
    for name, values in pooled.items():
        assert values == {True, False} if name in ("changes_lanes", "collides") else len(values) == 40, name


def test_identity_is_of_the_content_alone():
    scenario = draw("edge10")
    renamed = dataclasses.replace(scenario, set_name="another", index=7)
    assert renamed.identity() == scenario.identity()
    injection = dataclasses.replace(scenario.injection, x=(scenario.injection.x[0] + 1e-9, *scenario.injection.x[1:]))
    others = {
        "source": Source.env,
        "seed": scenario.seed + 1,
        "n_idm": scenario.n_idm + 1,
        "n_meta": scenario.n_meta + 1,
        "speed_levels": scenario.speed_levels[1:],
        "actions": scenario.actions[1:],
        "injection": injection,
    }
    identities = {dataclasses.replace(scenario, **{name: value}).identity() for name, value in others.items()}
    assert len(identities | {scenario.identity()}) == 1 + len(others)


@pytest.mark.parametrize(("share", "expected"), [(1.0, 100), (0.5, 50), (0.07, 7), (0.071, 8), (0.001, 1)])
def test_a_share_of_the_scenes_is_rounded_up(share, expected):
    assert n_scenes(BY_NAME["road10"], ValidationConfig(share=share)) == expected


def test_a_set_without_scenes_stays_without():
    options = ValidationConfig(share=0.01, scenes=SceneCountsConfig(road10=0))
    assert n_scenes(BY_NAME["road10"], options) == 0
