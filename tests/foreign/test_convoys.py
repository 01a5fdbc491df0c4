"""Tests of the convoys: each effect changes the traffic as it should, and the recordings are possible ones."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from tests.foreign import convoys
from tests.foreign.convoys import Dataset, effects, make

SEED = 1
RATE = 10


@dataclass(frozen=True)
class Following:
    """All followers of all runs, arrays [followers, frames]; `acceleration` is the speed's change over 1 s, centred."""

    gap: np.ndarray
    speed: np.ndarray
    position: np.ndarray
    leader_speed: np.ndarray
    second_speed: np.ndarray
    leader_is_truck: np.ndarray
    acceleration: np.ndarray
    leader_acceleration: np.ndarray


def slope_of(speed: np.ndarray) -> np.ndarray:
    slopes = np.zeros_like(speed)
    slopes[:, 5:-5] = speed[:, 10:] - speed[:, :-10]
    return slopes


@cache
def dataset(effect: str) -> Dataset:
    return make(effect, SEED)


@cache
def following(effect: str) -> Following:
    parts = []
    for table in dataset(effect).tables:
        count = len(np.unique(table["track_id"].to_numpy()))
        x, v, length = (table[name].to_numpy().reshape(count, -1) for name in ("position", "speed", "length"))
        truck = (table["vehicle_class"] == "truck").to_numpy().reshape(count, -1)[:, 0]
        gap = x[:-1] - x[1:] - (length[:-1] + length[1:]) / 2
        second = np.vstack([np.full_like(v[:1], np.nan), v[:-2]])
        slopes = slope_of(v)
        parts.append((gap, v[1:], x[1:], v[:-1], second, truck[:-1], slopes[1:], slopes[:-1]))
    return Following(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def gains(effect: str, *stimuli: np.ndarray) -> np.ndarray:
    """Least-squares gains of stimuli 0.3 s before, in addition to gap, speed and relative speed: medians over drivers.

    Only following above 5 m/s and below gaps of 60 m counts.
    """
    f = following(effect)
    columns = np.stack([*stimuli, f.gap, f.speed, f.leader_speed - f.speed, np.ones_like(f.gap)], axis=-1)
    found = []
    for driver in range(len(f.gap)):
        kept = (f.speed[driver] > 5.0) & (f.gap[driver] < 60.0) & np.isfinite(columns[driver]).all(axis=-1)
        kept[-10:] = kept[:10] = False
        if kept.sum() > 100 * RATE:
            answered = f.acceleration[driver][np.flatnonzero(kept) + 3]
            found.append(np.linalg.lstsq(columns[driver][kept], answered, rcond=None)[0][: len(stimuli)])
    return np.median(found, axis=0)


def time_gaps(effect: str, kept: np.ndarray) -> float:
    f = following(effect)
    kept = kept & (f.speed > 5.0)
    return float(np.median(f.gap[kept] / f.speed[kept]))


def best_lag(effect: str) -> float:
    """Lag [s] at which the relative speed correlates most with the acceleration."""
    f = following(effect)
    relative = f.leader_speed - f.speed
    lags = range(0, 25)
    agreement = [
        np.corrcoef(relative[:, 30 - lag : -30 - lag].ravel(), f.acceleration[:, 30:-30].ravel()) for lag in lags
    ]
    return float(np.argmax([matrix[0, 1] for matrix in agreement])) / RATE


def test_the_seed_decides_everything(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(convoys.dataset, "DURATION", 40.0)  # [s], instead of eight minutes
    first, second, other = (make("action_points", seed) for seed in (SEED, SEED, SEED + 1))
    assert all(one.equals(two) for one, two in zip(first.tables, second.tables, strict=True))
    assert first.values == second.values
    assert not first.tables[0].equals(other.tables[0])


def test_an_unknown_effect_is_refused() -> None:
    with pytest.raises(ValueError, match="no effect 'lens'"):
        make("lens", 0)


def test_there_are_ten_effects() -> None:
    assert len(set(effects())) == 10
    assert "control" not in effects()


@pytest.mark.parametrize("effect", ["control", *effects()])
def test_recordings_are_possible(effect: str) -> None:
    f = following(effect)
    # Four standard deviations of the position errors of two loggers, and what a clock makes of a crawling vehicle.
    assert f.gap.min() > -1.6
    assert np.median(f.gap) < 40.0
    assert 0.0 <= f.speed.min()
    assert f.speed.max() < 40.0
    assert 5.0 < f.speed.mean() < 22.0
    assert 1.0 < time_gaps(effect, np.full(f.gap.shape, True)) < 2.4
    assert np.quantile(f.acceleration, 0.0001) > -8.5
    assert f.acceleration.max() < 3.5
    moved = np.diff(f.position, axis=1)
    assert np.abs(moved * RATE - f.speed[:, 1:]).max() < 3.0


def test_drivers_of_the_runs_are_different_ones() -> None:
    lengths = [table.groupby("track_id")["length"].first() for table in dataset("control").tables]
    cars = np.concatenate([values[values < 6.0] for values in lengths])
    assert len(lengths) >= 3
    assert len(np.unique(cars)) == len(cars)


def test_delayed_drivers_react_later() -> None:
    assert best_lag("reaction_delay") >= best_lag("control") + 0.3


def test_second_leaders_are_reacted_to() -> None:
    effect, control = (
        gains(e, following(e).second_speed - following(e).speed)[0] for e in ("several_leaders", "control")
    )
    assert effect > control + 0.1


def test_the_acceleration_of_the_leader_is_reacted_to() -> None:
    effect, control = (gains(e, following(e).leader_acceleration)[0] for e in ("leader_acceleration", "control"))
    assert effect > control + 0.1


def test_time_gaps_grow_in_uneven_traffic() -> None:
    f = following("control")
    difference = np.abs(f.second_speed - f.speed) / np.maximum(f.speed, 1.0)
    # The same frames of the same runs: the lead vehicles drive alike in both.
    even, uneven = difference < 0.03, difference > 0.15
    ratio = [time_gaps("variance_driven_time_gap", kept) / time_gaps("control", kept) for kept in (even, uneven)]
    assert ratio[0] > 1.02
    assert ratio[1] > ratio[0] + 0.05


def test_time_gaps_grow_after_a_jam() -> None:
    f = following("control")
    summed = np.cumsum(f.speed, axis=1)
    remembered = np.full_like(f.speed, np.nan)
    remembered[:, 1500:] = (summed[:, 1500:] - summed[:, :-1500]) / 1500
    ratio = [time_gaps("resignation", kept) / time_gaps("control", kept) for kept in (remembered < 9, remembered > 15)]
    assert ratio[0] > ratio[1] + 0.08


def test_gaps_are_longer_behind_trucks_only() -> None:
    f = following("control")
    behind = np.broadcast_to(f.leader_is_truck[:, None], f.gap.shape)
    assert time_gaps("leader_class", behind) > 1.15 * time_gaps("control", behind)
    assert time_gaps("leader_class", ~behind) == pytest.approx(time_gaps("control", ~behind), rel=0.02)


def test_closing_in_is_reacted_to_more_than_opening() -> None:
    effect, control = (
        gains(e, np.minimum(following(e).leader_speed - following(e).speed, 0.0))[0] for e in ("asymmetry", "control")
    )
    assert effect > control + 0.1


def test_decisions_in_steps_make_jerks_rare_and_large() -> None:
    def peakedness(effect: str) -> float:
        f = following(effect)
        jerk = np.diff(f.acceleration[:, 10:-10:5], axis=1)[f.speed[:, 10:-10:5][:, 1:] > 5.0]
        return float(np.mean(jerk**4) / np.mean(jerk**2) ** 2)

    assert peakedness("action_points") > peakedness("control") + 1.0


def test_upgrades_stretch_gaps_where_they_begin() -> None:
    f, flat = following("grade"), following("control")
    values = dataset("grade").values
    longer = f.gap - flat.gap
    starts = [values[f"upgrade_{n}_start_m"] for n in range(1, 7)]
    climbing = np.any([(f.position > start + 200) & (f.position < start + 800) for start in starts], axis=0)
    before = np.any([(f.position > start - 300) & (f.position < start) for start in starts], axis=0)
    assert longer[climbing].mean() > 0.6
    assert abs(longer[before].mean()) < 0.4 * longer[climbing].mean()


def test_clocks_that_are_ahead_stamp_earlier_positions() -> None:
    f, right = following("clock_offset"), following("control")
    offset = -np.sum((f.position - right.position) * right.speed, axis=1) / np.sum(right.speed**2, axis=1)
    values = dataset("clock_offset").values
    assert offset.std() == pytest.approx(values["clock_offset_sd_s"], rel=0.1)
    assert np.abs(offset).max() < 0.55
