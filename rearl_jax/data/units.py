"""Units and their conversion to SI; no other module of the package converts units."""

import re

import numpy as np

UNITS = {
    "m": {"m": 1.0, "km": 1000.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254, "yd": 0.9144, "mi": 1609.344},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86_400.0},
    "m/s": {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704, "ft/s": 0.3048, "cm/s": 0.01, "kn": 1852.0 / 3600.0},
    "m/s^2": {"m/s^2": 1.0, "ft/s^2": 0.3048, "km/h/s": 1.0 / 3.6, "cm/s^2": 0.01, "g": 9.80665},
    "1/s": {"/s": 1.0, "Hz": 1.0},
}
"""Units by the SI unit of their kind, with their factors to it.

Source: foot, inch, yard, mile, nautical mile and standard gravity, NIST Special Publication 811 (2008), appendix B.
"""

SI_FACTOR = {unit: factor for kind in UNITS.values() for unit, factor in kind.items()}
"""Factor to SI of every unit."""

SPELLINGS = {
    "kmh": "km/h", "kmph": "km/h", "kph": "km/h", "mps": "m/s", "ms-1": "m/s", "m/sec": "m/s", "fps": "ft/s",
    "ftps": "ft/s", "ft/sec": "ft/s", "mi/h": "mph", "feet": "ft", "foot": "ft", "meter": "m", "meters": "m",
    "metre": "m", "metres": "m", "miles": "mi", "inch": "in", "sec": "s", "seconds": "s", "second": "s", "msec": "ms",
    "millis": "ms", "milliseconds": "ms", "usec": "us", "micros": "us", "\u00b5s": "us", "\u03bcs": "us",
    "nsec": "ns", "nanos": "ns", "m/s2": "m/s^2", "m/s\u00b2": "m/s^2", "mps2": "m/s^2", "mpss": "m/s^2",
    "m/s/s": "m/s^2", "ft/s2": "ft/s^2", "ft/s\u00b2": "ft/s^2", "fps2": "ft/s^2", "hz": "Hz",
}  # fmt: skip
"""Other spellings of units, in lower case."""

_NUMBER_AND_UNIT = re.compile(r"([+-]?)(\d+(?:\.\d+)?|)\s*(\D.*)")


def to_si(values: np.ndarray, unit: str) -> np.ndarray:
    """Values in the SI unit of their kind, float64: values * SI_FACTOR[unit]."""
    return np.asarray(values, dtype=np.float64) * SI_FACTOR[unit]


def unit_named(text: str, kind: str) -> str | None:
    """The unit of a kind, a key of UNITS, that a text such as kmh names, in any case of letters; else None."""
    known = UNITS[kind]
    plain = SPELLINGS.get(text.lower(), text)
    if plain in known:
        return plain
    return next((unit for unit in known if unit.lower() == plain.lower()), None)


def factor_of(text: str, kind: str) -> float | None:
    """Factor to SI of a unit of a kind, a key of UNITS, which may be a multiple or reversed: `ft`, `0.1 s`, `-m`.

    None if it is not of the kind. A unit of time may be given by its rate: `25/s` is 0.04 s.
    """
    found = _NUMBER_AND_UNIT.fullmatch(text.strip())
    if found is None:
        return None
    number = float(found[2] or 1.0)
    unit = unit_named(found[3].strip(), kind)
    rate = unit_named(found[3].strip(), "1/s") if kind == "s" and found[2] else None
    if number == 0.0 or (unit is None and rate is None) or (kind in ("s", "1/s") and found[1] == "-"):
        return None
    if unit is None:
        return 1.0 / number
    return (-1.0 if found[1] == "-" else 1.0) * number * UNITS[kind][unit]
