"""Batch highway traffic simulation in JAX, compared with measured trajectories.

Scenes of recordings, the shipped ones by default (`data={"format": "highd", "root": FOLDER}` for others):

    scenes = rearl_jax.cut_scenes()
    print(scenes.speed.shape, scenes.speed.mean())  # scenes, seconds, vehicles; m/s

A rollout of 100 scenarios, the scenario axis last:

    model = rearl_jax.TrafficModel(n_lanes=3)
    state, drivers = rearl_jax.spawn(jax.random.split(jax.random.key(0), 100), model, n_vehicles=10)
    simulate = jax.jit(lambda state, drivers: rearl_jax.rollout(state, drivers, model, n_seconds=60))
    last, frames = simulate(state, drivers)
    print(frames.speed.shape, frames.speed.mean())  # seconds, vehicles, scenarios; m/s

The metric table, simulated against measured scenes; trajectories are a DataFrame, or files that `data` names:

    trajectories = next(rearl_jax.read_recordings()).table  # your own DataFrame, in the same columns
    result = rearl_jax.evaluate(trajectories, method="base", eval={"n_runs": 1})
    print(result)
    print(result.summary.pivot(index="metric", columns="method", values="value"))
    result.save("results/mine")  # tables, figures and page, as `rearl evaluate` writes them

A calibration of drivers, and traffic of the calibrated drivers:

    found = rearl_jax.calibrate(data={"format": "table", "root": folder})
    print(found.drivers[["desired_speed", "time_gap", "jam_gap"]].median())
    found.save("model.yaml")  # rearl_jax.evaluate(model="model.yaml", variant="calibrated")

A discovery of what the driver model is missing:

    trajectories = pandas.read_parquet(folder)  # your own DataFrame
    found = rearl_jax.discover(trajectories)
    print(found)
    print(found.verdict["verdict"], [effect["name"] for effect in found.verdict["effects"]])
    found.save("results/mine")

An environment for reinforcement learning with Gymnasium's interface, or with gymnax's:

    env = rearl_jax.make_env(n_others=20)  # num_envs=64 for 64 scenarios in lockstep
    observation, info = env.reset(seed=0)
    observation, reward, terminated, truncated, info = env.step(rearl_jax.MetaAction.FASTER)
    env = rearl_jax.FunctionalHighway(n_others=20)
    observation, state = jax.vmap(env.reset)(jax.random.split(jax.random.key(0), 64))

Names are imported on first use, so that `import rearl_jax` and `rearl --help` do not wait for JAX.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rearl_jax.code_version import __version__
    from rearl_jax.core.batch import ScenarioMap
    from rearl_jax.core.drivers import highway_env_drivers
    from rearl_jax.core.meta_actions import MetaAction
    from rearl_jax.core.model import TrafficModel
    from rearl_jax.core.rollout import rollout
    from rearl_jax.core.spawn import spawn
    from rearl_jax.core.state import Controller, make_state
    from rearl_jax.core.step import step
    from rearl_jax.data.scenes.scene_files import load_scenes
    from rearl_jax.environments.functional import FunctionalHighway
    from rearl_jax.environments.registration import make_env
    from rearl_jax.metrics import METRICS
    from rearl_jax.results import read_metadata
    from rearl_jax.workflows import calibrate, cut_scenes, discover, evaluate, read_recordings

_HOMES = {
    "Controller": "rearl_jax.core.state",
    "FunctionalHighway": "rearl_jax.environments.functional",
    "METRICS": "rearl_jax.metrics",
    "MetaAction": "rearl_jax.core.meta_actions",
    "ScenarioMap": "rearl_jax.core.batch",
    "TrafficModel": "rearl_jax.core.model",
    "__version__": "rearl_jax.code_version",
    "calibrate": "rearl_jax.workflows",
    "cut_scenes": "rearl_jax.workflows",
    "discover": "rearl_jax.workflows",
    "evaluate": "rearl_jax.workflows",
    "highway_env_drivers": "rearl_jax.core.drivers",
    "load_scenes": "rearl_jax.data.scenes.scene_files",
    "make_env": "rearl_jax.environments.registration",
    "make_state": "rearl_jax.core.state",
    "read_metadata": "rearl_jax.results",
    "read_recordings": "rearl_jax.workflows",
    "rollout": "rearl_jax.core.rollout",
    "spawn": "rearl_jax.core.spawn",
    "step": "rearl_jax.core.step",
}

__all__ = [
    "Controller",
    "FunctionalHighway",
    "METRICS",
    "MetaAction",
    "ScenarioMap",
    "TrafficModel",
    "__version__",
    "calibrate",
    "cut_scenes",
    "discover",
    "evaluate",
    "highway_env_drivers",
    "load_scenes",
    "make_env",
    "make_state",
    "read_metadata",
    "read_recordings",
    "rollout",
    "spawn",
    "step",
]


def __getattr__(name: str) -> Any:
    """The public object `name`, imported from the module that owns it."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name != "__version__":
        import_module("rearl_jax.jax_import").import_jax()
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
