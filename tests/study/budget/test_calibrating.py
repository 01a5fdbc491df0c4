"""Drivers of a budget are calibrated outside the scored scenes, and on the whole recordings only if nobody is left."""

from dataclasses import replace

import jax
import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.budget import StudyBudgetTask
from rearl_jax.config.discover import DiscoverConfig
from rearl_jax.discovery.calibration import Calibration
from rearl_jax.discovery.observe import parts
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.results import Study
from rearl_jax.study.budget import calibrating
from tests.evaluation.conftest import made_scenes
from tests.models.drivers import model
from tests.refusal import refused


@pytest.fixture
def calibrated(monkeypatch):
    """Function that calibrates, with an error outside the scored scenes or without; returns the labels that were read,
    and where the drivers come from.
    """

    def run(code=None):
        labels = []
        monkeypatch.setattr(parts, "iterate_recordings", lambda data, names: labels.append(names) or iter(()))

        def calibration(task, recordings=None):
            if code is not None and recordings is not None:
                raise InvalidInputError(Problem(code, "is wrong", "mend it"))
            return Calibration(pd.DataFrame(index=range(3)), model(), ())

        monkeypatch.setattr(calibrating, "calibration", calibration)
        task = replace(StudyBudgetTask(), discover=replace(DiscoverConfig(), same="person"))
        _, origin = calibrating._calibrated(task, made_scenes(), np.array([0]))
        return labels, origin

    return run


def test_labels_of_the_keys_are_read(calibrated):
    labels, origin = calibrated()
    assert labels == [["person"]]
    assert "outside the seconds of the scored scenes" in origin


def test_the_scored_scenes_are_used_only_if_nobody_follows_outside_them(calibrated):
    assert "the scored scenes included" in calibrated("nobody-follows")[1]
    with refused("label-unknown"):
        calibrated("label-unknown")


def test_drivers_are_calibrated_in_double_precision(monkeypatch, tmp_path):
    modes = []

    def calibrated(*arguments):
        modes.append(jax.config.read("jax_enable_x64"))
        return Calibration(pd.DataFrame(), model(), ()), "somewhere"

    monkeypatch.setattr(calibrating, "_calibrated", calibrated)
    study = Study(tmp_path, "study_budget", StudyBudgetTask(), "study budget")
    study.write_config()
    jax.config.update("jax_enable_x64", False)
    try:
        drivers = calibrating.calibrated_drivers(StudyBudgetTask(), study, made_scenes(), np.array([0]))
        assert not jax.config.read("jax_enable_x64")
    finally:
        jax.config.update("jax_enable_x64", True)
    assert modes == [True]
    assert drivers.origin == "somewhere"
