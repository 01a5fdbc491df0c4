"""Floating car data in SUMO's layouts: a road of two edges with a junction between, and a ramp that joins it."""

from pathlib import Path

import numpy as np

from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.recordings import iterate_recordings

STEP = 0.5
EDGES = {"main": 800.0, ":j_1": 6.0, "exit": 700.0}
RAMP = {"ramp": 300.0, ":j_0": 4.0, "exit": 700.0}
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n<!-- <configuration/> -->\n<fcd-export xmlns:xsi="http://x">\n'
TYPES = '<routes><vType id="pkw" vClass="passenger"/><vType id="lkw" vClass="truck" length="12.5"/></routes>'
NET = (
    '<net><edge id="main"><lane id="main_0" speed="33.33"/><lane id="main_1" speed="33.33"/></edge>'
    '<edge id=":j_1"><lane id=":j_1_0" speed="33.33"/><lane id=":j_1_1" speed="33.33"/></edge>'
    '<edge id="exit"><lane id="exit_0" speed="33.33"/><lane id="exit_1" speed="33.33"/>'
    '<lane id="exit_2" speed="33.33"/></edge></net>'
)


def rows(n_vehicles: int = 8, n_steps: int = 90) -> list[dict[str, str | float]]:
    """Rows in the order of time; every fourth vehicle is a truck, the sixth comes from the ramp."""
    found = []
    for step in range(n_steps):
        for i in range(n_vehicles):
            kind = "lkw" if i % 4 == 3 else "pkw"
            speed = round(22.0 + i % 3 + np.sin(0.1 * step + i), 2)
            is_ramp = i == 5
            edges, lane = (RAMP, 0) if is_ramp else (EDGES, i % 2)
            # As SUMO's Euler steps: the speed at the end of a step, times its duration.
            driven = STEP * sum(round(22.0 + i % 3 + np.sin(0.1 * s + i), 2) for s in range(6 * i + 1, step + 1))
            front = 12.6 + driven
            if step < 6 * i:
                continue
            edge = next((name for name in edges if front <= _end(edges, name)), None)
            if edge is None:
                continue
            pos = front - _end(edges, edge) + edges[edge]
            lane += edge == "exit" and not is_ramp
            along = pos + sum(EDGES[name] for name in EDGES if edge in EDGES and _end(EDGES, name) < _end(EDGES, edge))
            found.append(
                {
                    "time": STEP * step,
                    "id": f"flow.{i}",
                    "x": round(along, 2),
                    "y": round(3.2 * lane, 2),
                    "angle": 90.0,
                    "type": kind,
                    "speed": speed,
                    "pos": round(pos, 2),
                    "lane": f"{edge}_{lane}",
                }
            )
    return found


def xml_of(found: list[dict[str, str | float]]) -> str:
    """The rows as SUMO writes them."""
    lines, time = [], None
    for row in found:
        if row["time"] != time:
            lines += ([] if time is None else ["    </timestep>"]) + [f'    <timestep time="{row["time"]:.2f}">']
            time = row["time"]
        attributes = " ".join(f'{name}="{value}"' for name, value in row.items() if name != "time")
        lines.append(f"        <vehicle {attributes}/>")
    return HEAD + "\n".join(lines) + "\n    </timestep>\n</fcd-export>\n"


def csv_of(found: list[dict[str, str | float]]) -> str:
    """The rows as SUMO's tabular output."""
    names = ["timestep_time", *(f"vehicle_{name}" for name in found[0] if name != "time")]
    return "\n".join([";".join(names), *(";".join(map(str, row.values())) for row in found)]) + "\n"


def write(folder: Path, text: str, name: str = "fcd.xml", *, beside: bool = True) -> Path:
    """The folder with a file of that text, and the route and network files next to it."""
    (folder / name).write_text(text)
    if beside:
        (folder / "flow.rou.xml").write_text(TYPES)
        (folder / "road.net.xml").write_text(NET)
    return folder


def read(root: Path, on_bad: BadRows = BadRows.stop):
    """The one recording of a file or folder."""
    (recording,) = iterate_recordings(DataConfig(DataFormat.sumo, str(root), on_bad=on_bad))
    return recording


def _end(edges: dict[str, float], edge: str) -> float:
    names = list(edges)
    return sum(edges[name] for name in names[: names.index(edge) + 1])
