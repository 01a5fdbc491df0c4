"""The same platoons in SUMO, through libsumo; what happened is read from its floating car data (FCD)."""

import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from rearl_jax.export.platoon import STEPS_PER_SECOND, Motion, Start
from rearl_jax.export.sumo_road import draw_network

FASTEST = 60.0
"""Limit of the road [m/s], which limits nobody."""

LEADER = "leader"
"""Id of the first vehicle, and of its type."""

# The leader moves as it was measured; what followers think of its braking is what they think of their own.
_LEADER_TYPE = (
    '<vType id="leader" length="{length:.6g}" maxSpeed="60" accel="20" decel="{decel:.6g}" speedFactor="1"'
    ' speedDev="0"/>'
)
_VEHICLE = (
    '<vehicle id="{id}" type="{type}" depart="0" departLane="0" departPos="{front:.6f}" departSpeed="{speed:.6f}"'
    ' insertionChecks="none"><route edges="road"/></vehicle>'
)
_OPTIONS = (
    f"--step-length {1 / STEPS_PER_SECOND} --step-method.ballistic true --threads 1 --no-step-log true"
    " --no-warnings true --xml-validation never --collision.action none --time-to-teleport -1 --precision 6"
)


def check_sumo() -> None:
    """Raises ModuleNotFoundError with the remedy where libsumo is missing."""
    if find_spec("libsumo") is None:
        raise ModuleNotFoundError(
            "libsumo is not installed, which export.compare needs: install the extra with "
            'pip install "rearl-jax[sumo]", or leave export.compare out'
        )


def simulate_in_sumo(
    start: Start,
    leader_speed: Float[np.ndarray, "steps platoons"],
    types: str,
    names: Sequence[Sequence[str]],
    seed: int,
) -> Motion:
    """The platoons behind first vehicles that move by their measured speeds, in SUMO.

    Lengths of the followers are those of their types in SUMO.

    Args:
        start: The platoons at the start; their drivers are not used.
        leader_speed: Speeds of the first vehicles [m/s], the first at the start.
        types: Additional file of SUMO with the vehicle types.
        names: Type, or distribution of types, of each follower of each platoon.
        seed: Seed of SUMO.

    Raises:
        ModuleNotFoundError: libsumo is not installed.
        RuntimeError: SUMO did not put all vehicles on the road.
    """
    check_sumo()
    parts = [
        _simulate_one(start, leader_speed[:, number], types, own, number, seed + number)
        for number, own in enumerate(names)
    ]
    position, speed, length = (np.stack(arrays, axis=-1) for arrays in zip(*parts, strict=True))
    return Motion(position, speed, length)


def _simulate_one(
    start: Start, leader_speed: np.ndarray, types: str, names: Sequence[str], number: int, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres [m], speeds [m/s] and lengths [m] of one platoon."""
    sumo = import_module("libsumo")
    ids = [LEADER, *(f"follower_{k}" for k in range(1, len(names) + 1))]
    with tempfile.TemporaryDirectory(prefix="rearl_export_") as name:
        folder = Path(name)
        network, routes, additional, fcd = (
            folder / file for file in ("road.net.xml", "traffic.rou.xml", "types.add.xml", "fcd.xml")
        )
        front = np.asarray(start.state.x)[:, number] + start.length[:, number] / 2
        length = float(np.ceil(front[0] + FASTEST * len(leader_speed) / STEPS_PER_SECOND))
        network.write_text(draw_network(1, length, FASTEST), encoding="utf-8")
        additional.write_text(types, encoding="utf-8")
        vehicles = [
            _VEHICLE.format(id=own, type=kind, front=place, speed=leader_speed[0])
            for own, kind, place in zip(ids, (LEADER, *names), front, strict=True)
        ]
        decel = np.asarray(start.drivers.car_following.comfortable_deceleration())[0, number]
        leader = _LEADER_TYPE.format(length=start.length[0, number], decel=decel)
        routes.write_text(f"<routes>{leader}{''.join(vehicles)}</routes>", encoding="utf-8")
        inputs = ["-n", network, "-r", routes, "-a", additional, "--fcd-output", fcd, "--seed", seed]
        sumo.start(["sumo", *map(str, inputs), *_OPTIONS.split()])
        try:
            sumo.simulationStep()  # the vehicles enter
            missing = sorted(set(ids) - set(sumo.vehicle.getIDList()))
            if missing:
                raise RuntimeError(f"SUMO did not put {', '.join(missing)} on the road")
            lengths = np.array([sumo.vehicle.getLength(own) for own in ids])
            sumo.vehicle.setSpeedMode(LEADER, 0)
            for own in ids:
                sumo.vehicle.setLaneChangeMode(own, 0)
            for speed in leader_speed[1:].tolist():
                sumo.vehicle.setSpeed(LEADER, speed)
                sumo.simulationStep()
        finally:
            sumo.close()
        table = read_fcd(fcd)
    tracks = [table.pivot(index="time", columns="id", values=column)[ids].to_numpy() for column in ("pos", "speed")]
    return tracks[0] - lengths / 2, tracks[1], lengths


def read_fcd(path: Path) -> pd.DataFrame:
    """SUMO's floating car data: one row per vehicle and step with `time` [s], `id`, `lane`, `pos` (of the front bumper
    on its lane) [m], `speed` [m/s].
    """
    rows, time = [], 0.0
    for event, element in ET.iterparse(path, events=("start", "end")):
        if element.tag == "timestep":
            if event == "start":
                time = float(element.attrib["time"])
            else:
                element.clear()
        elif element.tag == "vehicle" and event == "start":
            own = element.attrib
            rows.append((time, own["id"], own["lane"], float(own["pos"]), float(own["speed"])))
    return pd.DataFrame(rows, columns=["time", "id", "lane", "pos", "speed"])
