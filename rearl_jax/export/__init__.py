"""Drivers for other programs and from them; `to_sumo` and `to_highway_env` write them, `read_types` reads SUMO's."""

from rearl_jax.export.highway_env import to_highway_env
from rearl_jax.export.said import Exported, Said
from rearl_jax.export.sumo import to_sumo

__all__ = ["Exported", "Said", "to_highway_env", "to_sumo"]
