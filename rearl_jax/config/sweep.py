"""Configuration of the sweep over detection thresholds."""

from dataclasses import dataclass

from rearl_jax.config._key import key
from rearl_jax.problems import out_of_range


@dataclass(unsafe_hash=True)
class SweepConfig:
    """Threshold pairs to try on the tuning scenes"""

    h_pct: tuple[float, ...] = key(
        (5.0, 10.0, 20.0, 30.0), "percentiles of base's Hellinger distances to use as thresholds [%]; REARL"
    )
    m_pct: tuple[float, ...] = key(
        (5.0, 10.0, 20.0, 30.0), "percentiles of base's spacing errors to use as thresholds [%]; REARL"
    )

    def check(self) -> None:
        """Raise InvalidInputError for values that are not percentiles, or given twice."""
        for name in ("h_pct", "m_pct"):
            values = getattr(self, name)
            if not values or len(set(values)) != len(values) or not all(0 <= value <= 100 for value in values):
                raise out_of_range(name, "must hold percentiles within 0 and 100 %, each once", values)
