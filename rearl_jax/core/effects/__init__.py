"""The effect library: influences of drivers and road in addition to car following, shared by simulation and discovery.

Every effect with a name in a module here is part of the library.
"""

import pkgutil
from importlib import import_module

from rearl_jax.core.effects.dependence import VARIABLES
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.core.effects.stimulus import Stimulus

__all__ = [
    "EFFECTS",
    "VARIABLES",
    "Effect",
    "Parameter",
    "Stimulus",
]

EFFECTS: dict[str, type[Effect]] = {
    effect.name: effect
    for module in sorted(info.name for info in pkgutil.iter_modules(__path__))
    for effect in vars(import_module(f"{__name__}.{module}")).values()
    if isinstance(effect, type) and issubclass(effect, Effect) and effect is not Effect
}
"""Every effect by its name in model files and verdicts."""
