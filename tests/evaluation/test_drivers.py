"""Drivers of the keys `driver` and `mobil` in rollouts: every model drives, and the default is untouched."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.config import EvaluateTask
from rearl_jax.config.driver import DEFAULT, MODELS, record_of
from rearl_jax.config.evaluation import Method
from rearl_jax.config.mobil import MobilConfig
from rearl_jax.evaluation.traffic import model_notes, population_of
from tests.evaluation.test_rollouts import frames_of
from tests.refusal import refused


def driven(small, scenes, **changes):
    return frames_of(replace(small, **changes), scenes, np.arange(2))[1]


@pytest.fixture
def usual(scenes, small):
    return driven(small, scenes)


def test_one_key_of_highway_envs_drivers_changes_nothing_else(scenes, small, usual):
    longer = driven(small, scenes, driver=record_of(DEFAULT)(time_gap=3.0))
    # One second in, everybody is where they started from; behind a leader they have begun to brake.
    assert np.abs(longer.x[0] - usual.x[0]).max() < 3.0
    assert np.abs(longer.speed[-1] - usual.speed[-1]).max() > 0.5
    again = driven(small, scenes, driver=record_of(DEFAULT)(time_gap=1.5, max_accel=3.0))
    for name in ("x", "speed", "lane"):
        np.testing.assert_array_equal(getattr(again, name), getattr(usual, name))


@pytest.mark.parametrize(
    "name", ["idm", *(pytest.param(n, marks=pytest.mark.thorough) for n in MODELS if n not in (DEFAULT, "idm"))]
)
def test_every_model_drives(scenes, small, usual, name):
    classes = {"truck": {"share": 0.3, "time_gap": 2.0, "length": 12.0}}
    frames = driven(small, scenes, driver=record_of(name)(time_gap_sd=0.2, noise_sd=0.1, classes=classes))
    for value in (frames.x, frames.speed, frames.acceleration):
        assert np.isfinite(value).all()
    assert (np.diff(frames.x, axis=0) >= -0.1).all()
    assert 5.0 < frames.speed[-1].mean() < 40.0
    assert np.abs(frames.speed - usual.speed).max() > 0.5
    assert not frames.crashed.all()


def test_lane_changing_follows_its_keys(scenes, small, usual):
    # A little politeness in all of them: one program.
    eager = driven(small, scenes, mobil=MobilConfig(gain_threshold=0.0, safe_decel=9.0, delay=0.2, politeness=0.01))
    settled = driven(small, scenes, mobil=MobilConfig(gain_threshold=9.0, politeness=0.01))
    polite = driven(small, scenes, mobil=MobilConfig(gain_threshold=0.0, safe_decel=9.0, delay=0.2, politeness=1.0))
    changes = [(np.diff(frames.lane, axis=0) != 0).sum() for frames in (settled, usual, eager)]
    assert changes[0] == 0
    assert changes[0] < changes[2]
    assert changes[1] <= changes[2]
    assert (polite.lane != eager.lane).any()


def test_what_differs_from_highway_env_is_said_beside_the_results():
    assert model_notes(EvaluateTask()) == []
    driver = record_of("idm")(time_gap=1.1, classes={"truck": {"share": 0.1, "time_gap": 1.8}})
    notes = model_notes(EvaluateTask(driver=driver, mobil=MobilConfig(politeness=0.3)))
    assert notes == [
        "drivers: idm (time_gap 1.1); truck: share 0.1, time_gap 1.8",
        "lane changing: politeness 0.3",
    ]


def test_methods_with_drivers_of_their_own_refuse_the_keys():
    with refused("drivers-of-method", key="driver"):
        population_of(EvaluateTask(method=Method.critical, driver=record_of("idm")()))
    with refused("drivers-of-method", key="mobil"):
        population_of(EvaluateTask(method=Method.ppo, mobil=MobilConfig(politeness=0.5)))
    with refused("drivers-twice", key="model=x.yaml"):
        population_of(EvaluateTask(model="x.yaml", driver=record_of("idm")()))
