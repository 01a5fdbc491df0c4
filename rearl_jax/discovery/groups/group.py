"""Division of measured drivers into groups, by a label of the data or by the kinds that clustering finds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.thresholds import THRESHOLDS

UNKNOWN = "unknown"
"""Name of the group of drivers whose group is unknown."""


@dataclass(frozen=True)
class Group:
    """One group of drivers.

    Attributes:
        name: Value of the label, or name of the cluster.
        data: The drivers.
    """

    name: str
    data: Measured


@dataclass(frozen=True)
class Grouping:
    """Drivers divided into groups.

    Attributes:
        groups: Groups with enough drivers, by name.
        left_out: Number of drivers by label value, for values with too few drivers and for unknown values.
    """

    groups: tuple[Group, ...]
    left_out: dict[str, int]


def grouped(data: Measured, names: Sequence[str | None]) -> Grouping:
    """Groups of drivers; a group needs enough of them to fit, check and report on different drivers.

    Args:
        data: All drivers.
        names: Name of each driver's group, None where it is unknown.
    """
    group_of = np.array([UNKNOWN if name is None else name for name in names], object)
    groups, left_out = [], {}
    for name in sorted(set(group_of.tolist())):
        is_member = group_of == name
        if name == UNKNOWN or is_member.sum() < THRESHOLDS.least_drivers:
            left_out[name] = int(is_member.sum())
        else:
            groups.append(Group(name, data.of_drivers(is_member)))
    return Grouping(tuple(groups), left_out)
