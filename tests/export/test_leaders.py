"""First vehicles of recordings, whose speeds lead platoons."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import DataConfig
from rearl_jax.data.tables.in_memory import in_memory
from rearl_jax.export.leaders import leader_speeds
from tests.data.made_rows import car_rows
from tests.refusal import refused


@pytest.mark.parametrize("states_leaders", [True, False])
def test_a_follower_in_the_lane_is_no_first_vehicle(states_leaders):
    time = np.arange(200) / 10.0
    cars = ((1, 80.0, 20.0, 0), (2, 40.0, 19.0, 0), (3, 40.0, 22.0, 1))
    parts = [car_rows(track, start + speed * time, speed, 0.0, lane=lane) for track, start, speed, lane in cars]
    rows = pd.concat(parts, ignore_index=True)
    rows = rows.assign(
        time=rows["frame"] / 10.0, leader_id=np.where((rows["track_id"] == 2) & states_leaders, 1, np.nan)
    )
    speeds = leader_speeds(in_memory(rows, DataConfig()), 2, 15)
    np.testing.assert_allclose(speeds.mean(axis=0), [20.0, 22.0])
    with refused("leaders-too-few"):
        leader_speeds(in_memory(rows, DataConfig()), 3, 15)
