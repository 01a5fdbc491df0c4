"""Geometry of the recorded motorway sections: carriageways, lane markings, lane numbers as in highD.

Driver frame: `position` along the driving direction [m], `lateral` from the left edge of the carriageway,
positive to the right [m], lanes counted from the left starting at 0. Image frame: x to the right, y down; the
upper carriageway (direction 1) drives to the left, the lower one (direction 2) to the right.
"""

from dataclasses import dataclass

import numpy as np

UPPER, LOWER = 1, 2


@dataclass(frozen=True)
class Section:
    """One recorded place with two carriageways of equal width.

    Attributes:
        location: Number of the place (`locationId`).
        n_lanes: Lanes per carriageway.
        lane_width: Width of a lane [m].
        top: y of the uppermost lane marking in the image [m].
        median: Distance between the carriageways' inner markings [m].
        speed_limit: Legal limit for cars [m/s]; None = none.
    """

    location: int
    n_lanes: int
    lane_width: float
    top: float
    median: float
    speed_limit: float | None

    def markings(self, direction: int) -> np.ndarray:
        """y of the lane markings of one carriageway [m], in ascending order."""
        width = self.n_lanes * self.lane_width
        first = self.top if direction == UPPER else self.top + width + self.median
        return np.round(first + self.lane_width * np.arange(self.n_lanes + 1), 2)

    def image_y(self, direction: np.ndarray, lateral: np.ndarray) -> np.ndarray:
        """y in the image [m] of a lateral offset from the left edge of its carriageway."""
        upper_left_edge = self.markings(UPPER)[-1]
        lower_left_edge = self.markings(LOWER)[0]
        return np.where(direction == UPPER, upper_left_edge - lateral, lower_left_edge + lateral)

    def lane_id(self, y: np.ndarray) -> np.ndarray:
        """highD lane number at y: the stripes between markings from the top, above all markings is 1.

        Source: highD, where a road with 2 + 2 lanes has the numbers 2, 3 (upper) and 5, 6 (lower).
        """
        every_marking = np.concatenate([self.markings(UPPER), self.markings(LOWER)])
        return np.searchsorted(every_marking, y, side="right") + 1


# Like highD: six places, two or three lanes per direction, with and without a speed limit (Krajewski et al.
# 2018). Lane widths of German motorways (RAA 2008: 3.50 to 3.75 m); the offsets in the image are arbitrary.
SECTIONS = (
    Section(1, 3, 3.75, 8.50, 4.00, None),
    Section(2, 2, 3.75, 8.20, 4.50, None),
    Section(3, 3, 3.75, 7.90, 3.80, 36.11),
    Section(4, 2, 3.75, 4.10, 4.20, None),
    Section(5, 3, 3.60, 3.80, 3.50, 33.33),
    Section(6, 3, 3.75, 6.00, 4.00, None),
)
