"""Car-following models, one per file; every module here with a `CarFollowing` of its own is one."""

import pkgutil
from importlib import import_module

from rearl_jax.core.car_following.model import CarFollowing

CAR_FOLLOWING: dict[str, type[CarFollowing]] = {
    found.declaration.name: found
    for module in sorted(info.name for info in pkgutil.iter_modules(__path__))
    for found in vars(import_module(f"{__name__}.{module}")).values()
    if isinstance(found, type) and issubclass(found, CarFollowing) and found is not CarFollowing
}
"""Every car-following model by the name of its declaration."""
