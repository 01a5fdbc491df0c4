"""Ranges of the keys of scenes."""

import pytest

from rearl_jax.config.scenes import ScenesConfig, TracksConfig
from tests.refusal import refused


def test_stride_follows_seconds_unless_given():
    assert ScenesConfig(seconds=30).stride_seconds == 30.0
    assert ScenesConfig(seconds=30, stride=5.0).stride_seconds == 5.0


def test_defaults_are_sound():
    ScenesConfig().check()
    TracksConfig().check()


@pytest.mark.parametrize(
    ("record", "key", "value"),
    [
        (ScenesConfig(seconds=1), "seconds", 1),
        (ScenesConfig(slots=1), "slots", 1),
        (ScenesConfig(min_vehicles=9), "min_vehicles", 9),
        (ScenesConfig(stride=0.0), "stride", 0.0),
        (TracksConfig(min_frames=1), "min_frames", 1),
        (TracksConfig(points=1), "points", 1),
    ],
)
def test_values_out_of_range_are_refused_by_their_key(record, key, value):
    with refused("out-of-range", key=key, value=value):
        record.check()
