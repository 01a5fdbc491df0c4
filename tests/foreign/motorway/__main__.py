"""`python -m tests.foreign.motorway FOLDER --effect NAME --seed N` writes one recording and its truth."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from .effects import EFFECTS
from .models import MODELS
from .record import implausible, make, write


def main() -> None:
    """Read the command line, make the recording, print what was done."""
    effects = "; ".join(f"{name}: {kind.says}" for name, kind in EFFECTS.items())
    parser = argparse.ArgumentParser(prog="tests.foreign.motorway", description=__doc__, epilog=effects)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--effect", choices=list(EFFECTS), default="none")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--model", choices=list(MODELS), help="car-following model; drawn by the seed if left out")
    parser.add_argument("--duration", type=float, help="observed time [s], drawn from 240 to 600 s")
    parser.add_argument("--length", type=float, help="observed road [m], drawn from 800 to 1500 m")
    parser.add_argument("--warm-up", type=float, help="simulated time before [s], drawn from 360 to 480 s")
    args = parser.parse_args()
    begun = time.perf_counter()
    table, answer = make(args.effect, args.seed, args.model, args.duration, args.length, args.warm_up)
    data, beside = write(args.folder, table, answer)
    chain = answer["measurement"]
    print(f"{data}: seed {args.seed}, effect {answer['effect']} ({answer['says']}), model {answer['model']}")
    print(
        f"{answer['road_length']:.0f} m, {answer['duration']:.0f} s at {answer['fps']} Hz, {chain['cameras']} cameras, "
        f"smoothing: {chain['release']}, speeds: {chain['speeds']}; truth: {beside}"
    )
    figures = answer["summary"]
    print(
        f"flow {figures['flow_per_lane_per_hour']} vehicles/h/lane, mean speed {figures['mean_speed']} m/s, "
        f"{figures['share_below_5']:.0%} of time below 5 m/s, {figures['lane_changes']} lane changes "
        f"({figures['lane_changes_per_km_hour']} per km and hour), "
        f"density {figures['density_per_lane_per_km']} /km/lane, "
        f"median headway {figures['median_headway']} s, least gap {figures['least_gap']} m, "
        f"emergency braking {figures['share_of_emergency_braking']:.2%}, {figures['tracks']} tracks, "
        f"{figures['rows']} rows, {time.perf_counter() - begun:.0f} s"
    )
    for line in implausible(figures):
        print(f"implausible: {line}")


if __name__ == "__main__":
    main()
