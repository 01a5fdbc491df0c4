"""Shares of driver classes on constructed tracks."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.baselines.critical.statistics import Stretch, driving_of, recorded_mixture
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.problems import InvalidInputError

RATE = 5


def track(number, speed, *, wave=0.0, lanes=(1,), kind="car", first=0, seconds=20, direction=1):
    """A vehicle whose speed swings by `wave` every two seconds and that passes through some lanes."""
    n = seconds * RATE
    time = np.arange(n) / RATE
    swinging = speed + wave * np.sign(np.sin(np.pi * time / 2 + 1e-6))
    lane = np.asarray(lanes)[np.minimum(np.arange(n) * len(lanes) // n, len(lanes) - 1)]
    return pd.DataFrame(
        {
            "track_id": number,
            "frame": first + np.arange(n),
            "direction": direction,
            "lane": pd.array(lane, "Int8"),
            "speed": swinging,
            "vehicle_class": kind,
        }
    )


def recording(*tracks, name="a"):
    info = RecordingInfo(name, float(RATE), {1: 3}, 400.0, "a set", "CC0", "somebody")
    return Recording(info, pd.concat(tracks, ignore_index=True))


@pytest.fixture
def road():
    """Four fast and active cars, six slow and calm ones, eight in between; two trucks; a motorcycle."""
    tracks = [track(i, 36.0 + 0.1 * i, wave=1.5, lanes=(2, 1, 0)) for i in range(4)]
    tracks += [track(10 + i, 20.0 + 0.1 * i, wave=0.1) for i in range(6)]
    tracks += [track(20 + i, 29.0 + 0.1 * i, wave=0.4) for i in range(8)]
    tracks += [track(30 + i, 23.0, kind="truck") for i in range(2)]
    tracks += [track(40, 50.0, kind="motorcycle", lanes=(0, 1, 0, 1, 0))]
    return recording(*tracks)


def whole():
    return {"a": [Stretch(0, 1000)]}


def test_groups_are_fast_and_active_slow_and_the_rest(road):
    mixture = recorded_mixture(driving_of([road], whole()))
    assert mixture == pytest.approx((4 / 20, 6 / 20, 2 / 20))
    assert mixture.regular == pytest.approx(8 / 20)


def test_a_vehicle_is_described_by_speed_change_of_speed_and_lane_changes():
    driving = driving_of([recording(track(1, 30.0, wave=1.0, lanes=(2, 1, 2)), track(2, 20.0))], whole())
    assert driving.speed == pytest.approx([30.0, 20.0])
    # Half of all pairs a second apart lie on both sides of a jump by 2 m/s.
    assert driving.acceleration == pytest.approx([1.0, 0.0], abs=0.06)
    assert driving.lane_changes.tolist() == [2, 0]
    assert driving.is_truck.tolist() == [False, False]


@pytest.mark.parametrize("rate", [0.5, 2.5, 12.5, 25.0, 29.97])
def test_the_change_of_speed_is_per_second_at_every_frame_rate(rate):
    accelerating = recording(track(1, 0.0))
    speed = 10.0 + accelerating.table["frame"].to_numpy() / rate * 0.7
    info = replace(accelerating.info, frame_rate=rate)
    driving = driving_of([Recording(info, accelerating.table.assign(speed=speed))], whole())
    assert driving.acceleration == pytest.approx([0.7])


def test_only_what_is_driven_in_the_stretches_counts(road):
    late = track(50, 40.0, first=500)
    other_side = track(51, 40.0, direction=2)
    short = track(52, 40.0, seconds=1)
    unseen = recording(track(1, 10.0), name="b")
    both = recording(road.table, late, other_side, short)
    stretches = {"a": [Stretch(0, 50, 1), Stretch(40, 100, 1)]}
    found = driving_of([both, unseen], stretches)
    assert len(found.speed) == 20  # neither the motorcycle nor those above
    np.testing.assert_allclose(found.speed, driving_of([road], {"a": [Stretch(0, 100)]}).speed)
    halved = driving_of([road], {"a": [Stretch(0, 10)]})
    assert halved.lane_changes.sum() == 0  # the lanes are changed later


def test_unknown_lanes_are_no_lane_changes(road):
    blind = replace(road, table=road.table.assign(lane=pd.array([pd.NA] * len(road.table), "Int8")))
    driving = driving_of([blind], whole())
    assert driving.lane_changes.sum() == 0
    assert recorded_mixture(driving) == pytest.approx((4 / 20, 6 / 20, 2 / 20))


def test_too_few_cars_say_what_to_do():
    alike = recording(*(track(i, 30.0) for i in range(9)), track(10, 20.0))
    with pytest.raises(InvalidInputError) as caught:
        recorded_mixture(driving_of([alike], whole()))
    assert caught.value.code == "cars-too-few"
