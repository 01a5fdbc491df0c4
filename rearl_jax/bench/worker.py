"""The process of one measured program: `python -m rearl_jax.bench.worker SPECIFICATION`.

In: a JSON object as argument (`program`, and what its class takes), then one JSON object per line on standard
input (`n_scenarios`, `seed`). Out: one JSON object per line, first the facts of the program, then a
`Measurement` each. Ends with its input.
"""

import dataclasses
import json
import os
import sys
from typing import Any

from rearl_jax.bench.measurement import Simulator


def make_simulator(program: str, **arguments: Any) -> Simulator:
    """The program of that name; only its own libraries are imported.

    Raises:
        ValueError: There is no such program.
    """
    if program == "rearl_jax":
        from rearl_jax import runtime

        runtime.start(x64=False, cpu_devices=arguments.pop("threads", None))
        from rearl_jax.bench.rollouts import Rollouts

        return Rollouts(**arguments)
    if program in ("rollouts", "decision_steps"):
        from rearl_jax import runtime

        runtime.start(x64=False, cpu_devices=1)
        from rearl_jax.bench import loop_subjects

        return getattr(loop_subjects, program)(**arguments)
    if program == "effect_rollouts":
        from rearl_jax import runtime

        runtime.start(x64=False, cpu_devices=1)
        from rearl_jax.bench.effect_subjects import effect_rollouts

        return effect_rollouts(**arguments)
    if program == "highway_env":
        from rearl_jax.bench.highway import HighwayRoads

        return HighwayRoads(**arguments)
    if program == "libsumo":
        from rearl_jax.bench.sumo import SumoRoads

        return SumoRoads(**arguments)
    if program == "highjax":
        from rearl_jax import runtime

        runtime.start(x64=False, cpu_devices=1)
        from rearl_jax.bench.highjax import HighJaxRoads

        return HighJaxRoads(**arguments)
    known = "rearl_jax, rollouts, decision_steps, effect_rollouts, highway_env, libsumo or highjax"
    raise ValueError(f"there is no program {program!r} to measure: {known}")


def main() -> None:
    """Serves measurements until the input ends."""
    # Libraries greet and warn on standard output; what they write there must not mix with the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    simulator = make_simulator(**json.loads(sys.argv[1]))
    print(json.dumps(dict(simulator.facts)), file=answers, flush=True)
    for line in sys.stdin:
        measurement = simulator.measure(**json.loads(line))
        print(json.dumps(dataclasses.asdict(measurement)), file=answers, flush=True)


if __name__ == "__main__":
    main()
