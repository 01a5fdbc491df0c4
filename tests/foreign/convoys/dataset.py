"""Datasets: the convoys of one effect, with what was set."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from .behaviour import EFFECTS, choose
from .fleet import draw
from .loggers import EVERY, log
from .road import draw_upgrades, lead_speeds
from .simulation import STEP, simulate

FRAME_RATE = 1 / (STEP * EVERY)
"""Frames per second of the loggers [1/s]."""

DURATION = 480.0
"""Length of a recording [s]."""

ROAD_LENGTH = 18000.0
"""Length of the road [m]: no run can get farther."""

_SETTLING = 60.0
"""Time driven before the recording begins [s]."""

_MARGIN = 15.0
"""Time driven after it ends [s], so that loggers whose clocks are behind have something to record."""


@dataclass(frozen=True)
class Dataset:
    """Recordings of convoys under one effect.

    Attributes:
        tables: One table per run, in canonical columns; its lane is 1, the only one.
        frame_rate: Frames per second [1/s].
        truth: Name of the effect, or "control".
        values: What was set: means and standard deviations over vehicles, with units in the names; the same drivers and
            lead vehicles drive under every effect of a seed.
        description: What the recordings are.
    """

    tables: list[pd.DataFrame]
    frame_rate: float
    truth: str
    values: dict[str, float]
    description: str


def effects() -> tuple[str, ...]:
    """Names of the effects, without the control."""
    return tuple(EFFECTS)


def make(effect: str, seed: int) -> Dataset:
    """The recordings under this effect, or under none: "control".

    Raises:
        ValueError: There is no such effect.
    """
    streams = [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(6)]
    fleet = draw(streams[0])
    upgrades = draw_upgrades(streams[1])
    steps = round((_SETTLING + DURATION + _MARGIN) / STEP)
    lead = lead_speeds(streams[2], fleet, steps, STEP, _SETTLING)
    behaviour, values = choose(effect, streams[3], fleet)
    if effect == "grade":
        values |= upgrades.values()
    motion = simulate(fleet, behaviour, upgrades, lead, streams[4])
    tables = log(motion, fleet, behaviour.clock_offset, round(_SETTLING / STEP), streams[5])
    runs, vehicles = fleet.length.shape
    description = (
        f"{runs} runs of convoys of {vehicles} vehicles on one lane of a motorway, {DURATION / 60:.0f} min each, every "
        "run with its own drivers. Every third run has cars only and goes up to 110 km/h, the others have trucks among "
        "the cars and go up to 85 km/h. The lead vehicle follows traffic that is not recorded, through flowing, dense "
        f"and stop-and-go stretches. Every vehicle has a GNSS logger of {FRAME_RATE:.0f} Hz; positions and Doppler "
        "speeds are measured separately."
    )
    return Dataset(tables, FRAME_RATE, effect, values, description)
