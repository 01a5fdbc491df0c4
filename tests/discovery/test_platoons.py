"""Discovery on data of a generator that is none of its own."""

import numpy as np
import pytest

from rearl_jax.config import DataConfig, DiscoverConfig, DiscoverTask, ResultsConfig
from rearl_jax.config.data import DataFormat
from tests.discovery.platoons import write_platoons

pytestmark = pytest.mark.slow  # a minute of compiling


@pytest.mark.filterwarnings("default")
def test_nothing_is_named_in_platoons_of_highway_env_without_noise(tmp_path):
    from rearl_jax.discovery.task import run

    write_platoons(tmp_path / "data", "nothing", 21, driver_noise=0.0, position_noise=0.0)
    config = DiscoverTask(
        study="platoons",
        results=ResultsConfig(str(tmp_path / "results")),
        data=DataConfig(format=DataFormat.table, root=str(tmp_path / "data")),
        discover=DiscoverConfig(page=False, base=()),
    )
    verdict = run(config)
    assert (verdict["verdict"], verdict["effects"]) == ("nothing", [])
    assert 0.0 < verdict["error"]["after"]["value"] < 2.0
    assert np.isfinite(verdict["adequacy"]["staleness"])
