"""Car-following models, one per file; every subclass of `CarFollowing` in a module here is registered."""

import pkgutil
from importlib import import_module

from rearl_jax.core.car_following.model import CarFollowing

CAR_FOLLOWING: dict[str, type[CarFollowing]] = {
    model.declaration.name: model
    for module in sorted(info.name for info in pkgutil.iter_modules(__path__))
    for model in vars(import_module(f"{__name__}.{module}")).values()
    if isinstance(model, type) and issubclass(model, CarFollowing) and model is not CarFollowing
}
"""Every car-following model by the name of its declaration."""
