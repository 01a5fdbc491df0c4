"""Ranges of the configuration: a value that cannot be used is refused with the name of its key."""

import pytest

from rearl_jax.config.metrics import (
    FeatureConfig,
    HistConfig,
    MapeConfig,
    MapeDefinition,
    MetricsConfig,
    RealismConfig,
    SafetyConfig,
    ThwConfig,
)
from rearl_jax.metrics import METRICS
from rearl_jax.problems import InvalidInputError

RECORDS = (HistConfig, ThwConfig, SafetyConfig, FeatureConfig, RealismConfig, MetricsConfig)
NO_WEIGHT = FeatureConfig(weight=0.0)


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.__name__)
def test_defaults_are_accepted_and_static(record):
    record().check()
    assert hash(record()) == hash(record())
    assert hash(MapeConfig()) == hash(MapeConfig())


@pytest.mark.parametrize(
    ("record", "key"),
    [
        (HistConfig(low=32.0), "high"),
        (HistConfig(n_bins=0), "n_bins"),
        (HistConfig(window=0), "window"),
        (ThwConfig(v_min=0.0), "v_min"),
        (SafetyConfig(ttc=0.0), "ttc"),
        (SafetyConfig(drac=-3.35), "drac"),
        (SafetyConfig(jerk=float("nan")), "jerk"),
        (FeatureConfig(low=1.0), "high"),
        (FeatureConfig(n_bins=0), "n_bins"),
        (FeatureConfig(weight=-1.0), "weight"),
        (RealismConfig(pseudocount=0.0), "pseudocount"),
        (RealismConfig(collision_pseudocount=0.0), "collision_pseudocount"),
        (RealismConfig(collision_weight=-0.1), "collision_weight"),
        (
            RealismConfig(
                speed=NO_WEIGHT,
                acceleration=NO_WEIGHT,
                distance=NO_WEIGHT,
                ttc=NO_WEIGHT,
                collision_weight=0.0,
            ),
            "collision_weight",
        ),
        (MetricsConfig(frame_interval=0.0), "frame_interval"),
    ],
    ids=lambda value: type(value).__name__ if not isinstance(value, str) else value[:20],
)
def test_unusable_values_are_refused(record, key):
    with pytest.raises(InvalidInputError) as caught:
        record.check()
    assert (caught.value.code, caught.value.problem.key) == ("out-of-range", key)


def test_every_spacing_error_is_a_metric_under_its_column():
    columns = [MapeConfig(definition).column for definition in MapeDefinition]
    assert columns == ["mape_a", "mape_b", "mape_c"]
    assert set(columns) < set(METRICS)
