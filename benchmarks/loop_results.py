"""Cost of the closed loop compared with Base (IDM and MOBIL alone), as a table and as flat figures."""

import json
from dataclasses import asdict, dataclass
from statistics import median

import pandas as pd

from benchmarks.loop_programs import NEVER, always, quiet
from benchmarks.options import LoopPolicy
from rearl_jax.timing.decision_steps import BASE, PAPER_MS
from rearl_jax.timing.measurement import Series, Spread, spread_of

GOAL = 0.25
"""Largest cost of the detection that is accepted, as a share of the cost of Base [-]."""

MEANINGS = {
    "references": "references that the traffic was compared with: synthetic ones, no data were read",
    "cpu_us_{program}_n{N}_b{B}": "CPU time per simulated second of a scenario, median of repetitions [us]",
    "detection_share_n{N}_b{B}": "(never - base) / base: what detection adds, of Base's CPU time; also _min, _max",
    "policy_share_{policy}_n{N}_b{B}": "({policy}_quiet - never) / base: what admissible actions, policy and orders"
    " add on the same traffic; also _min, _max",
    "loop_ratio_{policy}_n{N}_b{B}": "loop triggered every second (other traffic) divided by base; also _min, _max",
    "compile_s_{program}_n{N}_b{B}": "elapsed time of compiling, without cache [s]",
    "effect_ratio_{effect}_n{N}_b{B}": "CPU time of Base with this effect divided by that of Base;"
    " following: gap IDM without effects; two_effects, rank_two_effects: two effects, alone and in the closed loop;"
    " also _min, _max",
    "effect_ns_{effect}_n{N}_b{B}": "CPU time per vehicle step with this effect, median [ns]",
    "effect_compile_s_{effect}_n{N}_b{B}": "elapsed time of compiling, without cache [s]",
    "detection_share_goal": "upper limit of detection_share",
    "detection_share_largest": "largest detection_share of all numbers of vehicles and batches",
    "n_steps": "consecutive decision steps behind steps_ms",
    "steps_ms_{part}_n{N}_b{B}": "elapsed time of these steps, median [ms]: base, ppo, loop, and on recorded traffic"
    " detection alone and decision alone (admissible actions, policy, orders); also _min, _max",
    "steps_cpu_ms_{part}_n{N}_b{B}": "the same in CPU time [ms]",
    "steps_compile_s_{part}_n{N}_b{B}": "elapsed time of compiling them, without cache [s]",
    "paper_ms_{method}": "REARL (Bi et al.), inference time of 10 decisions [ms]; per step or for all ten is ambiguous",
    "load_average": "processes that wanted to run when the measurements began",
}
"""Keys of `summary.json` besides the machine's (`cpu_model` and so on), and what they mean."""


@dataclass(frozen=True)
class Cell:
    """All programs at one number of vehicles and one size of batch, each measured equally often."""

    n_vehicles: int
    batch: int
    series: dict[str, Series]

    @property
    def label(self) -> str:
        """End of the keys of the cell's figures in the summary."""
        return f"n{self.n_vehicles}_b{self.batch}"

    def costs(self, program: str) -> list[float]:
        """CPU time per simulated second of a scenario in each repetition [s]."""
        return [run.cpu_s / (run.n_scenarios * run.seconds) for run in self.series[program].measurements]

    def cost(self, program: str) -> float:
        """Median of `costs` [s]."""
        return median(self.costs(program))

    def ratio(self, program: str) -> Spread:
        """Cost of a program divided by that of Base within each repetition."""
        return spread_of([cost / base for cost, base in zip(self.costs(program), self.costs(BASE), strict=True)])

    def added(self, program: str, without: str) -> Spread:
        """Cost of a program less that of the program `without`, divided by that of Base, within each repetition."""
        triples = zip(self.costs(program), self.costs(without), self.costs(BASE), strict=True)
        return spread_of([(cost - cost_without) / base for cost, cost_without, base in triples])

    def step_ns(self, program: str) -> float:
        """CPU time per vehicle step, median [ns]."""
        return 1e9 / self.series[program].substeps_per_cpu_s

    @property
    def detection(self) -> Spread:
        """Cost of the detection divided by that of Base."""
        return self.added(NEVER, BASE)

    def policy(self, policy: LoopPolicy) -> Spread:
        """Cost that a policy adds to the detection, on the traffic of Base, divided by the cost of Base."""
        return self.added(quiet(policy), NEVER)

    def steps_ms(self, part: str) -> Spread:
        """Elapsed time of one call [ms]."""
        return spread_of([1e3 * run.wall_s for run in self.series[part].measurements])


@dataclass(frozen=True)
class LoopResults:
    """Cells of rollouts, of decision steps, and of single effects with Base; and the conditions of the measurement."""

    cells: tuple[Cell, ...]
    steps: tuple[Cell, ...]
    effects: tuple[Cell, ...]
    policies: tuple[LoopPolicy, ...]
    n_steps: int
    references: str
    load_average: float | None
    machine: dict[str, str | int | float]

    @property
    def largest_detection_share(self) -> float | None:
        """Largest of the medians of `Cell.detection`; None if no rollouts were measured."""
        return max((cell.detection.median for cell in self.cells), default=None)

    def table(self) -> pd.DataFrame:
        """One row per program, cell and repetition; `measured` is rollout, steps or effect."""
        rows = [
            {
                "measured": measured,
                "program": name,
                "n_vehicles": cell.n_vehicles,
                "batch": cell.batch,
                "repetition": repetition,
                **asdict(run),
                "cpu_us": 1e6 * cell.costs(name)[repetition],
                "compile_s": item.facts["compile_s"],
                "asked_share": item.facts["asked_share"],
            }
            for measured, cells in (("rollout", self.cells), ("steps", self.steps), ("effect", self.effects))
            for cell in cells
            for name, item in cell.series.items()
            for repetition, run in enumerate(item.measurements)
        ]
        counts = ("lane_changes", "crashed", "peak_memory_bytes")
        return pd.DataFrame(rows).astype(dict.fromkeys(counts, "Int64")).drop(columns="peak_memory_bytes")

    def metadata(self) -> dict[str, str]:
        """Metadata of the table."""
        return {"machine": json.dumps(self.machine), "references": self.references}

    def summary(self) -> dict:
        """Flat figures; `MEANINGS` says what they are."""
        figures: dict = {**self.machine, "load_average": self.load_average, "references": self.references}
        figures["detection_share_goal"] = GOAL
        figures["detection_share_largest"] = self.largest_detection_share
        for cell in self.cells:
            figures |= cell.detection.figures(f"detection_share_{cell.label}")
            for policy in self.policies:
                figures |= cell.policy(policy).figures(f"policy_share_{policy.name}_{cell.label}")
            for policy in self.policies:
                figures |= cell.ratio(always(policy)).figures(f"loop_ratio_{policy.name}_{cell.label}")
            for name, item in cell.series.items():
                figures[f"cpu_us_{name}_{cell.label}"] = 1e6 * cell.cost(name)
                figures[f"compile_s_{name}_{cell.label}"] = item.facts["compile_s"]
        for cell in self.effects:
            program = effect_of(cell)
            figures |= cell.ratio(program).figures(f"effect_ratio_{program}_{cell.label}")
            figures[f"effect_ns_{program}_{cell.label}"] = cell.step_ns(program)
            figures[f"effect_compile_s_{program}_{cell.label}"] = cell.series[program].facts["compile_s"]
        return figures | self._steps_summary()

    def _steps_summary(self) -> dict[str, float | int]:
        if not self.steps:
            return {}
        figures: dict[str, float | int] = {"n_steps": self.n_steps}
        for cell in self.steps:
            for part, item in cell.series.items():
                figures |= cell.steps_ms(part).figures(f"steps_ms_{part}_{cell.label}")
                cpu_ms = median(1e3 * run.cpu_s for run in item.measurements)
                figures[f"steps_cpu_ms_{part}_{cell.label}"] = cpu_ms
                figures[f"steps_compile_s_{part}_{cell.label}"] = item.facts["compile_s"]
        return figures | {f"paper_ms_{method}": value for method, value in PAPER_MS.items()}


def effect_of(cell: Cell) -> str:
    """Name of the program that was measured in turn with Base."""
    (program,) = (name for name in cell.series if name != BASE)
    return program
