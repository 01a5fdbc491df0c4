"""The paper's start, drawn initial states and rescaled speeds; also for tasks that need many different starts."""

from dataclasses import dataclass, replace

from rearl_jax.config._key import group_key
from rearl_jax.config.core import CoreConfig, InitConfig, InitialSource
from rearl_jax.config.scenes import SpeedConfig, SpeedNorm


def rescaled() -> SpeedConfig:
    """Speeds as the paper compares them."""
    return SpeedConfig(SpeedNorm.minmax)


def paper_road() -> CoreConfig:
    """The road of the paper."""
    core = CoreConfig()
    return replace(core, n_lanes=core.lanes)


def drawn_start() -> InitConfig:
    """The initial states of the paper."""
    return InitConfig(InitialSource.seed)


@dataclass(unsafe_hash=True)
class PaperStart:
    """Keys of tasks that start as the paper does, not as recorded."""

    init: InitConfig = group_key(InitConfig, drawn_start)
    speed: SpeedConfig = group_key(SpeedConfig, rescaled)
