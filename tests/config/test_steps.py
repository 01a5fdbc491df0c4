import pytest

from rearl_jax.config.study import StepsConfig
from tests.refusal import refused


def test_steps_can_be_left_out():
    StepsConfig(steps_batches=()).check()


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({"steps_batches": (2, 2)}, "steps_batches"),
        ({"steps": 0}, "steps"),
        ({"reference_vehicles": 1}, "reference_vehicles"),
        ({"steps": 70}, "reference_seconds"),
        ({"seed": -1}, "seed"),
        ({"density": 0.0}, "density"),
    ],
)
def test_ranges(changed, key):
    with refused("out-of-range", key=key):
        StepsConfig(**changed).check()
