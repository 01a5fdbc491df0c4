"""Ranges of the keys of scenes."""

import pytest

from rearl_jax.config.scenes import ScenesConfig, TracksConfig


def test_stride_follows_seconds_unless_given():
    assert ScenesConfig(seconds=30).stride_seconds == 30.0
    assert ScenesConfig(seconds=30, stride=5.0).stride_seconds == 5.0


def test_defaults_are_sound():
    ScenesConfig().check()
    TracksConfig().check()


@pytest.mark.parametrize(
    ("record", "message"),
    [
        (ScenesConfig(seconds=1), "seconds must be at least 2, got 1"),
        (ScenesConfig(slots=1), "slots must be at least 2"),
        (ScenesConfig(min_vehicles=9), "min_vehicles must be at least slots = 10, got 9"),
        (ScenesConfig(stride=0.0), "stride must be > 0 s, got 0.0"),
        (TracksConfig(min_frames=1), "min_frames must be at least 2"),
        (TracksConfig(points=1), "points must be at least 2"),
    ],
)
def test_values_out_of_range_start_with_the_key(record, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        record.check()
