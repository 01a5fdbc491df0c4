"""Known equilibrium time gaps of the cars of ZalaZone, measured without a model.

Source: measured for this project in the ZalaZone recordings of OpenACC (DOI 10.2905/JRC.KMH3D00): median of gap over
speed in intervals near equilibrium, with its standard error between runs.
"""

from dataclasses import dataclass

TOLERANCE = 0.15
"""Difference from a known time gap up to which an estimate agrees with it [s]."""


@dataclass(frozen=True)
class KnownTimeGap:
    """Equilibrium time gap of one car under one setting of its cruise control.

    Attributes:
        value: Gap over speed [s].
        deviation: Standard error [s].
    """

    value: float
    deviation: float


def _short_and_long(short: tuple[float, float], long: tuple[float, float]) -> dict[str, KnownTimeGap]:
    return {"S": KnownTimeGap(*short), "L": KnownTimeGap(*long)}


KNOWN_TIME_GAPS = {
    "AUDI_A4": _short_and_long((2.07, 0.05), (3.51, 0.13)),
    "AUDI_E_TRON": _short_and_long((1.56, 0.04), (3.76, 0.07)),
    "BMW_I3": _short_and_long((1.64, 0.13), (2.28, 0.08)),
    "JAGUAR_I_PACE": _short_and_long((1.52, 0.11), (2.49, 0.06)),
    "MAZDA_3": _short_and_long((2.14, 0.16), (2.62, 0.10)),
    "MERCEDES_GLE450": _short_and_long((1.51, 0.13), (2.43, 0.03)),
    "TESLA_MODEL3": _short_and_long((1.69, 0.08), (2.82, 0.08)),
    "TESLA_MODELS": _short_and_long((1.70, 0.04), (2.93, 0.04)),
    "TESLA_MODELX": _short_and_long((1.33, 0.02), (2.50, 0.05)),
    "TOYOTA_RAV4": _short_and_long((1.83, 0.16), (2.50, 0.01)),
}
"""Known time gaps by car model, as written in OpenACC, and setting (S short, L long)."""
