"""Runs of OpenACC as published: lines about the run, then Time, Speed1, E1, ... of every vehicle, IVS1 and Driver1."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

T = np.arange(300) / 10.0
LENGTH = 4.8  # of a car, between whose receivers and bumpers gaps differ


def columns(n: int = 4, drivers: Mapping[int, Sequence[str]] | None = None, faster: float = 0.0) -> dict[str, Sequence]:
    """n vehicles that swing around 14 m/s; the gap to the next opens and closes as their speeds say.

    Args:
        n: Number of vehicles.
        drivers: Words for the driver, by number of the vehicle.
        faster: How much faster each swings than the vehicle ahead [rad/s].
    """
    speeds = [14.0 + np.sin((0.4 + faster * k) * T - 0.3 * k) for k in range(n)]
    moved = [np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) / 10.0)]) for v in speeds]
    found: dict[str, Sequence] = {"Time": 5370.0 + T}
    place = np.zeros_like(T)
    gaps = {}
    for k in range(n):
        if k:
            gaps[k] = 15.0 + 2.0 * k + moved[k - 1] - moved[k]
            place = place - gaps[k] - LENGTH
        along = moved[0] + place
        found |= {f"Speed{k + 1}": speeds[k], f"E{k + 1}": 0.6 * along, f"N{k + 1}": 0.8 * along}
        found |= {f"Lon{k + 1}": np.full_like(T, 16.8), f"Lat{k + 1}": np.full_like(T, 46.9)}
    found |= {f"IVS{k}": gap for k, gap in gaps.items()}
    return found | {f"Driver{k}": words for k, words in (drivers or {}).items()}


def run_of(table: Mapping[str, Sequence], acc: str = "1", setting: str = "S", n: int = 4, commas: str = ",,") -> str:
    """A run; commas that a spreadsheet leaves behind the lines above the table."""
    cars = ",".join(["SKODA_TARGET", "TESLA_MODEL3", "BMW_I3", "AUDI_A4", "MAZDA_3"][:n])
    head = [f"Date,9,10,2019{commas}", f"Vehicle_order,{cars},", f"Number_of_vehicles,{n}{commas}"]
    head += [f"ACC,{acc}{commas}", f"Distance_setting,{setting}", ",".join(table)]
    lines = [",".join(map(_cell, values)) for values in zip(*table.values(), strict=True)]
    return "\n".join([*head, *lines]) + "\n"


def write(folder: Path, text: str, name: str = "Vicolungo/part1.csv") -> Path:
    """The folder of campaigns with a run, and the table of cars that is published with runs."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    (path.parent / "Veh_specifications.csv").write_text("Vehicles,Max power (kW)\nTESLA_MODEL3,358\n")
    return folder


def _cell(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return "" if np.isnan(value) else repr(float(value))
