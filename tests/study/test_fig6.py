"""Errors second by second: bands, and the figure of recordings whose scenes have no other scene to compare with."""

import numpy as np
import pytest

from rearl_jax.study.error_series import ErrorSeries, band
from rearl_jax.study.fig6_figure import draw_series

METRICS = ("h", "mape_a")


def series(name, second, values):
    errors = band(np.array(second, int), np.array(values, float))
    return ErrorSeries(name, name, dict.fromkeys(METRICS, errors))


def test_a_band_leaves_out_seconds_without_a_value():
    errors = band(np.array([0, 0, 1, 2]), np.array([0.2, 0.4, np.nan, 0.6]))
    assert errors.second.tolist() == [0, 2]
    assert errors.mean.tolist() == pytest.approx([0.3, 0.6])
    assert errors.n_values.tolist() == [2, 1]


@pytest.mark.parametrize("known", [([0, 1], [0.2, 0.3]), ([], [])])
def test_the_figure_needs_no_other_recorded_scene(known):
    drawn = draw_series([series("base", *known), series("real_vs_real", [], [])], METRICS, generated=False)
    assert drawn.startswith(b"\x89PNG")
