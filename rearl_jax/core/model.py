"""Road, clock and stages of the traffic model, which are fixed while a program runs.

A `TrafficModel` is hashable and constant within a program: for each value a program is compiled. Numbers that vary
between vehicles or scenarios are arrays, see `rearl_jax.core.drivers` and `rearl_jax.core.state`.
"""

import dataclasses
import itertools
import math

from rearl_jax.config.core import CoreConfig
from rearl_jax.problems import out_of_range

ROAD_END_MARGIN = 5.0
"""Distance beyond the ends of the road [m] up to which a vehicle still counts as on a lane. Source: highway-env 1.12.1,
`AbstractLane.VEHICLE_LENGTH`.
"""


@dataclasses.dataclass(frozen=True)
class TrafficModel:
    """A straight one-way road, its clock, and the stages of the traffic model.

    Lane k is centred on y = k * lane_width; lane 0 is the leftmost, y grows to the right, x along the road.

    Attributes:
        n_lanes: Number of lanes, 1 to 8.
        lane_width: Width of every lane [m].
        road_length: Length of the road [m]. Vehicles beyond it are not seen by others and do not change lanes.
        speed_limit: Limit [m/s] that caps the desired speed of the car-following model; None for no cap.
        ticks_per_second: Simulation ticks per second [1/s].
        lane_changes: Whether the lane-change stages (MOBIL, aborts) are part of the program.
        collisions: Whether the collision stage is part of the program.
        cooperative: Whether MOBIL evaluates the gains of the followers. It must if any vehicle's politeness is not
            zero. If all are zero, the result is the same without this evaluation and the program is shorter.
        meta_follows: Whether vehicles that carry out meta-actions (FASTER, SLOWER, ...) accelerate at most as IDM does
            behind their leader, with the target speed as desired speed. In highway-env there is no such limit.
        speed_levels: Target speeds [m/s] that a meta-action can choose, in ascending order; see `state.nearest_level`.

    Source: highway-env 1.12.1 (`highway-v0`); speed levels: nine levels from 5 to 32 m/s as in REARL (Bi et al.).
    """

    n_lanes: int = 4
    lane_width: float = 4.0
    road_length: float = 10_000.0
    speed_limit: float | None = 30.0
    ticks_per_second: int = 15
    lane_changes: bool = True
    collisions: bool = True
    cooperative: bool = False
    meta_follows: bool = False
    speed_levels: tuple[float, ...] = tuple(5.0 + 3.375 * level for level in range(9))

    def __post_init__(self) -> None:
        if not 1 <= self.n_lanes <= 8:
            raise out_of_range("n_lanes", "must be within 1 and 8: the lanes of one carriageway", self.n_lanes)
        if self.ticks_per_second < 1:
            raise out_of_range("ticks_per_second", "must be at least 1 (highway-env: 15)", self.ticks_per_second)
        if not (self.speed_limit is None or self.speed_limit > 0):
            raise out_of_range("speed_limit", "must be > 0 m/s or None", self.speed_limit)
        for name in ("lane_width", "road_length"):
            if not getattr(self, name) > 0:
                raise out_of_range(name, "must be > 0 m", getattr(self, name))
        levels = self.speed_levels
        if len(levels) < 2:
            raise out_of_range("speed_levels", "must have at least two speeds, for FASTER and SLOWER", levels)
        # Written with `not all`, so that NaN is refused, too.
        if not all(low < high < math.inf for low, high in itertools.pairwise(levels)):
            raise out_of_range("speed_levels", "must rise, so that FASTER is faster", levels)

    @property
    def dt(self) -> float:
        """Duration of one time step, one tick [s]."""
        return 1.0 / self.ticks_per_second


def traffic_model(core: CoreConfig, *, cooperative: bool = False) -> TrafficModel:
    """Traffic model of a configuration; `cooperative` must be true if any driver's politeness is not zero."""
    return TrafficModel(
        n_lanes=core.lanes,
        speed_limit=core.speed_limit,
        ticks_per_second=core.ticks_per_second,
        lane_changes=core.lane_changes,
        collisions=core.collisions,
        cooperative=cooperative,
    )
