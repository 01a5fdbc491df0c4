"""Tables of random layout through `rearl prepare FILE`: what it reads must be the traffic, or it must have doubts."""

import contextlib
import io
import shlex
import warnings
from collections.abc import Callable
from pathlib import Path
from random import Random

import numpy as np
import pandas as pd

from rearl_jax.cli.composition import compose_task
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.data.survey.task import run
from rearl_jax.problems import ProblemError
from rearl_jax.tasks import TASKS
from tests.data.survey_tables import truth
from tests.fuzz.outcome import Outcome, Result, judged

_PREPARE = next(task for task in TASKS if task.words == "prepare")
_TRUTH = truth()
_NAMES = {
    "track_id": "id track vehicle_id Fahrzeug Véhicule objectId obj k".split(),
    "time": "time t Zeit timestamp seconds Temps clock".split(),
    "position": "x s pos Weg local_y Abscisse along q".split(),
    "speed": "speed v vel Geschwindigkeit Vitesse u".split(),
    "lateral": "y lateral local_x offset w".split(),
    "lane": "lane lane_id Fahrstreifen Voie".split(),
    "length": "length len Länge Longueur size".split(),
    "width": "width Breite Largeur b".split(),
    "acceleration": "acc a acceleration Beschleunigung".split(),
}
_LENGTHS = {"m": 1.0, "ft": 0.3048, "cm": 0.01, "km": 1000.0}
_SPEEDS = {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704, "ft/s": 0.3048}
_TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}
_MAX_ERROR = 0.03
"""Relative error of speeds and of steps of positions above which a table is misread."""


def survey(folder: Path) -> Callable[[Random], Result]:
    """A function that tries one table in a folder."""

    def try_one(rng: Random) -> Result:
        path = _written(folder, rng)
        try:
            with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
                warnings.simplefilter("error")
                found = run(str(path))
                words = shlex.split(found["command"])[2:]
                recordings = list(iterate_recordings(compose_task(_PREPARE, words, None).data))
        except Exception as error:  # whatever it is, it is judged
            return judged(error, (ProblemError,))
        finally:
            path.unlink()
        faults = _faults([recording.table for recording in recordings])
        if faults and not found["doubts"]:
            return Outcome.silent, f"{faults}: {path.name} {found['command']}"
        return Outcome.accepted, ""

    return try_one


def _written(folder: Path, rng: Random) -> Path:
    """The traffic in columns, units and a layout of its own."""
    length, speed, time = (rng.choice(list(units)) for units in (_LENGTHS, _SPEEDS, _TIMES))
    shift = rng.choice([0.0, 0.0, 5000.0, 1.7e9])
    rows = _TRUTH.assign(
        position=_TRUTH["position"] / _LENGTHS[length],
        lateral=_TRUTH["lateral"] / _LENGTHS[length],
        length=_TRUTH["length"] / _LENGTHS[length],
        width=_TRUTH["width"] / _LENGTHS[length],
        speed=_TRUTH["speed"] / _SPEEDS[speed],
        acceleration=_TRUTH["acceleration"] / _SPEEDS[speed],
        time=(_TRUTH["time"] + shift) / _TIMES[time],
    )
    units = {"position": length, "lateral": length, "length": length, "width": length, "speed": speed, "time": time}
    turn = rng.choice([0.0] * 6 + [rng.uniform(0.02, 1.5)])
    along, across = rows["position"], rows["lateral"]
    rows["position"] = along * np.cos(turn) - across * np.sin(turn)
    rows["lateral"] = along * np.sin(turn) + across * np.cos(turn)
    table = pd.DataFrame()
    says = rng.random() < 0.4
    for name in rng.sample(list(_NAMES), len(_NAMES)):
        if name in ("track_id", "time", "position", "speed") or rng.random() < 0.6 or (turn and name == "lateral"):
            unit = f" [{units[name]}]" if says and name in units else ""
            table[rng.choice(_NAMES[name]) + unit] = rows[name]
    if time == "s" and rng.random() < 0.2:
        moments = pd.Timestamp("2024-05-31T08:00") + pd.to_timedelta(_TRUTH["time"], unit="s")
        table = table.assign(Uhrzeit=moments.dt.strftime(rng.choice(["%H:%M:%S.%f", "%Y-%m-%dT%H:%M:%S.%f+02:00"])))
    if rng.random() < 0.3:
        table["extra"] = [rng.uniform(-100.0, 100.0) for _ in range(len(table))]
    if rng.random() < 0.1:
        table = table.sample(frac=1.0, random_state=rng.randrange(2**31)).sort_values(table.columns[-1])
    ending = rng.choice(["csv", "csv", "csv.gz", "parquet", "txt"])
    path = folder / f"table.{ending}"
    if ending == "parquet":
        table.to_parquet(path)
        return path
    text = table.to_csv(
        sep=(separator := rng.choice([",", ";", "\t"])),
        decimal="." if separator == "," else rng.choice([".", ","]),
        index=rng.random() < 0.2,
        float_format=rng.choice([None, "%.6f", "%.4f"]),
    )
    text = rng.choice(["", "", "# a comment\n", "Recording 3\nRoad A9\n"]) + text
    content = text.encode(rng.choice(["utf-8", "utf-8-sig", "latin-1", "utf-16"]))
    if ending == "csv.gz":
        import gzip

        content = gzip.compress(content)
    path.write_bytes(content)
    return path


def _faults(tables: list[pd.DataFrame]) -> str:
    """Differences of the tables from the traffic; empty if there are none."""
    if len(tables) != 1 or len(tables[0]) != len(_TRUTH):
        return f"{[len(table) for table in tables]} rows"
    read = tables[0].sort_values(["track_id", "frame"])
    # Tracks may be numbered anew.
    own = [part.sort_values("frame") for _, part in read.groupby("track_id", observed=True)]
    true = [part for _, part in _TRUTH.groupby("track_id")]
    if len(own) != len(true):
        return f"{len(own)} vehicles"
    own, true = (sorted(parts, key=lambda part: float(part["speed"].iloc[:3].mean())) for parts in (own, true))
    for name in ("speed", "position"):
        steps = [
            np.concatenate(
                [np.diff(part[name].to_numpy(np.float64)) if name == "position" else part[name] for part in parts]
            )
            for parts in (own, true)
        ]
        error = float(np.median(np.abs(steps[0] - steps[1])) / np.median(np.abs(steps[1])))
        if error > _MAX_ERROR:
            return f"{name} off by {error:.3g}"
    return ""
