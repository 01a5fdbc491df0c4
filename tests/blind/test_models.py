"""The generator's own car-following models, compared with those of the library, with which they share no code."""

import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.blind.traffic import Scenario
from rearl_jax.blind.traffic.drawing import draw_scenario
from rearl_jax.blind.traffic.fleet import draw_fleet
from rearl_jax.blind.traffic.models import BASES, Drivers
from rearl_jax.blind.traffic.priors import PRIORS
from rearl_jax.config.driver import MODELS
from rearl_jax.core.car_following import CAR_FOLLOWING

RNG = np.random.default_rng(3)
SHARE, DV, GAP = RNG.uniform(0.0, 0.85, 400), RNG.uniform(-6.0, 6.0, 400), RNG.uniform(0.5, 120.0, 400)


def drivers(base):
    """400 drivers with parameters of a drawn population."""
    drawn = draw_scenario(PRIORS, (), base, 5, 0)
    scenario = Scenario(2, base=base, population=drawn.population, n_recordings=1, n_vehicles=400, n_lanes=2)
    fleet = draw_fleet(scenario, np.random.default_rng(1))
    return Drivers(SHARE * fleet.desired_speed, fleet.desired_speed, fleet.time_gap, fleet)


@pytest.mark.parametrize("base", BASES)
def test_a_model_is_that_of_the_library(base):
    own, model = drivers(base), BASES[base]
    parameters = {name: jnp.asarray(own.fleet.parameter(name)) for name in MODELS[base].names}
    theirs = CAR_FOLLOWING[base](**parameters)
    ours = model.acceleration(own, model.interaction(own, GAP, DV))
    np.testing.assert_allclose(ours, theirs.acceleration(*map(jnp.asarray, (GAP, own.speed, DV))), rtol=1e-9, atol=1e-9)
    assert set(model.parameters) <= set(MODELS[base].names)
    np.testing.assert_allclose(model.equilibrium_gap(own), theirs.equilibrium_gap(jnp.asarray(own.speed)), rtol=1e-9)


@pytest.mark.parametrize("base", BASES)
def test_nobody_ahead_is_a_free_road(base):
    own, model = drivers(base), BASES[base]
    at_infinity = model.acceleration(own, model.interaction(own, np.full(400, 1e7), own.speed - 30.0))
    near_infinity = model.acceleration(own, model.interaction(own, np.full(400, 1.1e6), np.zeros(400)))
    np.testing.assert_allclose(at_infinity, near_infinity, atol=1e-3)


def test_models_differ():
    """No model is another one under a second name."""
    gap, dv = np.full(400, 25.0), np.full(400, 1.0)
    seen = {base: BASES[base].interaction(drivers(base), gap, dv) for base in BASES}
    assert len({values.tobytes() for values in seen.values()}) == len(BASES)
