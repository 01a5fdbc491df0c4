"""Discovery on data of a generator that is none of its own."""

import numpy as np
import pytest

from rearl_jax.config import DataConfig, DiscoverConfig, DiscoverTask, ResultsConfig
from rearl_jax.config.data import DataFormat
from tests.discovery.platoons import write_platoons

pytestmark = pytest.mark.slow  # a minute of compiling each


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize(
    ("what", "seed", "driver_noise", "position_noise", "expected"),
    [("nothing", 21, 0.15, 0.1, ("nothing", [])), ("nothing", 21, 0.0, 0.0, ("nothing", []))],
)
def test_platoons_of_highway_env(tmp_path, what, seed, driver_noise, position_noise, expected):
    from rearl_jax.discovery.task import run

    write_platoons(tmp_path / "data", what, seed, driver_noise, position_noise)
    config = DiscoverTask(
        study="platoons",
        results=ResultsConfig(str(tmp_path / "results")),
        data=DataConfig(format=DataFormat.table, root=str(tmp_path / "data")),
        discover=DiscoverConfig(page=False, base=()),
    )
    verdict = run(config)
    assert (verdict["verdict"], [effect["name"] for effect in verdict["effects"]]) == expected
    assert 0.0 < verdict["error"]["after"]["value"] < 2.0
    assert np.isfinite(verdict["adequacy"]["staleness"])
