"""Measured scenes as initial states of episodes: every vehicle of every scene is the controlled one in one case."""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, TypeAlias

import jax.numpy as jnp
import numpy as np
import pandas as pd

from rearl_jax.config._schema import finished, from_plain, nearest
from rearl_jax.config.core import CoreConfig, Precision
from rearl_jax.config.data import DataConfig
from rearl_jax.config.scenes import BoundarySource
from rearl_jax.core.state import Controller, nearest_level
from rearl_jax.data.scenes.boundary import BoundaryOptions
from rearl_jax.data.scenes.boundary_cache import kept_boundary
from rearl_jax.data.scenes.initial_states import bounded_state, first_lanes, measured_state, recorded_surroundings
from rearl_jax.data.scenes.scene_set import ARRAYS, SceneSet
from rearl_jax.data.tables.in_memory import in_memory
from rearl_jax.environments.highway import EGO, HighwayOptions, Starts
from rearl_jax.environments.surroundings import surroundings_of
from rearl_jax.problems import InvalidInputError, Problem, out_of_range

Recorded: TypeAlias = Mapping[str, Any] | pd.DataFrame | None
"""Recordings: keys of the group `data`, or a table in the canonical columns; None for the shipped ones."""


_MEASURED = ("scenes", "boundary", "data")
"""Options of every environment besides those of `HighwayOptions`."""

OF_GYMNASIUM = ("render_mode", "num_envs", "autoreset_mode")
"""Further options of the Gymnasium environments."""


def options_of(given: Mapping[str, Any], others: tuple[str, ...] = ()) -> HighwayOptions:
    """The options with these values; `others` are further options, for messages.

    Raises:
        InvalidInputError: An option is unknown, or has a value of another type or outside its range.
    """
    known = [item.name for item in fields(HighwayOptions)]
    for name in sorted(given.keys() - set(known)):
        message = f"is not an option; nearest: {nearest(name, [*known, *_MEASURED, *others])}"
        raise InvalidInputError(Problem("key-unknown", message, key=name))
    return from_plain(HighwayOptions, given)


def with_scenes(
    options: HighwayOptions, scenes: SceneSet | None, boundary: str = "free", data: Recorded = None
) -> tuple[HighwayOptions, Starts | None]:
    """The options with as many lanes as the scenes need, and the scenes' beginnings, the last axis over the cases.

    A case is a scene with one of its vehicles as the controlled one. Cases go through the vehicles of the first scene,
    then of the second. The controlled vehicle comes first; the others keep their cyclic order in the list. Speeds are
    the rescaled ones (`SceneSet.scaled_speed`), desired speeds the highest recorded ones.

    With a boundary the controlled vehicle stays to the end of the episode, and the other simulated vehicles leave and
    enter as they were recorded. The recorded traffic around the cases is read once per machine.

    Args:
        options: The environment.
        scenes: Measured scenes; None for none, and nothing changes.
        boundary: Recorded vehicles replayed around the simulated ones: `free` (none), `leaders` (the one ahead of the
            foremost on each lane) or `measured` (all others).
        data: Recordings that the scenes were cut from, as `cut_scenes` was given them; read only with a boundary.

    Raises:
        ValueError: The road has too few lanes for the scenes, or a lane is unknown. With a boundary: there are no
            scenes, their speeds are rescaled, they are shorter than an episode, or cut from other recordings.
    """
    source = _source_of(boundary)
    if scenes is None:
        if source is not BoundarySource.free:
            message, remedy = "needs recorded scenes", "give scenes=rearl_jax.cut_scenes(...), or leave boundary out"
            raise InvalidInputError(Problem("scenes-missing", message, remedy, key="boundary", value=boundary))
        return options, None
    cases = _cases(scenes)
    if source is BoundarySource.free:
        if options.n_lanes is None:
            options = replace(options, n_lanes=int(first_lanes(scenes).max()) + 1)
        state, around = measured_state(cases, _core(options, scenes)), None
    else:
        _require_fitting(options, scenes, source)
        chosen = BoundaryOptions(source, options.ticks_per_second, scenes.is_one_way, keeps_first=True)
        recorded = kept_boundary(_recordings(data), cases, np.arange(len(cases)), chosen)
        if options.n_lanes is None:
            options = replace(options, n_lanes=recorded.n_lanes)
        core = _core(options, scenes)
        state, around = bounded_state(recorded, core), surroundings_of(recorded_surroundings(recorded, core))
    levels = jnp.asarray(options.speed_levels, state.x.dtype)
    target = levels[nearest_level(state.speed[EGO], options.model).astype(jnp.int32)]
    state = replace(
        state,
        desired_speed=state.desired_speed.at[EGO].set(target),
        controller=state.controller.at[EGO].set(int(Controller.META)),
        order=jnp.argsort(state.x, axis=0).astype(jnp.int32),
    )
    return options, Starts(state, around)


def _source_of(boundary: str) -> BoundarySource:
    if boundary not in BoundarySource.__members__:
        message = f"must be one of {', '.join(BoundarySource.__members__)}"
        raise InvalidInputError(Problem("choice-unknown", message, key="boundary", value=boundary))
    return BoundarySource[boundary]


def _require_fitting(options: HighwayOptions, scenes: SceneSet, source: BoundarySource) -> None:
    """Raise InvalidInputError if recorded vehicles cannot be replayed around the scenes."""
    if not np.array_equal(scenes.scaled_speed, scenes.speed):
        message = f"must be none for boundary={source.name}: rescaled speeds do not fit recorded positions"
        remedy = 'cut the scenes with speed={"norm": "none"}'
        problem = Problem("out-of-range", message, remedy, key="speed.norm", value=scenes.speed_norm.name)
        raise InvalidInputError(problem)
    if options.duration > scenes.seconds - 1:
        message = f"must be at most {scenes.seconds - 1} s for boundary={source.name}, as long as the scenes"
        raise out_of_range("duration", message, options.duration)


def _cases(scenes: SceneSet) -> SceneSet:
    """The cases: each scene once per vehicle, with this vehicle in the first slot."""
    cases = scenes.select(np.repeat(np.arange(len(scenes)), scenes.n_slots))
    rotated = (np.arange(scenes.n_slots)[:, None] + np.arange(scenes.n_slots)) % scenes.n_slots
    slot = np.tile(rotated, (len(scenes), 1))[:, None]
    by_slot = {name: values for name in ARRAYS if (values := getattr(cases, name)).ndim == 3}
    return replace(cases, **{name: np.take_along_axis(values, slot, axis=2) for name, values in by_slot.items()})


def _core(options: HighwayOptions, scenes: SceneSet) -> CoreConfig:
    return CoreConfig(
        n_lanes=options.model.n_lanes,
        n_vehicles=scenes.n_slots,
        ticks_per_second=options.ticks_per_second,
        dtype=Precision[options.dtype],
    )


def _recordings(data: Recorded) -> DataConfig:
    """The recordings; raises InvalidInputError for an unknown key."""
    if isinstance(data, pd.DataFrame):
        return in_memory(data, DataConfig())
    return finished(from_plain(DataConfig, {} if data is None else data))
