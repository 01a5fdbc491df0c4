"""The platoons of `platoon` in SUMO, simulated by `sumo_worker`; their motion is read from floating car data (FCD)."""

import json
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float

from rearl_jax.export.platoon import STEPS_PER_SECOND, Motion, Start
from rearl_jax.export.sumo_road import draw_network

SPEED_LIMIT = 60.0
"""Speed limit of the road [m/s], above every desired speed."""

FCD = "fcd_{}.xml"
"""Name of the file with the floating car data of a platoon."""

LEADER_ID = "leader"
"""Id of the first vehicle, and of its type."""

# The leader moves as measured; followers assume that it can brake as hard as they do.
_LEADER_TYPE = (
    '<vType id="leader" length="{length:.6g}" maxSpeed="{max_speed:g}" accel="20" decel="{decel:.6g}" speedFactor="1"'
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
    """Raise ModuleNotFoundError with the remedy if libsumo is missing."""
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
        RuntimeError: SUMO failed; the message holds its output.
    """
    check_sumo()
    with tempfile.TemporaryDirectory(prefix="rearl_export_") as name:
        folder = Path(name)
        types_file = folder / "types.add.xml"
        types_file.write_text(types, encoding="utf-8")
        jobs = [
            _job_of(folder, start, leader_speed[:, number], types_file, of_platoon, number, seed + number)
            for number, of_platoon in enumerate(names)
        ]
        lengths = _run(folder, jobs)
        tables = [read_fcd(folder / FCD.format(number)) for number in range(len(jobs))]
    tracks = [
        [table.pivot(index="time", columns="id", values=column)[job["ids"]].to_numpy() for column in ("pos", "speed")]
        for job, table in zip(jobs, tables, strict=True)
    ]
    front, speed = (np.stack(arrays, axis=-1) for arrays in zip(*tracks, strict=True))
    return Motion(front - lengths / 2, speed, lengths)


def _job_of(
    folder: Path, start: Start, leader_speed: np.ndarray, types: Path, names: Sequence[str], number: int, seed: int
) -> dict[str, Any]:
    """Job for `sumo_worker` on platoon `number`: ids of vehicles, options of SUMO, speeds of the first vehicle [m/s].

    Writes SUMO's inputs; `types` is an additional file, `names` are the types of the followers in it.
    """
    ids = [LEADER_ID, *(f"follower_{k}" for k in range(1, len(names) + 1))]
    network, routes, fcd = (folder / file.format(number) for file in ("road_{}.net.xml", "traffic_{}.rou.xml", FCD))
    front = np.asarray(start.state.x)[:, number] + start.length[:, number] / 2
    length = float(np.ceil(front[0] + SPEED_LIMIT * len(leader_speed) / STEPS_PER_SECOND))
    network.write_text(draw_network(1, length, SPEED_LIMIT), encoding="utf-8")
    vehicles = [
        _VEHICLE.format(id=vehicle, type=kind, front=position, speed=leader_speed[0])
        for vehicle, kind, position in zip(ids, (LEADER_ID, *names), front, strict=True)
    ]
    decel = np.asarray(start.drivers.car_following.comfortable_deceleration())[0, number]
    leader = _LEADER_TYPE.format(length=start.length[0, number], decel=decel, max_speed=SPEED_LIMIT)
    routes.write_text(f"<routes>{leader}{''.join(vehicles)}</routes>", encoding="utf-8")
    inputs = ["-n", network, "-r", routes, "-a", types, "--fcd-output", fcd, "--seed", seed]
    return {"ids": ids, "options": [*map(str, inputs), *_OPTIONS.split()], "speeds": leader_speed.tolist()}


def _run(folder: Path, jobs: list[dict[str, Any]]) -> Float[np.ndarray, "vehicles platoons"]:
    """Lengths of the vehicles [m], after SUMO has simulated all platoons."""
    jobs_file, lengths_file = folder / "jobs.json", folder / "lengths.json"
    jobs_file.write_text(json.dumps(jobs), encoding="utf-8")
    # Run by its path, because importing the package would bring pyarrow into the process.
    command = [sys.executable, str(Path(__file__).with_name("sumo_worker.py")), str(jobs_file), str(lengths_file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"SUMO failed: {done.stderr.strip()[-2000:]}")
    return np.array(json.loads(lengths_file.read_text(encoding="utf-8"))).T


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
            values = element.attrib
            rows.append((time, values["id"], values["lane"], float(values["pos"]), float(values["speed"])))
    return pd.DataFrame(rows, columns=["time", "id", "lane", "pos", "speed"])
