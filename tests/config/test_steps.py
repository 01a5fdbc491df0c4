import pytest

from rearl_jax.config.study import StepsConfig


def test_steps_can_be_left_out():
    StepsConfig(steps_batches=()).check()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"steps_batches": (2, 2)}, "steps_batches must be positive, rising numbers"),
        ({"steps": 0}, "steps must be at least 1"),
        ({"reference_vehicles": 1}, "reference_vehicles must be at least 2"),
        ({"steps": 70}, r"reference_seconds must be at least steps \(70\), got 60"),
        ({"seed": -1}, "seed must be at least 0"),
        ({"density": 0.0}, "density must be > 0"),
    ],
)
def test_ranges(changed, message):
    with pytest.raises(ValueError, match=message):
        StepsConfig(**changed).check()
