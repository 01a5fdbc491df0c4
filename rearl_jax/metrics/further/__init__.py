"""Further metrics, one per file: a module with a `METRIC` and the function `measure` that computes it.

    measure(scene, reference, config) -> Measure

`measure` takes the arrays of a scene and of the real scene that it is compared with, "steps vehicles *scenarios", and
keeps their trailing axes. Every module here is one metric; a new metric needs one new file.
"""

import pkgutil
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, TypeAlias

from rearl_jax.metrics.metric import Metric

if TYPE_CHECKING:
    from rearl_jax.config.metrics import MetricsConfig
    from rearl_jax.metrics.measure import Measure
    from rearl_jax.metrics.trajectories import SceneReference, Trajectories

Kernel: TypeAlias = "Callable[[Trajectories, SceneReference, MetricsConfig], Measure]"

_MODULES = [import_module(f"{__name__}.{info.name}") for info in pkgutil.iter_modules(__path__)]

FURTHER: tuple[Metric, ...] = tuple(module.METRIC for module in _MODULES)
"""Rows of these metrics in the metric table."""

KERNELS: "dict[str, Kernel]" = {module.METRIC.name: module.measure for module in _MODULES}
"""Functions that compute these metrics, by name."""
