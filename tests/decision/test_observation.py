"""A driver's observation, against highway-env's own."""

import jax
import numpy as np
import pytest
from highway_env.envs.common.observation import KinematicObservation

from rearl_jax.decision.observation import highway_env_observation, observe_neighbours
from tests.highway_env_twins import put_on_road, road_of_four_lanes


@pytest.mark.parametrize(
    ("n_rows", "see_behind"), [(5, False), (7, True), pytest.param(9, False, marks=pytest.mark.thorough)]
)
def test_as_highway_env_sees(wild, n_rows, see_behind):
    env = road_of_four_lanes()
    spec = highway_env_observation(4, n_rows, see_behind=see_behind)
    observation = np.asarray(jax.jit(lambda state: observe_neighbours(state, spec))(wild))
    assert observation.shape == (spec.n_features, *wild.x.shape)
    n_hidden = 0
    for scenario in range(4):
        for vehicle, twin in put_on_road(env, wild, scenario):
            theirs = KinematicObservation(env, vehicles_count=n_rows, see_behind=see_behind)
            theirs.observer_vehicle = twin
            ours = observation[:, vehicle, scenario].reshape(n_rows, 5)
            np.testing.assert_allclose(ours, theirs.observe(), atol=1e-6)
            n_hidden += (ours[:, 0] == 0).sum()
    assert (n_hidden > 0) == (n_rows > 3)  # some see few: of eight vehicles, two others are always in sight


def test_some_observers_see_what_they_see_among_all(wild):
    spec = highway_env_observation(4)
    observe = jax.jit(lambda state: (observe_neighbours(state, spec), observe_neighbours(state, spec, slice(2, 4))))
    everybody, some = map(np.asarray, observe(wild))
    np.testing.assert_array_equal(some, everybody[:, 2:4])
    assert np.unique(some).size > 50
