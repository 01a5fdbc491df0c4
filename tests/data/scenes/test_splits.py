"""Splits: the paper's sizes, what happens with few scenes, and that no second of traffic is in two splits."""

import re
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from rearl_jax.config.scenes import SplitConfig, SplitUnit
from rearl_jax.data.scenes.splits import Split, split_for_evaluation, split_scenes, split_sizes, split_windows
from tests.evaluation.conftest import made_scenes
from tests.refusal import refused

SECONDS = 60.0


def windows(n_recordings: int, duration: float, stride: float = SECONDS, both_directions: bool = False):
    """Recording and start of all windows of equally long recordings."""
    starts = np.arange(0.0, duration - SECONDS + 1e-9, stride)
    starts = np.repeat(starts, 2) if both_directions else starts
    names = [f"r{i:02d}" for i in range(n_recordings)]
    return np.repeat(names, len(starts)), np.tile(starts, n_recordings)


def seconds_of(recording, start_time, indices) -> set[tuple[str, int]]:
    """All (recording, second) the windows contain; starts are whole seconds."""
    return {(recording[i], int(start_time[i]) + second) for i in indices for second in range(int(SECONDS))}


def assert_no_shared_second(recording, start_time, splits):
    used = [splits.indices(split) for split in Split if split is not Split.DROPPED]
    seconds = [seconds_of(recording, start_time, indices) for indices in used]
    for one, other in combinations(seconds, 2):
        assert not one & other


def test_the_paper_sizes():
    recording, start = windows(57, 13 * SECONDS)
    splits = split_windows(recording, start, SECONDS, SplitConfig())
    assert len(recording) == 741
    assert splits.summary() == {
        "rest": 526, "threshold": 150, "tuning": 15, "evaluation": 50, "crossing": 0, "surplus": 0
    }  # fmt: skip


@pytest.mark.parametrize(
    ("n_scenes", "evaluation", "threshold", "tuning"),
    [
        (741, 50, 150, 15),
        (740, 50, 148, 15),
        (7410, 50, 1482, 15),
        (370, 25, 74, 7),
        (100, 7, 20, 5),
        (13, 5, 3, 5),
        (11, 5, 2, 4),
        (8, 5, 2, 1),
        (7, 5, 1, 1),
    ],
)
def test_sizes_scale_and_evaluation_comes_first(n_scenes, evaluation, threshold, tuning):
    sizes = split_sizes(n_scenes, SplitConfig())
    assert sizes == {"evaluation": evaluation, "threshold": threshold, "tuning": tuning}


def test_sizes_given_by_the_user_are_kept():
    assert split_sizes(20, SplitConfig(evaluation=17)) == {"evaluation": 17, "threshold": 2, "tuning": 1}
    assert split_sizes(3, SplitConfig(evaluation=1)) == {"evaluation": 1, "threshold": 1, "tuning": 1}
    assert split_sizes(741, SplitConfig(threshold=300))["threshold"] == 300


@pytest.mark.parametrize("split", [SplitConfig(), SplitConfig(evaluation=4, tuning=2)])
def test_too_few_scenes_stop(split):
    with refused("scenes-too-few"):
        split_sizes(6, split)


def test_equal_seeds_give_equal_splits_and_others_do_not():
    recording, start = windows(10, 10 * SECONDS)
    one, same, other = (split_windows(recording, start, SECONDS, SplitConfig(seed=s)) for s in (1, 1, 2))
    np.testing.assert_array_equal(one.label, same.label)
    assert set(one.evaluation) != set(other.evaluation)


@pytest.mark.parametrize("unit", SplitUnit)
def test_evaluation_does_not_depend_on_the_other_sizes(unit):
    recording, start = windows(20, 10 * SECONDS)
    one = split_windows(recording, start, SECONDS, SplitConfig(unit))
    other = split_windows(recording, start, SECONDS, SplitConfig(unit, threshold=90, tuning=3))
    np.testing.assert_array_equal(one.evaluation, other.evaluation)
    assert len(other.threshold) > len(one.threshold)


def test_overlapping_scenarios_are_refused():
    recording, start = windows(10, 10 * SECONDS, stride=59.0)
    with refused("windows-overlap", key="split.unit"):
        split_windows(recording, start, SECONDS, SplitConfig())


def test_recordings_stay_whole():
    recording, start = windows(20, 7 * SECONDS)
    splits = split_windows(recording, start, SECONDS, SplitConfig(SplitUnit.recording))
    parts = [set(recording[splits.indices(split)]) for split in Split if split is not Split.DROPPED]
    assert all(parts)
    assert not any(one & other for one, other in combinations(parts, 2))
    assert splits.n_surplus == np.sum(splits.label == Split.DROPPED) > 0
    assert len(splits.evaluation) == splits.requested["evaluation"]


def test_windows_over_the_border_of_two_splits_are_dropped_and_counted():
    recording, start = windows(1, 1200.0, stride=10.0)
    splits = split_windows(recording, start, SECONDS, SplitConfig(SplitUnit.block, evaluation=25, threshold=25))
    crosses = start // 300 != (start + SECONDS - 1) // 300
    assert crosses.sum() == 15
    # Four blocks of four splits: every border lies between two of them.
    assert splits.n_crossing == 15
    assert (splits.label[crosses] == Split.DROPPED).all()
    assert (len(splits.evaluation), len(splits.threshold)) == (25, 25)
    assert_no_shared_second(recording, start, splits)


def test_windows_over_the_border_inside_one_split_are_kept():
    recording, start = windows(4, 1200.0, stride=10.0)
    crosses = start // 300 != (start + SECONDS - 1) // 300
    splits = split_windows(recording, start, SECONDS, SplitConfig(SplitUnit.block))
    assert (splits.label[crosses] == Split.REST).any()
    assert 0 < splits.n_crossing < crosses.sum()


def test_both_carriageways_of_a_window_stay_together():
    recording, start = windows(5, 10 * SECONDS, both_directions=True)
    splits = split_windows(recording, start, SECONDS, SplitConfig())
    pairs = splits.label.reshape(-1, 2)
    together = (pairs[:, 0] == pairs[:, 1]) | (pairs == Split.DROPPED).any(axis=1)
    assert together.all()
    assert_no_shared_second(recording, start, splits)


def test_no_two_splits_share_a_second_of_traffic():
    """Random sets of windows: recordings, strides, blocks, gaps left by rejected windows, all units."""
    rng = np.random.default_rng(0)
    n_split, n_dropped, n_refused = (dict.fromkeys(SplitUnit, 0) for _ in range(3))
    for seed in range(120):
        unit = list(SplitUnit)[seed % 3]
        stride = float(rng.choice([1, 7, 20, 45, 60, 90]))
        config = SplitConfig(unit, seed, block_seconds=float(rng.choice([60, 75, 300])))
        recording, start = windows(rng.integers(1, 9), rng.integers(2, 26) * SECONDS, stride, rng.random() < 0.5)
        kept = rng.random(len(recording)) >= rng.uniform(0.0, 0.7)
        recording, start = recording[kept], start[kept]
        try:
            splits = split_windows(recording, start, SECONDS, config)
        except ValueError:
            n_refused[unit] += 1
            continue
        assert_no_shared_second(recording, start, splits)
        sizes = splits.summary()
        assert sum(sizes.values()) == len(recording)
        assert splits.n_crossing + splits.n_surplus == np.sum(splits.label == Split.DROPPED)
        assert all(0 < sizes[name] <= size for name, size in splits.requested.items())
        assert sizes["evaluation"] >= 5
        n_split[unit] += 1
        n_dropped[unit] += splits.n_crossing
    assert min(n_split.values()) >= 8
    assert n_dropped[SplitUnit.block] > 200
    assert n_refused[SplitUnit.scenario] >= 8, "overlapping scenarios must have occurred"


def test_the_property_sees_a_leak():
    """The check above is not blind: labels drawn at random for overlapping windows fail it."""
    recording, start = windows(2, 600.0, stride=10.0)
    splits = split_windows(recording, start, SECONDS, SplitConfig(SplitUnit.block, block_seconds=120.0))
    assert_no_shared_second(recording, start, splits)
    splits.label[:] = np.random.default_rng(0).integers(0, 4, len(recording))
    with pytest.raises(AssertionError):
        assert_no_shared_second(recording, start, splits)


@pytest.mark.parametrize(
    ("arguments", "split", "code", "facts"),
    [
        ((4, 600.0), SplitConfig(SplitUnit.block, block_seconds=30.0), "out-of-range", ["split.block_seconds", "60 s"]),
        (
            (2, 600.0),
            SplitConfig(SplitUnit.recording),
            "split-too-small",
            ["evaluation split", "0 of 5", "2 units"],
        ),
        (
            (1, 900.0),
            SplitConfig(SplitUnit.block, block_seconds=900.0),
            "split-too-small",
            ["1 units", "split.block_seconds"],
        ),
    ],
)
def test_units_that_cannot_serve_three_splits(arguments, split, code, facts):
    recording, start = windows(*arguments)
    with refused(code) as caught:
        split_windows(recording, start, SECONDS, split)
    assert all(fact in str(caught.value) for fact in facts), str(caught.value)


@pytest.mark.parametrize(
    ("split", "key"),
    [
        (SplitConfig(seed=-1), "seed"),
        (SplitConfig(block_seconds=0.0), "block_seconds"),
        (SplitConfig(tuning=0), "tuning"),
    ],
)
def test_bad_values_are_refused(split, key):
    with refused("out-of-range", key=key):
        split.check()


def scenes_of(recording, start_time):
    """Scenes at these windows."""
    return replace(made_scenes().select(np.zeros(len(recording), int)), recording=recording, start_time=start_time)


@pytest.mark.parametrize(("n", "evaluation"), [(1, 1), (2, 2), (6, 5)])
def test_an_evaluation_of_few_scenes_needs_no_other_splits(n, evaluation):
    recording, start = windows(1, n * SECONDS)
    scenes = scenes_of(recording, start)
    with refused("scenes-too-few"):
        split_scenes(scenes, SplitConfig())
    splits = split_for_evaluation(scenes, SplitConfig())
    assert (len(splits.evaluation), len(splits.threshold), len(splits.tuning)) == (evaluation, 0, 0)
    with refused("out-of-range", key="split.evaluation"):
        split_for_evaluation(scenes, SplitConfig(evaluation=n + 1))


def test_an_evaluation_of_enough_scenes_has_those_of_all_methods():
    recording, start = windows(10, 10 * SECONDS)
    scenes = scenes_of(recording, start)
    every, alone = split_scenes(scenes, SplitConfig()), split_for_evaluation(scenes, SplitConfig())
    np.testing.assert_array_equal(every.label, alone.label)


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_the_advice_to_cut_shorter_scenes_gives_enough_of_them(n):
    with refused("scenes-too-few") as caught:
        split_sizes(n, SplitConfig(), SECONDS)
    shorter = int(re.search(r"scenes.seconds=(\d+)", caught.value.problem.remedy)[1])
    assert sum(split_sizes(n * int(SECONDS // shorter), SplitConfig()).values()) >= 7
    if n >= 3:
        advised = re.search(r"split.evaluation=(\d+)", caught.value.problem.remedy)[1]
        split_sizes(n, SplitConfig(evaluation=int(advised), threshold=1, tuning=1))
