"""Points of the grid, and how shares are said."""

import pytest

from rearl_jax.baselines.critical.mixture import ALL_REGULAR, Mixture, grid
from rearl_jax.config.critical import CriticalConfig, shares_problem
from rearl_jax.problems import InvalidInputError


def test_the_grid_has_56_points_that_are_mixtures():
    points = grid()
    assert len(points) == len(set(points)) == 56
    assert not any(shares_problem(point) for point in points)
    assert {share for point in points for share in point} == {0.0, 0.2, 0.4, 0.6, 0.8, 1.0}
    assert {ALL_REGULAR, Mixture(0.4, 0.4, 0.2), Mixture(0.0, 0.0, 1.0)} <= set(points)


def test_the_rest_is_regular():
    mixture = Mixture(0.25, 0.5, 0.05)
    assert mixture.regular == pytest.approx(0.2)
    assert mixture.written() == "aggressive 25 %, defensive 50 %, truck 5 %, regular 20 %"
    assert Mixture(0.7, 0.2, 0.1).regular >= 0.0


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("ratios", (0.5, 0.6, 0.0)),
        ("ratios", (-0.1, 0.6, 0.0)),
        ("ratios", (float("nan"), 0.6, 0.0)),
        ("rounds", 0),
        ("history", -1),
    ],
)
def test_keys_outside_their_range_are_refused(key, value):
    with pytest.raises(InvalidInputError) as caught:
        CriticalConfig(**{key: value}).check()
    assert (caught.value.code, caught.value.problem.key) == ("out-of-range", key)
