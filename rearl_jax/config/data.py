"""Configuration of the recordings: which ones, where they are, what happens to bad rows."""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key


class DataFormat(Enum):
    """Format of the recordings."""

    us101 = "us101"  # the NGSIM US-101 set shipped with the package
    ngsim = "ngsim"  # NGSIM tables as published, in feet
    i80 = "i80"  # NGSIM I-80 leader-follower pairs, SI
    openacc = "openacc"  # OpenACC ZalaZone platoons
    highd = "highd"  # the highD three-file format
    generated = "generated"  # the same three files, written by `rearl prepare data=generated`
    table = "table"  # Parquet or CSV files in the canonical schema


class OnBad(Enum):
    """What happens to rows that break the schema."""

    stop = "stop"
    drop_track = "drop_track"
    drop_row = "drop_row"


@dataclass(unsafe_hash=True)
class DataConfig:
    """Recordings that are read."""

    format: DataFormat = key(
        DataFormat.us101,
        "format of the recordings: us101 (shipped), ngsim, i80, openacc, highd, generated or table",
    )
    root: str | None = key(None, "folder of the recordings; not needed for us101, which comes with the package")
    recordings: str = key("*", "shell pattern on the recording id, such as highd_0? or us101_0750; * takes all")
    on_bad: OnBad = key(
        OnBad.stop,
        "rows that break the schema: stop with an error, drop_track (the vehicle) or drop_row (the row, and "
        "cut the track there); what is dropped is counted",
    )
    max_jump: float = key(
        2.0,
        "distance beyond speed x time from which a step between frames is a jump [m]; clean recordings stay "
        "below 0.6 m (NGSIM US-101, I-80)",
    )
    default_length: float = key(
        4.5,
        "vehicle length where the source has none [m]; the median leader of the NGSIM I-80 pairs has 4.54 m",
    )

    def check(self) -> None:
        """Raise ValueError for a value out of range."""
        if self.format is not DataFormat.us101 and not self.root:
            name = self.format.name
            raise ValueError(f"root must name the folder of the recordings for data.format={name}, got none")
        if not self.recordings:
            raise ValueError("recordings must be a shell pattern such as *, got an empty text")
        if not self.max_jump > 0.0:
            raise ValueError(f"max_jump must be > 0, got {self.max_jump}")
        if not 1.0 <= self.default_length <= 30.0:
            raise ValueError(f"default_length must be within 1 and 30, got {self.default_length}")
