"""Response times are those that were planted, none where drivers respond at once, and null where nobody can tell."""

import numpy as np
import pytest

from rearl_jax.discovery.observe.noise import calibrate
from rearl_jax.discovery.observe.response_time import Covariances, Responses, responses
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.read.reading import measure
from rearl_jax.discovery.resampling import Resampling

PLANTED = 0.7
"""Reaction delay of the generator at its usual strength [s]."""


def response_of(tables):
    data = measure(tables)
    solver = solver_of(data)
    return responses(solver, calibrate(solver, data)[0])


@pytest.mark.slow
def test_a_planted_delay_is_read(tables_of):
    found = response_of(tables_of("reaction_delay"))
    figure = found.figure(Resampling(0.9, 200, 0))
    assert abs(figure["value"] - PLANTED) < 0.1
    assert figure["high"] - figure["low"] < 0.3
    assert figure["low"] > 0.5
    # Parameters that were found without a delay imitate a part of it.
    assert found.undelayed.delay(np.arange(len(found.undelayed.measured))) < figure["value"]


def test_drivers_who_respond_at_once_are_not_late(tables_of):
    figure = response_of(tables_of()).figure(Resampling(0.9, 200, 0))
    assert abs(figure["value"]) < 0.15
    assert figure["low"] < 0.1


def covariances(shift, noise, n=40, dt=0.1):
    """Covariances of drivers who do what is asked `shift` steps later, with noise of a size."""
    rng = np.random.default_rng(1)
    lags = np.arange(-30, 71)
    asked = np.exp(-(((lags - 15) / 8) ** 2)) * rng.uniform(0.5, 1.5, (n, 1))
    measured = np.roll(asked, shift, axis=1)[:, 30:91]
    return Covariances(dt, measured + noise * rng.standard_normal(measured.shape), asked)


@pytest.mark.parametrize("shift", [-5, 0, 12])
def test_the_shift_of_covariances_is_the_response_time(shift):
    figure = Responses(covariances(shift, 0.05)).figure(Resampling(0.9, 100, 0))
    assert figure["value"] == pytest.approx(shift * 0.1, abs=0.02)
    assert figure["low"] <= figure["value"] <= figure["high"]


def test_what_resamples_do_not_agree_on_is_not_identified():
    assert Responses(covariances(0, 30.0)).figure(Resampling(0.9, 100, 0)) is None
