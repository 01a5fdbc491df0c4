"""Keys of the study of recorded traffic, `rearl study real`, and its sets of shipped recordings."""

from dataclasses import dataclass
from functools import partial

from rearl_jax.config._key import key
from rearl_jax.config.data import BadRows, DataFormat
from rearl_jax.config.discover import DiscoverConfig
from rearl_jax.problems import InvalidInputError, Problem, out_of_range


@dataclass(frozen=True)
class RealSet:
    """Drivers of shipped recordings for one discovery; ZalaZone is the test track of the OpenACC recordings.

    Attributes:
        title: Name of the set in tables.
        format: Format of the shipped recordings that are read.
        recordings: Shell pattern of the recordings.
        by: Label that divides drivers into groups; None for one group.
        group: Name of the group if there is only one.
        on_bad: Default treatment of bad rows for the format.
    """

    title: str
    format: DataFormat
    recordings: str = "*"
    by: str | None = None
    group: str = "all"
    on_bad: BadRows = BadRows.stop


_zalazone = partial(RealSet, format=DataFormat.openacc, on_bad=BadRows.drop_row)

SETS = {
    "i80": RealSet("I-80", DataFormat.i80),
    "fhwa": RealSet("FHWA, by leader", DataFormat.fhwa, by="leader"),
    "openacc": _zalazone("ZalaZone, by setting", recordings="openacc_*_dynamic_*", by="setting", group=""),
    "openacc_people": _zalazone("ZalaZone, people", recordings="openacc_no_ACC_*", group="people"),
    # One setting only, because two settings of one car differ more than two cars with the same setting. Names of runs
    # with setting S contain short or mixed, others medium.
    "openacc_model": _zalazone(
        "ZalaZone, setting S, by car", recordings="openacc_[sm][hi]*_dynamic_*", by="model", group=""
    ),
}
"""Sets by their name in `real.sets`."""

OWN = "own"
"""Name of the set of recordings in the keys `data`, grouped by `discover.by`."""


@dataclass(unsafe_hash=True)
class RealConfig:
    """Sets of real recordings"""

    sets: tuple[str, ...] = key(
        tuple(SETS),
        f"sets to analyse, one discovery each: some of {', '.join(SETS)}, which are shipped, and {OWN}: the "
        "recordings of data.format and data.root, grouped by discover.by",
    )

    def check(self) -> None:
        """Raise InvalidInputError for an unknown set, or one that is named twice."""
        if not self.sets or len(set(self.sets)) != len(self.sets):
            raise out_of_range("sets", "must name each set once, and at least one", f"[{', '.join(self.sets)}]")
        for name in self.sets:
            if name not in (*SETS, OWN):
                raise out_of_range("sets", f"must be some of {', '.join((*SETS, OWN))}", name)

    def check_discovery(self, options: DiscoverConfig) -> None:
        """Raise InvalidInputError for keys of discovery whose values follow from the chosen sets."""
        if options.oracle is not None:
            raise out_of_range("discover.oracle", "must be null: the missing effects are unknown", options.oracle)
        for name in ("by", "same"):
            value = getattr(options, name)
            if value is not None and OWN not in self.sets:
                message = f"is set by the sets: name it together with real.sets=[{OWN}]"
                raise InvalidInputError(Problem("set-by-task", message, key=f"discover.{name}", value=value))
