"""Circumference of a ring road from the positions of an unknown table, which restart in every lap."""

import numpy as np

from rearl_jax.data.survey.clock import Clock
from rearl_jax.data.survey.motion import Motion, Pieces
from rearl_jax.data.units import SI_FACTOR

SHORTEST_LAP = 50.0
"""Shortest lap [m]; smaller jumps are faults of positions."""
LEAST_SEAMS = 3
"""Smallest number of equal jumps that shows that positions are those of a ring."""
TOLERANCE = 0.02
"""Largest relative difference between the jumps of a ring, because of noise and speeds that change in a step."""


def ring_of(motion: Motion, clock: Clock) -> float | None:
    """Length of one lap [m]; None unless all jumps of positions along tracks are jumps back by the same distance."""
    position, speed = motion.position.values, motion.speed.values
    pieces = Pieces(clock, 1, (position, speed))
    forward = (-1.0 if motion.is_reversed else 1.0) * pieces.steps(position)
    driven = np.abs(motion.ratio * pieces.means(speed) * pieces.time)
    missing = (driven - forward) * SI_FACTOR[motion.units[0]]
    jumps = missing[np.abs(missing) > SHORTEST_LAP]
    if jumps.size < LEAST_SEAMS:
        return None
    lap = float(np.median(jumps))
    return round(lap, 2) if lap > 0.0 and (np.abs(jumps - lap) < TOLERANCE * lap).all() else None
