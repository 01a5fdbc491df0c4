"""Whose traffic is simulated: highway-env's, or that of a repaired model."""

from dataclasses import replace

import numpy as np

from rearl_jax.baselines.weights import load_policy
from rearl_jax.config import EvaluateTask
from rearl_jax.config.evaluation import Method, Variant
from rearl_jax.config.scenes import SpeedNorm
from rearl_jax.data.recordings import data_id
from rearl_jax.models.file import model_id, read_model
from rearl_jax.models.record import EffectValues
from rearl_jax.models.traffic import TrafficNumbers, traffic_numbers

WITH_MODEL = (Method.base, Method.rearl)
"""Methods whose vehicles follow each other by the traffic model."""


def inputs_id(config: EvaluateTask) -> str:
    """Identity of all that is read: the data, weights where a trained policy drives, and a repaired model.

    Raises:
        FileNotFoundError, ValueError: There are no such weights, or they do not fit the road; there is no such model.
    """
    identity = data_id(config.data)
    if config.method is Method.ppo:
        identity += f", weights-{load_policy(config.ppo.weights, config.core).digest}"
    if config.model is not None:
        read_model(config.model)  # a bad file stops here, before hours of work
        identity += f", {model_id(config.model)}"
    return identity


def require_one_variant(config: EvaluateTask) -> None:
    """Raise ValueError for variant=all, which only `rearl evaluate` knows."""
    if config.model is not None and config.variant is Variant.all:
        raise ValueError("variant=all is for rearl evaluate: set variant=repaired or variant=calibrated")


def numbers_of(config: EvaluateTask) -> TrafficNumbers | None:
    """The repaired model's drivers and effects, None for highway-env's traffic.

    Raises:
        FileNotFoundError, ValueError: The model cannot be read, or the method has drivers of its own.
    """
    if config.model is None:
        return None
    if config.method not in WITH_MODEL:
        raise ValueError(
            f"method={config.method.name} has drivers of its own, to whom model={config.model} means nothing: set "
            f"method=base or method=rearl, or leave model out"
        )
    require_one_variant(config)
    dtype = np.dtype(config.core.dtype.name)
    return traffic_numbers(read_model(config.model), dtype, with_effects=config.variant is Variant.repaired)


def calibrated(config: EvaluateTask) -> EvaluateTask:
    """The configuration of what thresholds are taken from: with all variants, the drivers without effects."""
    return replace(config, variant=Variant.calibrated) if config.variant is Variant.all else config


def model_notes(config: EvaluateTask) -> list[str]:
    """What must be read with results on the traffic of a repaired model; nothing without one."""
    if config.model is None:
        return []
    model = read_model(config.model)
    effects = ", ".join(_written(effect) for effect in model.effects) or "none"
    traffic = {
        Variant.all: "effect = drivers calibrated with the effects; without, the same drivers calibrated without them",
        Variant.calibrated: "drivers calibrated without effects",
        Variant.repaired: "drivers calibrated with the effects",
    }[config.variant]
    notes = [
        f"traffic of {model.source.study} ({model_id(config.model)}), calibrated on {model.source.data_id}: {traffic}; "
        f"effects: {effects}; initial states and quantiles of drivers are the same in all rows"
    ]
    if config.speed.norm is not SpeedNorm.none:
        notes.append(
            f"recorded speeds are rescaled (speed.norm={config.speed.norm.name}), the model's are not: speed.norm=none "
            "compares like with like"
        )
    return notes


def _written(effect: EffectValues) -> str:
    values = (
        f"{name} {value:.3g}" if isinstance(value, (int, float)) else f"{name} of {len(value)} values"
        for name, value in effect.parameters.items()
    )
    of = "" if effect.variable is None else f" on {effect.variable}"
    return f"{effect.name}{of} ({', '.join(values)})"
