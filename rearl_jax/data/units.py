"""Conversion to SI, the only place of the package where a unit is converted."""

import numpy as np

# Source: international foot and mile, NIST Special Publication 811 (2008), appendix B.
SI_FACTOR = {
    "km": 1000.0,
    "cm": 0.01,
    "ft": 0.3048,
    "km/h": 1.0 / 3.6,
    "mph": 0.44704,
    "ft/s": 0.3048,
    "ft/s^2": 0.3048,
}


def to_si(values: np.ndarray, unit: str) -> np.ndarray:
    """Values in the SI unit of their kind, float64: values * SI_FACTOR[unit]."""
    return np.asarray(values, dtype=np.float64) * SI_FACTOR[unit]
