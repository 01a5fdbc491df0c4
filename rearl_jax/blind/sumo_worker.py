"""One SUMO simulation in a process of its own: `python -m rearl_jax.blind.sumo_worker JOB.json EVENTS.npz`.

The first vehicle of each lane has a prescribed speed in every step; SUMO drives all others. No vehicle is removed,
because a removed vehicle would still be the leader of its follower.
"""

import json
import sys
import tempfile
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

LENGTH = 30_000.0
"""Length of the road [m]; no vehicle reaches its end."""

FASTEST = 60.0
"""Speed limit of the road [m/s], above every desired speed."""

_TYPE = (
    '<vType id="t{id}" carFollowModel="{model}" length="{length}" width="{width}" maxSpeed="{v0:.3f}" minGap="{s0:.3f}"'
    ' tau="{T:.3f}" accel="{a:.3f}" decel="{b:.3f}" emergencyDecel="9" speedFactor="1" speedDev="0" sigma="0"'
    ' actionStepLength="{action}" laneChangeModel="LC2013" lcOvertakeRight="{right}"/>'
)
_VEHICLE = (
    '<vehicle id="{id}" type="t{id}" depart="0" departLane="{lane}" departPos="{front:.3f}" departSpeed="{speed:.3f}"'
    ' insertionChecks="none"><route edges="{edges}"/></vehicle>'
)


def main(job_file: str, events_file: str) -> None:
    """Simulates a job, the parameters written by `rearl_jax.blind.sumo`, and writes the resulting motion.

    Raises:
        RuntimeError: SUMO did not put all vehicles on the road.
    """
    job = json.loads(Path(job_file).read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory(prefix="rearl_blind_sumo_") as name:
        network, routes = Path(name) / "road.net.xml", Path(name) / "traffic.rou.xml"
        edges = _edges(job)
        network.write_text(_network(job, edges), encoding="utf-8")
        routes.write_text(_traffic(job, edges), encoding="utf-8")
        np.savez(events_file, allow_pickle=False, **_simulate(job, network, routes))


def _edges(job: dict[str, Any]) -> list[tuple[str, float, float, float]]:
    """Name, start, end [m] and limit [m/s] of each edge."""
    if job["limit"] is None:
        return [("whole", 0.0, LENGTH, FASTEST)]
    start, end = job["section"]
    return [("before", 0.0, start, FASTEST), ("inside", start, end, job["limit"]), ("after", end, LENGTH, FASTEST)]


def _network(job: dict[str, Any], edges: list[tuple[str, float, float, float]]) -> str:
    """A straight road as a network file; SUMO counts lanes from the right."""
    n, lane_width = job["n_lanes"], job["lane_width"]
    ys = [lane_width * (k - n + 0.5) for k in range(n)]  # lane centres [m]
    edge_elements = []
    for name, start, end, limit in edges:
        lanes = "".join(
            f'<lane id="{name}_{k}" index="{k}" speed="{limit}" length="{end - start}" width="{lane_width}"'
            f' shape="{start},{y} {end},{y}"/>'
            for k, y in enumerate(ys)
        )
        edge_elements.append(f'<edge id="{name}" from="j{start}" to="j{end}" priority="1">{lanes}</edge>')
    junction_positions = [edges[0][1], *(end for _, _, end, _ in edges)]
    incoming = ["", *(" ".join(f"{name}_{k}" for k in range(n)) for name, *_ in edges)]
    junctions, links = [], []
    for number, (x, lanes) in enumerate(zip(junction_positions, incoming, strict=True)):
        is_inner = 0 < number < len(junction_positions) - 1
        requests = "".join(
            f'<request index="{k}" response="{"0" * n}" foes="{"0" * n}" cont="0"/>' for k in range(n) if is_inner
        )
        junctions.append(
            f'<junction id="j{x}" type="{"priority" if is_inner else "dead_end"}" x="{x}" y="0"'
            f' incLanes="{lanes}" intLanes="" shape="{x},0 {x},{-lane_width * n}">{requests}</junction>'
        )
    for (before, *_), (after, *_) in pairwise(edges):
        links += [
            f'<connection from="{before}" to="{after}" fromLane="{k}" toLane="{k}" dir="s" state="M"/>'
            for k in range(n)
        ]
    return (
        '<net version="1.20"><location netOffset="0,0" '
        f'convBoundary="0,{-lane_width * n},{LENGTH},0" origBoundary="0,0,0,0" projParameter="!"/>'
        f"{''.join(edge_elements)}{''.join(junctions)}{''.join(links)}</net>"
    )


def _traffic(job: dict[str, Any], edges: list[tuple[str, float, float, float]]) -> str:
    """Types and vehicles as a route file, the first in the file being the farthest ahead."""
    route = " ".join(name for name, *_ in edges)
    types = [
        _TYPE.format(
            id=k, model=job["model"], length=job["length"][k], width=job["width"][k],
            v0=job["desired_speed"][k] if job["rank"][k] else FASTEST, s0=job["jam_gap"][k],
            T=job["time_gap"][k], a=job["max_accel"][k], b=job["comfort_decel"][k],
            action=job["action_step"], right=job["overtake_right"],
        )
        for k in range(len(job["position"]))
    ]  # fmt: skip
    vehicles = [
        _VEHICLE.format(
            id=k, lane=job["n_lanes"] - 1 - job["lane"][k], speed=job["speed"][k], edges=route,
            front=job["position"][k] + 0.5 * job["length"][k],
        )
        for k in np.argsort(job["position"])[::-1].tolist()
    ]  # fmt: skip
    return f"<routes>{''.join((*types, *vehicles))}</routes>"


def _simulate(job: dict[str, Any], network: Path, routes: Path) -> dict[str, np.ndarray]:
    """Centre [m], speed, acceleration and lane of every vehicle at every step."""
    sumo = import_module("libsumo")
    options = (
        f"--step-length {job['step']} --default.action-step-length {job['step']} --seed {job['seed']} --threads 1"
        " --step-method.ballistic true --no-step-log true --no-warnings true --xml-validation never"
        " --collision.action none --time-to-teleport -1"
    )
    sumo.start(["sumo", "-n", str(network), "-r", str(routes), *options.split()])
    try:
        sumo.simulationStep()
        names = [str(k) for k in range(len(job["position"]))]
        missing = sorted(set(names) - set(sumo.vehicle.getIDList()))
        if missing:
            raise RuntimeError(f"SUMO did not put {len(missing)} of {len(names)} vehicles on the road")
        platoon_leaders = [str(k) for k, rank in enumerate(job["rank"]) if rank == 0]
        for name in names:
            sumo.vehicle.setLaneChangeMode(name, 0)  # no vehicle changes lanes
        for name in platoon_leaders:
            sumo.vehicle.setSpeedMode(name, 0)  # the prescribed speed is driven without SUMO's checks
        rows: dict[str, list[list[float]]] = {"position": [], "speed": [], "acceleration": [], "lane": []}
        for speeds in np.transpose(job["platoon_leader_speeds"])[1:]:
            for name, speed in zip(platoon_leaders, speeds.tolist(), strict=True):
                sumo.vehicle.setSpeed(name, speed)
            sumo.simulationStep()
            # Not the odometer, which starts at each vehicle's own start position.
            rows["position"].append([sumo.vehicle.getPosition(name)[0] for name in names])
            rows["speed"].append([sumo.vehicle.getSpeed(name) for name in names])
            rows["acceleration"].append([sumo.vehicle.getAcceleration(name) for name in names])
            rows["lane"].append([job["n_lanes"] - 1 - sumo.vehicle.getLaneIndex(name) for name in names])
    finally:
        sumo.close()
    events = {name: np.array(values) for name, values in rows.items()}
    events["position"] = events["position"] - 0.5 * np.array(job["length"])  # SUMO's position is the front bumper
    return events


if __name__ == "__main__":
    main(*sys.argv[1:3])
