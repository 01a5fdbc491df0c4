"""The data of a discovery: fitted drivers, check drivers and report drivers, three parts without common drivers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from rearl_jax.config import DataConfig, DiscoverConfig
from rearl_jax.data.checks.labels import track_labels
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.discovery.observe.drivers import IDM_PRIOR, Prior
from rearl_jax.discovery.observe.noise import NOISELESS, calibrate
from rearl_jax.discovery.observe.solver import solver_of
from rearl_jax.discovery.read.gate import Finding, gate, smoothed_release
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.read.reading import EXACT_NOISE, measure, nobody_follows, one_frame_rate
from rearl_jax.discovery.read.smoothing import thinned
from rearl_jax.discovery.read.smoothness import smoothing_kernel
from rearl_jax.discovery.read.speed_sensor import SPEED_SENSOR, errors_of_positions, has_speed_sensor, with_fast_speeds

AUTO = "auto"
"""Value of `discover.by` for kinds of drivers that are found without labels."""

ENOUGH = 36
"""Number of drivers used to test whether the drives contain noise."""


@dataclass(frozen=True)
class Parts:
    """The data and the findings of the data check.

    Attributes:
        id: Identity of the data.
        generated: Whether any of the data were generated, not measured.
        infos: Descriptions of the recordings.
        findings: Artefacts and properties of the measurement that the columns show.
        fitted: The fitted drivers, whom all models are fitted to.
        checked: The check drivers, on whom candidates are checked.
        reported: The report drivers, who are used once, to report errors.
        notes: Notes on the recordings for the reader.
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
    recordings: Sequence[Recording], options: DiscoverConfig, prior: Prior = IDM_PRIOR, same: str | None = None
) -> tuple[list[Finding], Measured]:
    """Findings in the columns, and drivers who follow a leader long enough: a random sample of at most `max_drivers`
    per group. `same` is the label by which the data format identifies the same driver or car, used if `options.same`
    names no label.

    Raises:
        ValueError: The frame rates differ, a label is unknown, or no driver follows a leader long enough.
    """
    if not recordings:
        raise nobody_follows()
    rate = one_frame_rate(recordings)
    tables = [thinned(recording, rate) for recording in recordings]
    findings, fused_errors = gate(tables), None
    is_of_speeds = not any(finding.is_artefact for finding in findings) and has_speed_sensor(tables)
    kernel = smoothing_kernel(tables, rate, is_of_speeds=is_of_speeds)  # as recorded, because fusion smooths too
    if is_of_speeds:
        findings.append(SPEED_SENSOR)
        fused_errors = errors_of_positions(tables)
        tables = [with_fast_speeds(table) for table in tables]
    labels = labels_of(recordings, options)
    same = options.same or (same if same in labels else None)
    measured_from = partial(
        measure,
        position_lag=next((finding.value for finding in findings if finding.name == "position_lag"), 0.0),
        labels=labels,
        identity_label=same,
        fused_errors=fused_errors,
    )
    data = _chosen(measured_from(tables, kernel=kernel), options)
    if data.noise < EXACT_NOISE and _are_exact(data, prior):
        # A simulation without noise is as smooth as a smoothed recording, so smoothness proves nothing here.
        return findings, _chosen(measured_from(tables, least_noise=EXACT_NOISE), options)
    return [*findings, *([smoothed_release(kernel, is_of_speeds=is_of_speeds)] if kernel.deviation else [])], data


def labels_of(recordings: Sequence[Recording], options: DiscoverConfig) -> dict[str, list[pd.Series]]:
    """Labels of the tracks of each recording: those in the recordings, and those named by configuration keys.

    Raises:
        InvalidInputError: A configuration key names a label that no recording has.
    """
    wanted = {name: "data.format" for recording in recordings for name in recording.info.labels}
    wanted |= {name: f"discover.{key}" for key, name in named_labels(options).items()}
    return {name: track_labels(recordings, name, key) for name, key in wanted.items()}


def labelled_recordings(data: DataConfig, options: DiscoverConfig) -> Iterator[Recording]:
    """The recordings, one at a time, with the labels that keys of discovery name.

    Raises:
        FileNotFoundError, ValueError: There are no recordings, or one is invalid.
    """
    return iterate_recordings(data, list(named_labels(options).values()))


def named_labels(options: DiscoverConfig) -> dict[str, str]:
    """Labels named by configuration keys, by key."""
    named = {"by": options.by, "same": options.same}
    return {key: name for key, name in named.items() if name is not None and (key, name) != ("by", AUTO)}


def _chosen(data: Measured, options: DiscoverConfig) -> Measured:
    """A random sample of at most `max_drivers` drivers of each group."""
    by = named_labels(options).get("by")
    return data.sample(options.max_drivers, options.seed, None if by is None else pd.factorize(data.label(by))[0])


def _are_exact(data: Measured, prior: Prior) -> bool:
    """True if a sample of the drivers follows the model without noise, as only simulated drives do."""
    sample = data.select(np.flatnonzero(data.driver < ENOUGH))
    _, noise = calibrate(solver_of(sample, prior), sample)
    return noise.acceleration <= NOISELESS
