"""Drivers whose changes are fitted, checked and reported: the same split as that of car following."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int

from rearl_jax.discovery.lane_changes.opportunities import Opportunities

N_PARTS = 3
"""Fitted, checked, reported."""


def part_of_rows(
    table: Opportunities, split: Sequence[Int[np.ndarray, " _"]] | None, seed: int
) -> Int[np.ndarray, " rows"]:
    """Part of each opportunity, 0 to 2; no driver is in two parts.

    Drivers the split does not know (they follow nobody long enough) go with their recording where all of it is in one
    part, else to a part at random.

    Args:
        table: The opportunities.
        split: Numbers of the vehicles of each part, as in `Measured.vehicle`; None where there is no split yet.
        seed: Of what is random.
    """
    recordings = np.unique(table.recording)
    home = {}
    if split is None and len(recordings) >= N_PARTS:
        # Whole recordings, the one with most changes first, to the part that has fewest.
        changes = {int(one): int(table.changes[table.recording == one].sum()) for one in recordings}
        filled = [0] * N_PARTS
        for one in sorted(changes, key=lambda key: (-changes[key], key)):
            home[one] = int(np.argmin(filled))
            filled[home[one]] += changes[one] + 1
    vehicles, first, row = np.unique(table.vehicle, return_index=True, return_inverse=True)
    known = np.full(len(vehicles), -1)
    for number, members in enumerate(split or ()):
        known[np.isin(vehicles, members)] = number
    of_recording = table.recording[first]
    for one in recordings:
        parts = np.unique(known[(of_recording == one) & (known >= 0)])
        if len(parts) == 1:
            home[int(one)] = int(parts[0])
    at_random = np.random.default_rng(seed).integers(0, N_PARTS, len(vehicles))
    stay = np.array([home.get(int(one), -1) for one in of_recording], int)
    return np.where(known >= 0, known, np.where(stay >= 0, stay, at_random))[row]
