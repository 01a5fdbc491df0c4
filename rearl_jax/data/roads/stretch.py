"""A straight part of a road in a city, named by the geographic coordinates of the ends of its middle line."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rearl_jax.problems import InvalidInputError, Problem

_EQUATOR, _FLATTENING = 6_378_137.0, 1.0 / 298.257223563
"""Radius of the equator [m] and flattening of the Earth; World Geodetic System 1984."""
_LENGTHS, _WIDTHS, _MOST_LANES = (20.0, 5000.0), (2.0, 60.0), 12
_FORM = "must be the latitude and longitude where it begins and ends [deg], its width [m] and its lanes, six numbers"


@dataclass(frozen=True)
class Stretch:
    """A straight carriageway.

    Attributes:
        begin: Latitude and longitude of the middle of its upstream end [deg].
        end: The same of the downstream end.
        width: [m].
        n_lanes: Lanes of equal width.
    """

    begin: tuple[float, float]
    end: tuple[float, float]
    width: float
    n_lanes: int

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(np.hypot(*self._end))

    @property
    def _end(self) -> tuple[float, float]:
        """Metres from the upstream end to the downstream one, to the east and north."""
        east, north = metres(np.array(self.end[:1]), np.array(self.end[1:]), self.begin)
        return float(east[0]), float(north[0])

    def places(self, latitude: np.ndarray, longitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances from the upstream end along the stretch, and from its left edge to the right [m]."""
        ahead = np.array(self._end) / self.length
        east, north = metres(latitude, longitude, self.begin)
        return east * ahead[0] + north * ahead[1], east * ahead[1] - north * ahead[0] + 0.5 * self.width


def stretch_of(numbers: Sequence[float] | None) -> Stretch:
    """The stretch that the key data.stretch names.

    Raises:
        InvalidInputError: It names none.
    """
    if not numbers:
        message = f"{_FORM}: crossings and bends of the city cannot be read"
        raise InvalidInputError(Problem("stretch-missing", message, key="data.stretch"))
    value = list(numbers)
    if len(numbers) != 6 or not np.all(np.isfinite(numbers)) or max(map(abs, numbers[0:3:2])) > 89.0:
        raise InvalidInputError(Problem("stretch-unusable", _FORM, key="data.stretch", value=value))
    stretch = Stretch((numbers[0], numbers[1]), (numbers[2], numbers[3]), numbers[4], int(numbers[5]))
    limits = (
        (_LENGTHS[0] <= stretch.length <= _LENGTHS[1], f"must be {_LENGTHS[0]:g} to {_LENGTHS[1]:g} m long"),
        (_WIDTHS[0] <= stretch.width <= _WIDTHS[1], f"must be {_WIDTHS[0]:g} to {_WIDTHS[1]:g} m wide"),
        (1 <= numbers[5] <= _MOST_LANES and numbers[5] == stretch.n_lanes, f"must have 1 to {_MOST_LANES} lanes"),
    )
    for holds, message in limits:
        if not holds:
            raise InvalidInputError(Problem("stretch-unusable", message, key="data.stretch", value=value))
    return stretch


def metres(latitude: np.ndarray, longitude: np.ndarray, origin: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Distances to the east and north of the origin [m], in the plane that is tangent to the Earth there."""
    phi = np.radians(origin[0])
    e2 = _FLATTENING * (2.0 - _FLATTENING)  # squared eccentricity
    curve = 1.0 - e2 * np.sin(phi) ** 2
    # Radii of curvature [m] to the north and to the east.
    meridian, across = _EQUATOR * (1.0 - e2) / curve**1.5, _EQUATOR / np.sqrt(curve)
    east = np.radians(longitude - origin[1]) * across * np.cos(phi)
    return east, np.radians(latitude - origin[0]) * meridian
