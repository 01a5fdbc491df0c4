"""Text of an evaluation on its scenes."""

from dataclasses import replace

import pytest

from rearl_jax.config import EvaluateTask
from rearl_jax.evaluation.remarks import data_summary


@pytest.mark.parametrize(("stride", "said"), [(None, False), (4.0, True), (11.5, True), (12.0, False)])
def test_intervals_over_scenes_that_share_traffic_are_called_too_narrow(scenes, stride, said):
    overlapping = replace(scenes, settings={**scenes.settings, "scenes.stride": stride})
    text = data_summary(EvaluateTask(), overlapping, "all of them judged")
    assert ("are too narrow" in text) is said
    assert (f"starts every {stride or 0:g} s" in text) is said
