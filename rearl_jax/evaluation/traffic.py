"""The simulated traffic and its road: that of highway-env, of the keys `driver` and `mobil`, or of a repaired model."""

from dataclasses import asdict, fields, replace
from typing import TypeVar

import numpy as np

from rearl_jax.baselines.weights import load_policy
from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import InitialSource
from rearl_jax.config.driver import DriverConfig, record_of
from rearl_jax.config.evaluation import Method, Variant
from rearl_jax.config.mobil import MobilConfig
from rearl_jax.config.scenes import SpeedNorm
from rearl_jax.data.recordings import data_id
from rearl_jax.data.scenes.initial_states import recorded_road
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.models.file import model_id, read_model
from rearl_jax.models.population import Population, lane_changing_of, population_of_keys, population_of_model
from rearl_jax.models.record import EffectValues
from rearl_jax.problems import InvalidInputError, Problem, out_of_range

Task = TypeVar("Task", bound=EvaluateTask)

MODEL_METHODS = (Method.base, Method.rearl)
"""Methods whose vehicles are driven by the traffic model."""


def inputs_id(config: EvaluateTask, scenes: str | None = None) -> str:
    """Identity of all inputs: data, weights of a trained policy, repaired model.

    Args:
        config: The task.
        scenes: Identity of the data of scenes that were cut before; None for the recordings of `config.data`.

    Raises:
        FileNotFoundError, ValueError: There are no such weights, or they do not fit the road; there is no such model.
    """
    identity = data_id(config.data) if scenes is None else scenes
    if config.method is Method.ppo:
        identity += f", weights-{load_policy(config.ppo.weights, config.core).digest}"
    if config.model is not None:
        read_model(config.model)  # a bad file stops here, before hours of work
        identity += f", {model_id(config.model)}"
    return identity


def with_road(config: Task, scenes: SceneSet) -> Task:
    """The configuration with the road of the recordings if scenes start as recorded, else unchanged.

    Raises:
        InvalidInputError: The recordings have more lanes than a simulated road can have.
    """
    if config.init.source is not InitialSource.scene:
        return config
    return replace(config, core=recorded_road(config.core, scenes))


def require_one_variant(config: EvaluateTask) -> None:
    """Raise ValueError for variant=all, which only `rearl evaluate` accepts."""
    if config.model is not None and config.variant is Variant.all:
        raise out_of_range("variant", "must be repaired or calibrated; all is for rearl evaluate", config.variant.name)


def population_of(config: EvaluateTask) -> Population | None:
    """The drivers and effects of the configuration, None for highway-env's.

    Raises:
        FileNotFoundError, ValueError: The model cannot be read, it comes with keys of other drivers, or the method has
            drivers of its own.
    """
    dtype, ticks = np.dtype(config.core.dtype.name), config.core.ticks_per_second
    if config.method not in MODEL_METHODS:
        _refuse_drivers(config)
        return None
    if config.model is None:
        return population_of_keys(config.driver, config.mobil, dtype, ticks)
    if not config.driver.is_default:
        message = "has its own drivers: leave out the keys of driver, or leave out model"
        raise InvalidInputError(Problem("drivers-twice", message, key=f"model={config.model}"))
    require_one_variant(config)
    return population_of_model(
        read_model(config.model),
        dtype,
        with_effects=config.variant is Variant.repaired,
        lane_changing=lane_changing_of(config.mobil, dtype, ticks),
        ticks_per_second=ticks,
    )


def is_cooperative(config: EvaluateTask) -> bool:
    """True if any driver considers what a lane change costs others; keys of `mobil` replace those of a model."""
    if config.model is not None and config.mobil.is_default and config.method in MODEL_METHODS:
        lane_changing = read_model(config.model).lane_changing
        return lane_changing is not None and lane_changing.politeness != 0
    return config.method is Method.critical or config.mobil.politeness != 0


def _refuse_drivers(config: EvaluateTask) -> None:
    is_default = {"model": config.model is None, "driver": config.driver.is_default, "mobil": config.mobil.is_default}
    for key, is_unchanged in is_default.items():
        if not is_unchanged:
            message = (
                f"has no effect on the drivers of method={config.method.name}: set method=base or method=rearl, or "
                f"leave {key} out"
            )
            raise InvalidInputError(Problem("drivers-of-method", message, key=key))


def calibrated(config: EvaluateTask) -> EvaluateTask:
    """The configuration for detection thresholds: for variant=all, the drivers without effects."""
    return replace(config, variant=Variant.calibrated) if config.variant is Variant.all else config


def model_notes(config: EvaluateTask) -> list[str]:
    """Notes on traffic that differs from highway-env's; empty if it does not."""
    driver_notes = [note for note in (_driver_note(config.driver), _mobil_note(config.mobil)) if note]
    if config.model is None:
        return driver_notes
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
    if model.lane_changing is not None and config.mobil.is_default:
        values = ", ".join(f"{name} {value:.3g}" for name, value in asdict(model.lane_changing).items())
        notes.append(f"lane changing of the model: {values}")
    if config.speed.norm is not SpeedNorm.none:
        notes.append(
            f"recorded speeds are rescaled (speed.norm={config.speed.norm.name}), the model's are not: speed.norm=none "
            "compares both without rescaling"
        )
    return [*notes, *driver_notes]


def _driver_note(driver: DriverConfig) -> str:
    """The drivers in a line; empty for highway-env's."""
    if driver.is_default:
        return ""
    default = record_of(driver.model)()
    changed = {name: value for name, value in driver.values().items() if value != default.values()[name]}
    parts = [f"{name} {value:g}" for name, value in changed.items() if value is not None]
    classes = [
        f"{name}: " + ", ".join(f"{k} {v:g}" for k, v in parameters.items())
        for name, parameters in driver.classes.items()
    ]
    values = ", ".join(parts) or "with its usual values"
    return f"drivers: {driver.model} ({values})" + "".join(f"; {part}" for part in classes)


def _mobil_note(mobil: MobilConfig) -> str:
    """Changed parameters of lane changing in a line; empty for highway-env's."""
    default = MobilConfig()
    names = [item.name for item in fields(mobil) if getattr(mobil, item.name) != getattr(default, item.name)]
    return "lane changing: " + ", ".join(f"{name} {getattr(mobil, name):g}" for name in names) if names else ""


def _written(effect: EffectValues) -> str:
    values = (
        f"{name} {value:.3g}" if isinstance(value, (int, float)) else f"{name} of {len(value)} values"
        for name, value in effect.parameters.items()
    )
    of = "" if effect.variable is None else f" on {effect.variable}"
    return f"{effect.name}{of} ({', '.join(values)})"
