"""Roads whose positions count from a place far away, as coordinates of a map do."""

from dataclasses import replace

import numpy as np

from rearl_jax.data.records import Recording

DISTANT_ORIGIN = 1000.0
"""First position [m] above which the origin is outside the road, if this position also exceeds the road length."""


def is_distant(first: float, last: float) -> bool:
    """True if a stretch of road from the first to the last position [m] is far from its origin."""
    return first > DISTANT_ORIGIN and first > last - first


def from_its_beginning(recording: Recording) -> Recording:
    """The recording with positions from the beginning of each carriageway's recorded stretch, and a note, if they count
    from an origin far away.
    """
    info, table = recording.info, recording.table
    position, half = table["position"].to_numpy(), 0.5 * table["length"].to_numpy()
    direction = table["direction"].to_numpy()
    shift, road, notes = np.zeros(len(table)), 0.0, []
    for side in np.unique(direction):
        here = direction == side
        first, last = float((position - half)[here].min()), float((position + half)[here].max())
        if is_distant(first, last):
            shift[here], last = first, last - first
            notes.append(f"direction {side}: {first:.1f} m subtracted from the positions, so that they begin at 0")
        road = max(road, last)
    if not notes:
        return recording
    info = replace(info, road_length=road, notes=(*info.notes, *notes))
    return replace(recording, info=info, table=table.assign(position=position - shift))
