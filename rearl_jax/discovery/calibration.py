"""Calibration of the driver model to measured trajectories, without added effects."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from rearl_jax.config import DiscoverTask
from rearl_jax.data.recordings import data_id
from rearl_jax.data.records import Recording
from rearl_jax.discovery.observe.base import base_of
from rearl_jax.discovery.observe.drivers import prior_of
from rearl_jax.discovery.observe.parts import labelled_recordings, measured_drivers
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.report.repaired import repaired_model
from rearl_jax.discovery.report.tables import fit_table
from rearl_jax.models.file import write_model
from rearl_jax.models.record import RepairedModel


@dataclass(frozen=True)
class Calibration:
    """Calibrated drivers.

    Attributes:
        drivers: One row per driver: parameters, standard deviations of their logarithms, one-step prediction error [m].
        model: Traffic model with the population of these drivers. It has no effects: those of lane changes are fitted
            together with the drivers if `discover.lane_changes` is true, but are not part of this model.
        data_findings: Faults and properties of the measurement that the data check found in the recordings. Faults can
            imitate driver behaviour.
    """

    drivers: pd.DataFrame
    model: RepairedModel
    data_findings: tuple[str, ...]

    def save(self, path: str | Path) -> None:
        """Writes the model to a file that other tasks load with `model=`."""
        write_model(path, self.model)


def calibration(config: DiscoverTask, recordings: Iterable[Recording] | None = None) -> Calibration:
    """Calibration of the drivers who follow a leader long enough, at most `discover.max_drivers` of them.

    Args:
        config: The task.
        recordings: Parts of the recordings of `config.data`; None for all of them.

    Raises:
        FileNotFoundError, ValueError: There are no recordings, a recording is invalid, or no driver follows a leader
            long enough.
    """
    prior = prior_of(config.driver)
    recordings = labelled_recordings(config.data, config.discover) if recordings is None else recordings
    findings, data = measured_drivers(list(recordings), config.discover, prior)
    solver = solver_of(data, prior)
    fit = base_of(solver, data, lane_changes=config.discover.lane_changes).fit
    model = repaired_model(
        calibrated=fit,
        repaired=fit,
        data=data,
        layout=solver.layout,
        data_id=data_id(config.data),
        study=config.study,
    )
    return Calibration(fit_table(solver, fit), model, tuple(finding.words for finding in findings))
