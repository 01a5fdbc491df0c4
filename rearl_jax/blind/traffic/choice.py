"""Change of lanes to one side as the drivers weigh it: who would be ahead and behind, what is gained and lost."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Choice:
    """A change to one side as every vehicle sees it.

    Attributes:
        side: -1 to the left, +1 to the right.
        leader, rear: Who would be ahead and behind, n for nobody.
        gap, rear_gap: Bumper to bumper to them [m]; FAR for nobody.
        gain: In own acceleration [m/s^2].
        cost_to_rear: What the one behind there would lose [m/s^2], positive.
        follower_gain: What the present follower would gain [m/s^2].
        is_possible: Whether the lane exists, there is room, and nobody would have to brake too hard.
    """

    side: int
    leader: np.ndarray
    rear: np.ndarray
    gap: np.ndarray
    rear_gap: np.ndarray
    gain: np.ndarray
    cost_to_rear: np.ndarray
    follower_gain: np.ndarray
    is_possible: np.ndarray
