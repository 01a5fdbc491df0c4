"""The data of a discovery: drivers of recordings, in parts that share none."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rearl_jax.config import DiscoverConfig
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.discovery.observe.drivers import IDM_PRIOR, Prior
from rearl_jax.discovery.observe.layout import layout_of
from rearl_jax.discovery.observe.noise import is_exact
from rearl_jax.discovery.observe.normal_equations import Programs
from rearl_jax.discovery.observe.solver import Solver
from rearl_jax.discovery.read.gate import Finding, amount, gate
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.reading import EXACT_NOISE, LEAST_NOISE, measure, one_frame_rate
from rearl_jax.discovery.read.smoothing import Thinned, thinned
from rearl_jax.discovery.read.smoothness import Smoothness, smoothness

ENOUGH = 36
"""Drivers who are asked whether they do anything beside the model."""


@dataclass(frozen=True)
class Parts:
    """The data, and what their columns show.

    Attributes:
        id: Identity of the data.
        generated: Whether any of the data were generated, not measured.
        infos: What is known about the recordings.
        findings: Artefacts and properties of the measurement that the columns show.
        fitted: Drivers that everything is fitted to.
        checked: Others, on whom it is checked.
        reported: Others again, on whom the error is reported, once.
        notes: What a reader must know of the recordings.
    """

    id: str
    generated: bool
    infos: tuple[RecordingInfo, ...]
    findings: list[Finding]
    fitted: Measured
    checked: Measured
    reported: Measured
    notes: tuple[str, ...]


def measured_drivers(
    recordings: Sequence[Recording], options: DiscoverConfig, prior: Prior = IDM_PRIOR
) -> tuple[list[Finding], Measured]:
    """Findings in the columns, and drivers who follow a leader long enough, at most `max_drivers`, at random.

    Raises:
        ValueError: The frame rates differ, or nobody follows a leader long enough.
    """
    one_frame_rate(recordings)
    tables = [thinned(recording) for recording in recordings]
    smooth = smoothness(tables)
    findings, data = _measured(tables, smooth, options)
    if data.noise < EXACT_NOISE and _are_exact(data, prior):
        # A simulation without noise is as smooth by itself as a kernel would have made it.
        findings, data = _measured(tables, Smoothness(), options, EXACT_NOISE)
    return findings, data


def _measured(
    tables: Sequence[Thinned], smooth: Smoothness, options: DiscoverConfig, least_noise: float = LEAST_NOISE
) -> tuple[list[Finding], Measured]:
    """Findings and drivers, taken for smoothed or not."""
    findings = gate(tables, smooth.drives)
    data = measure(tables, amount(findings, "position_lag"), smooth, least_noise)
    if data.n_drivers > options.max_drivers:
        rng = np.random.default_rng(options.seed)
        kept = rng.choice(data.n_drivers, options.max_drivers, replace=False)
        data = data.select(np.flatnonzero(np.isin(data.driver, kept)))
    return findings, data


def _are_exact(data: Measured, prior: Prior) -> bool:
    """True if some of the drivers, which are enough to see it, do nothing beside the model."""
    some = data.select(np.flatnonzero(data.driver < ENOUGH))
    return is_exact(Solver(Programs(layout_of(some, prior), some.dt)), some)
