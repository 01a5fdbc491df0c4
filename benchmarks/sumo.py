"""SUMO as the subject of a measurement: IDM and LC2013 through libsumo, in this process."""

import tempfile
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

import numpy as np

from rearl_jax.export.sumo_road import draw_network
from rearl_jax.timing.measurement import TICKS_PER_SECOND, Measurement, Stopwatch

N_LANES = 4
LIMIT = 30.0
"""Speed limit [m/s]."""

FASTEST = 40.0
"""Speed that no vehicle exceeds [m/s]; it determines the length of the road, at whose end vehicles would disappear."""

# Desired speed and exponent vary as in highway-env; its spacing of 10 m between centres is a gap of 5 m.
_VEHICLE = (
    '<vType id="type{0}" carFollowModel="IDM" laneChangeModel="LC2013" length="5" width="2" minGap="5"'
    ' tau="1.5" accel="3" decel="5" delta="{delta:.4f}" maxSpeed="{speed:.4f}" speedFactor="1"/>'
    '<vehicle id="{0}" type="type{0}" depart="0" departLane="{lane}" departPos="{position:.4f}"'
    ' departSpeed="{speed:.4f}" insertionChecks="none"><route edges="road"/></vehicle>'
)
# SUMO rounds the step length to whole milliseconds: 67 ms.
_OPTIONS = (
    f"--step-length {1 / TICKS_PER_SECOND} --threads 1 --no-step-log true --no-warnings true"
    " --xml-validation never --collision.action warn --collision.mingap-factor 0 --time-to-teleport -1"
)


class SumoRoads:
    """Scenes drawn as for highway-env on a straight road of four lanes; `simulationStep` is measured."""

    facts: Mapping[str, float | int] = {"unit": 1}

    def __init__(self, n_vehicles: int, seconds: int, density: float) -> None:
        """Loads the library; arguments as in `HighJaxRoads`."""
        self._n_vehicles, self._seconds, self._density = n_vehicles, seconds, density
        self._sumo = import_module("libsumo")

    def measure(self, n_scenarios: int, seed: int) -> Measurement:
        """The cost of `n_scenarios` scenes, one after the other."""
        watch = Stopwatch()
        with tempfile.TemporaryDirectory(prefix="rearl_sumo_") as name:
            network, routes = Path(name) / "road.net.xml", Path(name) / "traffic.rou.xml"
            results = []
            for number in range(n_scenarios):
                traffic, first = self._draw_traffic(np.random.default_rng([seed, number]))
                routes.write_text(traffic, encoding="utf-8")
                network.write_text(
                    draw_network(N_LANES, first + FASTEST * (self._seconds + 1), LIMIT), encoding="utf-8"
                )
                results.append(self._simulate(network, routes, watch))
        speeds, lane_changes, crashed = zip(*results, strict=True)
        return Measurement(
            n_scenarios=n_scenarios,
            seconds=self._seconds,
            n_substeps=n_scenarios * self._n_vehicles * self._seconds * TICKS_PER_SECOND,
            cpu_s=watch.cpu_s,
            wall_s=watch.wall_s,
            mean_speed=float(np.mean(speeds)),
            lane_changes=sum(lane_changes),
            crashed=sum(crashed),
        )

    def _simulate(self, network: Path, routes: Path, watch: Stopwatch) -> tuple[float, int, int]:
        """Mean speed at the end [m/s], lane changes and crashed vehicles of one scene."""
        sumo = self._sumo
        sumo.start(["sumo", "-n", str(network), "-r", str(routes), *_OPTIONS.split()])
        try:
            sumo.simulationStep()  # the vehicles enter; not counted
            names = sumo.vehicle.getIDList()
            if len(names) != self._n_vehicles:
                raise RuntimeError(f"SUMO put {len(names)} of {self._n_vehicles} vehicles on the road")
            changes, crashed, lanes = 0, set(), None
            for _ in range(self._seconds):
                with watch:
                    for _ in range(TICKS_PER_SECOND):
                        sumo.simulationStep()
                earlier_lanes, lanes = lanes, [sumo.vehicle.getLaneIndex(name) for name in names]
                if earlier_lanes is not None:
                    changes += int(np.count_nonzero(np.not_equal(earlier_lanes, lanes)))
                crashed.update(sumo.simulation.getCollidingVehiclesIDList())
            return float(np.mean([sumo.vehicle.getSpeed(name) for name in names])), changes, len(crashed)
        finally:
            sumo.close()

    def _draw_traffic(self, random: np.random.Generator) -> tuple[str, float]:
        """A route file with vehicles placed as highway-env 1.12.1 does in `Vehicle.create_random`, and the position of
        the first one [m].
        """
        speed = random.uniform(21, 24, self._n_vehicles)
        offset = (12 + speed) * np.exp(-5 / 40 * N_LANES) / self._density
        position = np.cumsum(offset * random.uniform(0.9, 1.1, self._n_vehicles)) + 3 * offset[0]
        lane = random.integers(0, N_LANES, self._n_vehicles)
        delta = random.uniform(3.5, 4.5, self._n_vehicles)
        vehicles = (
            _VEHICLE.format(i, speed=speed[i], position=position[i], lane=lane[i], delta=delta[i])
            for i in range(self._n_vehicles)
        )
        return f"<routes>{''.join(vehicles)}</routes>", float(position[-1])
