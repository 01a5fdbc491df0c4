"""HighJax where it is installed, and how its figures are read where it is not."""

from importlib.util import find_spec

import jax
import pytest

from benchmarks.highjax import LARGEST_BATCH, HighJaxRoads


@pytest.fixture
def as_outside_of_tests():
    """HighJax mixes types and numbers of axes, which is an error in tests alone."""
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield


@pytest.mark.skipif(find_spec("highjax") is None, reason="highjax is not installed")
@pytest.mark.usefixtures("as_outside_of_tests")
def test_scenes_follow_from_the_seed_and_end_with_a_whole_second():
    roads = HighJaxRoads(24, 3, 2.0, cpu_s=1000.0)
    batch = roads.facts["unit"]
    assert 1 < batch < LARGEST_BATCH
    first = roads.measure(batch, 5)
    assert (first.n_scenarios, first.seconds, first.n_substeps) == (batch, 3, batch * 24 * 3 * 15)
    assert 10 < first.mean_speed < 30
    assert first.cpu_s > 0
    assert roads.measure(batch, 5).mean_speed == first.mean_speed
    assert roads.measure(batch, 6).mean_speed != first.mean_speed
    assert HighJaxRoads(24, 60, 2.0, cpu_s=1e-9).measure(batch, 0).seconds == 1
