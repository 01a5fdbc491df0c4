"""SUMO simulations in a process of their own: `python sumo_worker.py JOBS.json LENGTHS.json`.

libsumo and pyarrow each bring a version of Arrow, so they do not share a process. The first vehicle of each simulation
is given its speed in every step; SUMO drives all others. Standard library and libsumo only.
"""

import json
import sys
from importlib import import_module
from pathlib import Path
from typing import Any


def main(jobs_file: str, lengths_file: str) -> None:
    """Runs the simulations and writes the lengths of their vehicles [m]; SUMO writes their motion."""
    jobs = json.loads(Path(jobs_file).read_text(encoding="utf-8"))
    lengths = [_simulate(job) for job in jobs]
    Path(lengths_file).write_text(json.dumps(lengths), encoding="utf-8")


def _simulate(job: dict[str, Any]) -> list[float]:
    """Lengths of the vehicles [m].

    Raises:
        RuntimeError: SUMO did not put all vehicles on the road.
    """
    sumo, ids = import_module("libsumo"), job["ids"]
    sumo.start(["sumo", *job["options"]])
    try:
        sumo.simulationStep()  # the vehicles enter
        missing = sorted(set(ids) - set(sumo.vehicle.getIDList()))
        if missing:
            raise RuntimeError(f"SUMO did not put {', '.join(missing)} on the road")
        lengths = [sumo.vehicle.getLength(vehicle) for vehicle in ids]
        sumo.vehicle.setSpeedMode(ids[0], 0)  # obeys without checks of safety
        for vehicle in ids:
            sumo.vehicle.setLaneChangeMode(vehicle, 0)  # no lane changes
        for speed in job["speeds"][1:]:
            sumo.vehicle.setSpeed(ids[0], speed)
            sumo.simulationStep()
        return lengths
    finally:
        sumo.close()


if __name__ == "__main__":
    main(*sys.argv[1:3])
