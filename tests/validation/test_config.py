import pytest

from rearl_jax.config._schema import finished
from rearl_jax.config.validation import SceneCountsConfig, ValidationConfig
from tests.refusal import refused


def test_defaults_are_valid():
    finished(ValidationConfig())


@pytest.mark.parametrize(
    ("code", "key", "value"),
    [
        ("out-of-range", "share", 0.0),
        ("out-of-range", "share", 1.5),
        ("out-of-range", "seconds", 0),
        ("out-of-range", "seed", -1),
        ("out-of-range", "workers", 0),
        ("out-of-range", "control_share", -0.1),
        ("out-of-range", "least_agree_share", 99.0),
        ("out-of-range", "tolerance_f64", 0.0),
        ("wrong-type", "tolerance_f32", float("nan")),
        ("out-of-range", "least_crashes", -5),
        ("out-of-range", "scenes.env10", -1),
    ],
)
def test_bad_values_are_refused_by_the_name_of_the_key(code, key, value):
    group, _, name = key.rpartition(".")
    changes = {group: SceneCountsConfig(**{name: value})} if group else {name: value}
    with refused(code, key=key):
        finished(ValidationConfig(**changes))


def test_nothing_to_compare_is_refused(validate, tmp_path):
    done = validate(tmp_path)
    assert done.code == 2
    assert "validation.scenes.road2" in done.said
    assert list(tmp_path.iterdir()) == []
