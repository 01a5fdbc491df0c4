"""The data of a discovery, in parts that share no driver."""

from dataclasses import dataclass

from rearl_jax.data.records import RecordingInfo
from rearl_jax.discovery.gate import Finding
from rearl_jax.discovery.measured import Measured


@dataclass(frozen=True)
class Parts:
    """The data, and what their columns show.

    Attributes:
        id: Identity of the data.
        generated: Whether any of the data were generated, not measured.
        infos: What is known about the recordings.
        findings: Artefacts that the columns show.
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
