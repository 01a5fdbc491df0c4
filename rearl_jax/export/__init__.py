"""Exchange of drivers with other programs.

`to_sumo`, `to_highway_env` and `to_openscenario` write them, `read_types` reads vehicle types of SUMO.
"""

from rearl_jax.export.highway_env import to_highway_env
from rearl_jax.export.openscenario import to_openscenario
from rearl_jax.export.sumo import to_sumo
from rearl_jax.export.translations import Exported, Translation
from rearl_jax.export.vehicle_types import read_types

__all__ = ["Exported", "Translation", "read_types", "to_highway_env", "to_openscenario", "to_sumo"]
