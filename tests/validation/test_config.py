import pytest

from rearl_jax.config.validation import SceneCountsConfig, ValidationConfig


def test_defaults_are_valid():
    ValidationConfig().check()
    SceneCountsConfig().check()


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (["share=0"], "validation.share must be within 0 (excluded) and 1, got 0"),
        (["share=1.5"], "validation.share must be within 0 (excluded) and 1, got 1.5"),
        (["seconds=0"], "validation.seconds must be at least 1, got 0"),
        (["seconds=2.5"], "validation.seconds must be int"),
        (["seed=-1"], "validation.seed must be at least 0, got -1"),
        (["workers=0"], "validation.workers must be at least 1 or null, got 0"),
        (["control_share=-0.1"], "validation.control_share must be within 0 and 1, got -0.1"),
        (["least_agree_share=99"], "validation.least_agree_share must be within 0 and 1, got 99"),
        (["tolerance_f64=0"], "validation.tolerance_f64 must be positive and finite [m], got 0"),
        (["tolerance_f32=nan"], "validation.tolerance_f32 must be float, got nan"),
        (["least_crashes=-5"], "validation.least_crashes must be at least 0, got -5"),
        (["scenes.env10=-1"], "validation.scenes.env10 must be at least 0, got -1"),
        (["scenes.env11=4"], "'validation.scenes.env11'"),
        (["tolerance=1e-9"], "'validation.tolerance'"),
    ],
)
def test_bad_values_are_refused_by_the_name_of_the_key(validate, replayed, tmp_path, keys, said):
    done = validate(tmp_path, *[f"validation.{key}" for key in keys], stress10=3)
    assert done.code == 2
    assert said in done.said
    assert done.said.count("\n") == 1
    assert replayed.asked == []
    assert list(tmp_path.iterdir()) == []


def test_nothing_to_compare_is_refused(validate, tmp_path):
    done = validate(tmp_path)
    assert done.code == 2
    assert "validation.scenes.road2 must be > 0" in done.said
    assert list(tmp_path.iterdir()) == []
