"""What the columns show before any model."""

import pytest

from rearl_jax.discovery.gate import gate


def test_a_clean_data_set_shows_nothing(recordings_of):
    assert gate(recordings_of()) == []


@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [
        ("speed_lag", "lag", 0.5),
        ("position_lag", "lag", 0.5),
        ("speed_scale", "factor", 1.05),
        ("position_noise", "sd", 0.4),
    ],
)
def test_faults_between_columns_are_named_and_measured(recordings_of, name, parameter, value):
    (found,) = gate(recordings_of(name))
    assert (found.name, found.parameter) == (name, parameter)
    assert found.value == pytest.approx(value, rel=0.1)


def test_smoothed_tracks_are_noticed(recordings_of):
    assert "smoothing" in [finding.name for finding in gate(recordings_of("smoothing"))]
