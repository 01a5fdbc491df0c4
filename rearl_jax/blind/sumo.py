"""SUMO as a second source of traffic: another simulator, other car-following models, and rules that discovery does not
know.

Drivers and platoon leaders are drawn as by the generator of this package; followers are driven by SUMO. The simulation
runs in a separate process, because libsumo allows one simulation per process.

Sources: Lopez et al., Microscopic Traffic Simulation using SUMO, IEEE ITSC 2018; names of models and attributes as in
SUMO's documentation of vehicle types.
"""

import json
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from rearl_jax.blind.traffic.dataset import write_tables
from rearl_jax.blind.traffic.fleet import Fleet, draw_fleet
from rearl_jax.blind.traffic.measurement import LANE_WIDTH, measure
from rearl_jax.blind.traffic.platoon_leaders import draw_profiles
from rearl_jax.blind.traffic.scenario import SUB_STEP, Scenario
from rearl_jax.blind.traffic.simulation import COOL_DOWN, WARM_UP, Events, common_section, place_platoons
from rearl_jax.blind.traffic.snapshot import Snapshot

STEP = 0.1
"""Time step of the simulation and frame interval [s]."""

LIMIT = 22.0
"""Speed limit of the limited section [m/s]."""

LIMITED = (900.0, 1250.0)
"""Start and end of the limited section [m]."""

TRUTHS: dict[str, dict[str, Any]] = {
    "idm": {"kind": "control", "truths": []},
    # SUMO forbids passing on the right above 60 km/h, so faster drivers adapt to the vehicle ahead on the left lane.
    "idm_no_passing_right": {"kind": "listed", "truths": ["no_undertaking"]},
    "idm_limit": {
        "kind": "listed",
        "truths": ["speed_limit", "bend", "grade"],
        "parameters": {"limit": LIMIT, "start": LIMITED[0], "end": LIMITED[1]},
    },
    # Decisions every 0.8 s are not a reaction delay, but a delay is the most similar effect.
    "idm_action_steps": {"kind": "unlisted", "truths": ["reaction_delay", "action_points"]},
    "eidm": {"kind": "unlisted", "truths": []},
    "krauss": {"kind": "unlisted", "truths": []},
    "acc": {"kind": "unlisted", "truths": []},
    "cacc": {"kind": "unlisted", "truths": []},
}
"""Correct answers for each variant."""

MODELS = {"idm": "IDM", "eidm": "EIDM", "krauss": "Krauss", "acc": "ACC", "cacc": "CACC"}
"""SUMO's names of its models."""

EFFECTS = {"speed_limit": "idm_limit", "no_undertaking": "idm_no_passing_right"}
"""Effects of the library that SUMO has itself, and the variant with the correct answers."""


@dataclass(frozen=True)
class Rules:
    """Rules of a SUMO simulation, in addition to drivers and traffic.

    Attributes:
        model: SUMO's name of the car-following model.
        action_step: Time between two decisions [s].
        overtake_right: 1 if passing on the right is allowed, 0 if not.
        limit: Speed limit of the limited section [m/s]; None if there is none.
        section: Start and end of the limited section [m].
    """

    model: str = "IDM"
    action_step: float = STEP
    overtake_right: int = 1
    limit: float | None = None
    section: tuple[float, float] = LIMITED


def rules_of(variant: str) -> Rules:
    """The rules of one of TRUTHS."""
    return Rules(
        MODELS.get(variant, "IDM"),
        action_step=0.8 if variant == "idm_action_steps" else STEP,
        overtake_right=0 if variant == "idm_no_passing_right" else 1,
        limit=LIMIT if variant == "idm_limit" else None,
    )


def sumo_truth(variant: str) -> dict[str, Any]:
    """The truth of a variant, in the same form as for the generator."""
    effect = {"name": f"sumo_{variant}", "strength": 1.0, "variables": [], "parameters": {}} | TRUTHS[variant]
    return {"planted": [] if effect["kind"] == "control" else [effect], "n_lane_changes": 0, "n_emergencies": 0}


def check_sumo() -> None:
    """Raise ModuleNotFoundError with the remedy if libsumo is missing."""
    if find_spec("libsumo") is None:
        raise ModuleNotFoundError(
            "libsumo is not installed, which this study's second source needs: install the extra with "
            'pip install "rearl-jax[bench]", or set blind.sumo=false'
        )


def write_sumo_dataset(folder: Path, scenario: Scenario, variant: str) -> None:
    """Writes one canonical table per recording.

    Args:
        folder: Folder of the tables.
        scenario: Drivers, platoon leaders and noise; without hidden effects.
        variant: One of TRUTHS.

    Raises:
        ModuleNotFoundError: libsumo is not installed.
        RuntimeError: SUMO failed; the message contains its output.
    """
    events, _ = simulate_sumo(scenario, rules_of(variant))
    write_tables(folder, scenario, events, measure(scenario, events))


def simulate_sumo(scenario: Scenario, rules: Rules, *, is_moved: bool = False) -> tuple[Events, Rules]:
    """The traffic of all recordings, and the rules in force.

    Args:
        scenario: Drivers and platoon leaders.
        rules: Model and rules.
        is_moved: Put the limited section where most vehicles pass, and scale the limit with the desired speeds.

    Raises:
        ModuleNotFoundError, RuntimeError: As in `write_sumo_dataset`.
    """
    check_sumo()
    streams = np.random.default_rng([scenario.seed, 8]).spawn(3)
    seconds = WARM_UP + scenario.duration + COOL_DOWN
    fleet = draw_fleet(scenario, streams[0])
    profiles = draw_profiles(scenario.n_recordings * scenario.n_lanes, seconds, scenario.pace, streams[1])
    position, speed, travelled = place_platoons(scenario, fleet, profiles)
    if is_moved and rules.limit is not None:
        now = Snapshot(scenario, fleet, position, speed)
        section = common_section(scenario, now, travelled, np.flatnonzero(fleet.rank == 0), streams[2])
        rules = replace(rules, section=section, limit=rules.limit * now.speed_scale)
    parts = [
        _run(_job_of(scenario, fleet, position, speed, profiles, rules, number))
        for number in range(scenario.n_recordings)
    ]
    motion = {name: np.concatenate([part[name] for part in parts], axis=1) for name in parts[0]}
    return _events(fleet, motion, rules), rules


def _job_of(
    scenario: Scenario,
    fleet: Fleet,
    position: np.ndarray,
    speed: np.ndarray,
    profiles: np.ndarray,
    rules: Rules,
    number: int,
) -> dict[str, Any]:
    """Parameters of the simulation of one recording as plain values, which `sumo_worker` reads."""
    members = np.flatnonzero(fleet.recording == number)
    stride = round(STEP / SUB_STEP)
    leader_speeds = profiles[number * scenario.n_lanes : (number + 1) * scenario.n_lanes, ::stride]
    names = ("desired_speed", "time_gap", "jam_gap", "max_accel", "comfort_decel", "length", "width")
    return (
        asdict(rules)
        | {
            "step": STEP,
            "n_lanes": scenario.n_lanes,
            "lane_width": LANE_WIDTH,
            "seed": int(scenario.seed % 2**31),
            "position": position[members].tolist(),
            "speed": speed[members].tolist(),
            "lane": fleet.lane[members].tolist(),
            "rank": fleet.rank[members].tolist(),
            "platoon_leader_speeds": leader_speeds.tolist(),
        }
        | {name: getattr(fleet, name)[members].tolist() for name in names}
    )


def _run(job: dict[str, Any]) -> dict[str, np.ndarray]:
    """Positions, speeds, accelerations and lanes, `[steps, vehicles]`."""
    with tempfile.TemporaryDirectory(prefix="rearl_blind_sumo_") as name:
        job_file, events_file = Path(name) / "job.json", Path(name) / "events.npz"
        job_file.write_text(json.dumps(job), encoding="utf-8")
        command = [sys.executable, "-m", "rearl_jax.blind.sumo_worker", str(job_file), str(events_file)]
        finished = subprocess.run(command, capture_output=True, text=True, check=False)
        if finished.returncode != 0:
            raise RuntimeError(f"SUMO failed on {job['model']}: {finished.stderr.strip()[-2000:]}")
        with np.load(events_file) as motion:
            return dict(motion)


def _events(fleet: Fleet, motion: dict[str, np.ndarray], rules: Rules) -> Events:
    """The simulated motion in the form of the generator's events."""
    n_steps, n = motion["position"].shape
    return Events(
        time=STEP * np.arange(n_steps) - WARM_UP,
        position=motion["position"],
        speed=motion["speed"],
        acceleration=motion["acceleration"],
        wander=np.zeros((n_steps, n)),
        lane=motion["lane"].astype(np.int8),
        leader=np.zeros((0, n), dtype=np.int32),
        fleet=fleet,
        effects=(),
        section=rules.section,
        n_emergencies=0,
    )
