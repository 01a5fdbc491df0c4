"""Discovery on any car-following model: who drives by a model is calibrated by it, written, and simulated again."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.driver import MODELS, record_of
from rearl_jax.core.car_following import CAR_FOLLOWING
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.rollout import rollout
from rearl_jax.core.spawn import spawn
from rearl_jax.discovery.observe.drivers import prior_of
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.observe.fit_state import new_state
from rearl_jax.discovery.observe.kalman import CLOSED_LOOP
from rearl_jax.discovery.observe.noise import USUAL, calibrate
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.report.repaired import repaired_model
from rearl_jax.discovery.report.tables import fit_table
from rearl_jax.models.file import read_model, write_model
from rearl_jax.models.population import population_of_model
from rearl_jax.models.traffic import populate

NOISE = 0.02
"""Of the measured positions [m]."""


@pytest.fixture(
    scope="module",
    params=[
        "constant_time_headway",
        *(pytest.param(name, marks=pytest.mark.thorough) for name in MODELS if name != "constant_time_headway"),
    ],
)
def calibrated_by(request, measured_of):
    """A model, drivers who drive by it behind measured leaders, and what calibration finds."""
    name, data = request.param, measured_of()
    prior = prior_of(record_of(name)())
    solver = solver_of(data, prior)
    state = new_state(data, solver.layout, USUAL)
    rng = np.random.default_rng(5)
    state.z = 0.8 * rng.normal(size=state.z.shape)
    (left,) = solver.innovations([state], CLOSED_LOOP)
    places = data.y - np.asarray(left, float) + NOISE * rng.normal(size=data.y.shape)
    driven = replace(data, y=places, noise=NOISE)
    fit = Fit(None, *calibrate(solver, driven))
    return name, prior, solver, state, driven, fit


def test_parameters_are_those_of_the_model(calibrated_by):
    of_model, prior, solver, _, _, fit = calibrated_by
    assert prior.names == MODELS[of_model].names
    assert fit.state.z.shape[1] == len(MODELS[of_model].parameters)
    columns = fit_table(solver, fit).columns
    assert {*prior.names, *(f"{name}_log_sd" for name in prior.names)} <= set(columns)


def test_time_gaps_are_found_again(calibrated_by):
    _, prior, solver, state, _, fit = calibrated_by
    place = prior.names.index("time_gap")
    truth = np.log(prior.values(state.z, state.truck)[:, place])
    found = np.log(fit_table(solver, fit)["time_gap"].to_numpy())
    assert truth.std() > 0.15  # there is something to be found
    assert np.corrcoef(truth, found)[0, 1] > 0.9
    assert abs((found - truth).mean()) < 0.1
    # What is left is little more than the error of the positions.
    assert np.sqrt(fit.state.variance) < 3 * NOISE


@pytest.fixture(scope="module")
def model(calibrated_by):
    """The model file of what was found."""
    _, _, solver, _, data, fit = calibrated_by
    return repaired_model(
        calibrated=fit,
        repaired=fit,
        data=data,
        layout=solver.layout,
        data_id="generated-0",
        study="here",
    )


def test_what_is_found_is_written(calibrated_by, model, tmp_path):
    assert model.car_following == calibrated_by[0]
    write_model(tmp_path / "model.yaml", model)
    assert read_model(tmp_path / "model.yaml") == model


@pytest.mark.thorough
def test_what_is_found_drives_traffic(model):
    road = TrafficModel(speed_limit=None, lane_changes=False, collisions=False)
    population = population_of_model(model, np.dtype("float64"), with_effects=False)
    keys = jax.vmap(jax.random.key)(jnp.arange(4))

    @jax.jit
    def drive(keys):
        state, drivers = spawn(keys, road, n_vehicles=6, dtype=jnp.dtype("float64"))
        state, drivers = populate(state, drivers, keys, population, road)
        return drivers, rollout(state, drivers, road, n_seconds=5)[1]

    drivers, frames = drive(keys)
    assert isinstance(drivers.car_following, CAR_FOLLOWING[model.car_following])
    usual = np.exp(model.population["car"].log_mean["time_gap"])
    assert np.median(drivers.car_following.time_gap) == pytest.approx(usual, rel=0.3)
    assert np.isfinite(frames.x).all()
    assert (frames.speed >= -1e-9).all()
