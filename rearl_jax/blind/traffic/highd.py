"""A data set as highD's three files per recording: a camera view of the road, 25 frames per second."""

import json
from pathlib import Path

import numpy as np

from rearl_jax.blind.traffic.measurement import LANE_WIDTH, Frames
from rearl_jax.blind.traffic.scenario import Scenario
from rearl_jax.blind.traffic.simulation import Events
from rearl_jax.data.generator.camera import Tracks
from rearl_jax.data.generator.dataset import TRUTH_FILE
from rearl_jax.data.generator.files import write_recording
from rearl_jax.data.generator.highd_tables import Sizes, highd_tables
from rearl_jax.data.generator.plan import RecordingPlan
from rearl_jax.data.generator.road import LOWER, Section
from rearl_jax.whole_files import replacing

FRAME_RATE = 25.0
"""Frame rate of highD [1/s]."""


def write_highd(folder: Path, scenario: Scenario, events: Events, frames: Frames) -> None:
    """Writes three files per recording, and a file that marks them as generated.

    Raises:
        ValueError: The scenario has no view, or another frame rate than highD.
    """
    if scenario.view is None or scenario.frame_rate != FRAME_RATE:
        raise ValueError("highD is a camera's view at 25 frames per second: set view=420 and frame_rate=25")
    for number in range(scenario.n_recordings):
        _write(folder, scenario, scenario.view, events, frames, number)
    with replacing(folder / TRUTH_FILE) as unfinished:
        unfinished.write_text(json.dumps({"generated": True}) + "\n", encoding="utf-8")


def _write(folder: Path, scenario: Scenario, view: float, events: Events, frames: Frames, number: int) -> None:
    fleet = events.fleet
    is_in_view = (frames.position - 0.5 * fleet.length >= 0.0) & (frames.position + 0.5 * fleet.length <= view)
    vehicle, frame = np.nonzero(_unbroken(is_in_view & (fleet.recording == number)).T)
    across = np.gradient(frames.lateral, 1.0 / FRAME_RATE, axis=0)
    sideways = np.gradient(across, 1.0 / FRAME_RATE, axis=0)
    columns = (frames.position, frames.lateral, frames.speed, across, frames.acceleration, sideways)
    tracks = Tracks(vehicle, frame + 1, *(column[frame, vehicle] for column in columns))
    plan = RecordingPlan(
        id=number + 1,
        section=Section(1, scenario.n_lanes, LANE_WIDTH, top=8.5, median=4.0, speed_limit=None),
        duration=scenario.duration,
        n_vehicles=float(scenario.n_vehicles),
        truck_share=float(fleet.is_truck.mean()),
        upper_share=0.0,
        congestion=None,
        month="01.2000",
        week_day="Sat",
        start_time="00:00",
    )
    direction = np.full(len(fleet.length), LOWER)
    sizes = Sizes(fleet.is_truck, fleet.length, fleet.width)
    write_recording(folder, number + 1, highd_tables(plan, tracks, sizes, direction, view))


def _unbroken(inside: np.ndarray) -> np.ndarray:
    """Every vehicle's frames from the first inside to the last, so that noise at an edge causes no interruptions."""
    after_first = np.logical_or.accumulate(inside, axis=0)
    before_last = np.logical_or.accumulate(inside[::-1], axis=0)[::-1]
    return after_first & before_last
