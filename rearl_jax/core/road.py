"""Conversion of a configuration to a traffic model."""

from rearl_jax.config.core import CoreConfig
from rearl_jax.core.model import TrafficModel


def traffic_model(core: CoreConfig, *, cooperative: bool = False) -> TrafficModel:
    """The traffic model of a configuration; `cooperative` must be true if any driver's politeness is not zero."""
    return TrafficModel(
        n_lanes=core.lanes,
        speed_limit=core.speed_limit,
        ticks_per_second=core.ticks_per_second,
        lane_changes=core.lane_changes,
        collisions=core.collisions,
        cooperative=cooperative,
    )
