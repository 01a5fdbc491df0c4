"""The task `rearl validate`: the core against highway-env, tick by tick.

Writes into the study folder `reference/` (runs of highway-env, kept for the next run), `scenes.parquet` (one row per
scene and precision, with the cause of every difference), `agreement.parquet` (per set, per size, overall),
`errors.parquet` (differences at every tick), `error_over_time.png`, `config.json` and `summary.json`.

The reference runs with the elementary functions of the C library, as XLA does on a CPU; see `workers`. That choice
favours neither side, because with NumPy's own functions highway-env differs from itself; the report shows by how much.
"""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version

import jax.numpy as jnp
import numpy as np
import pandas as pd
from rich.progress import Progress

from rearl_jax.config import ValidateTask
from rearl_jax.config.validation import ValidationConfig
from rearl_jax.document.terminal import print_document
from rearl_jax.machine import available_cores
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study
from rearl_jax.validation import causes, comparison, simulation, summary
from rearl_jax.validation.comparison import Comparison
from rearl_jax.validation.document import document_of
from rearl_jax.validation.figures import error_over_time
from rearl_jax.validation.records import Recorded, stack
from rearl_jax.validation.scenarios import SETS, TICKS_PER_SECOND, ScenarioSet
from rearl_jax.validation.store import REFERENCES, ReferenceStore
from rearl_jax.validation.workers import Job, Variant, vector_features

FACT_COLUMNS = {
    "cause": "str",
    "first_time": "float64",
    "first_vehicle": "Int64",
    "first_difference": "float64",
    "first_growth": "float64",
    "first_speed": "float64",
    "slowest": "float64",
}
"""Columns about the first difference of a scene and their types; empty if there is none."""


def run(config: ValidateTask) -> dict:
    """The figures, as written to summary.json; its keys are documented in `rearl_jax.validation.summary`.

    Raises:
        InvalidInputError: After everything is written, if the core does not agree or too few events occurred.
    """
    if jnp.result_type(float) != jnp.float64:
        raise ValueError("the comparison needs double precision: call rearl_jax.runtime.start(x64=True) first")
    options = config.validation
    study = Study(config.results.root, config.study, config, "validate")
    study.write_config(reusable=(REFERENCES,))
    reference = f"highway-env {version('highway-env')}"
    sets = [scenario_set for scenario_set in SETS if n_scenes(scenario_set, options)]
    with progress_bar() as progress:
        scenes, errors = _Validation(options, ReferenceStore(study), progress).run(sets)
    seeds = {"seed": str(options.seed), "reference": reference}
    groups = summary.groups(scenes)
    study.write_table("scenes", scenes, **seeds)
    study.write_table("agreement", groups, **seeds)
    study.write_table("errors", errors, **seeds)
    tolerances = {"float64": options.tolerance_f64, "float32": options.tolerance_f32}
    study.write_bytes("error_over_time.png", error_over_time(errors, tolerances))
    figures = summary.summarise(scenes, reference)
    study.write_summary(figures)
    print_document(document_of(groups, scenes, figures, options))
    if shortfalls := summary.shortfalls(figures, options):
        sentences = "; ".join(problem.fault for problem in shortfalls)
        raise InvalidInputError(Problem("validation-failed", sentences, shortfalls[0].remedy))
    return figures


def n_scenes(scenario_set: ScenarioSet, options: ValidationConfig) -> int:
    """Scenes of a set in this run."""
    return _part(getattr(options.scenes, scenario_set.name), options.share)


def _part(number: int, share: float) -> int:
    """A share of a number, rounded up; 7 % of 100 are 7, although 100 * 0.07 is a little more in floating point."""
    return math.ceil(round(number * share, 9))


@dataclass
class _Validation:
    """One run of the comparison."""

    options: ValidationConfig
    store: ReferenceStore
    progress: Progress

    def run(self, sets: Sequence[ScenarioSet]) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Rows per scene and precision, and differences at every tick."""
        self._collect([job for scenario_set in sets for job in self._jobs(scenario_set, Variant.plain)], "highway-env")
        if vector_features():
            controls = [job for scenario_set in sets for job in self._jobs(scenario_set, Variant.vectorised)]
            self._collect(controls, "highway-env, vectorised")
        work = self.progress.add_task("core", total=sum(n_scenes(scenario_set, self.options) for scenario_set in sets))
        rows, errors = [], []
        for scenario_set in sets:
            parts: dict[str, list[Comparison]] = {precision: [] for precision in summary.PRECISIONS}
            for jobs in self._batches(scenario_set):
                recorded = [self.store.load(job) for job in jobs]
                batch, model = stack(recorded), simulation.model_of(scenario_set)
                for precision, compared in parts.items():
                    tracks = simulation.simulate(recorded, model, np.dtype(precision).type)
                    compared.append(comparison.compare(batch.tracks, tracks))
                    rows += self._rows(scenario_set, jobs, batch, compared[-1], precision)
                rows += self._control(scenario_set, jobs, recorded)
                self.progress.advance(work, len(jobs))
            errors += [_errors(scenario_set, precision, compared) for precision, compared in parts.items()]
        scenes = pd.DataFrame(rows).astype({"first_contact": "float64", **FACT_COLUMNS})
        return self._with_own_differences(scenes, sets), pd.concat(errors, ignore_index=True)

    def _jobs(self, scenario_set: ScenarioSet, variant: Variant) -> list[Job]:
        n = n_scenes(scenario_set, self.options)
        if variant is Variant.vectorised:
            n = _part(n, self.options.control_share)
        options = self.options
        return [
            Job(scenario_set.scenario(index, seed=options.seed, n_seconds=options.seconds), variant)
            for index in range(n)
        ]

    def _batches(self, scenario_set: ScenarioSet) -> Iterator[list[Job]]:
        jobs, size = self._jobs(scenario_set, Variant.plain), simulation.batch_size(scenario_set.n_vehicles)
        for start in range(0, len(jobs), size):
            yield jobs[start : start + size]

    def _collect(self, jobs: Sequence[Job], title: str) -> None:
        """Runs scenes without a file in highway-env; long scenes first, so that no worker is left alone at the end."""
        longest_first = sorted(jobs, key=lambda job: -job.scenario.n_vehicles)
        work = self.progress.add_task(title, total=len(jobs), visible=bool(jobs))
        for _ in self.store.collect(longest_first, self.options.workers or available_cores()):
            self.progress.advance(work)

    def _control(self, scenario_set: ScenarioSet, jobs: Sequence[Job], recorded: Sequence[Recorded]) -> list[dict]:
        """Rows of the scenes of a batch that highway-env has run with and without vector functions."""
        n_control = len(self._jobs(scenario_set, Variant.vectorised)) if vector_features() else 0
        pairs = [
            (job, plain, self.store.load(dataclasses.replace(job, variant=Variant.vectorised)))
            for job, plain in zip(jobs, recorded, strict=True)
            if job.scenario.index < n_control
        ]
        if not pairs:
            return []
        control_jobs, plain, vectorised = zip(*pairs, strict=True)
        batch = stack(plain)
        compared = comparison.compare(batch.tracks, stack(vectorised).tracks)
        return self._rows(scenario_set, control_jobs, batch, compared, summary.CONTROL)

    def _rows(
        self, scenario_set: ScenarioSet, jobs: Sequence[Job], batch: Recorded, compared: Comparison, precision: str
    ) -> list[dict]:
        """Rows of scenes.parquet for one batch; `batch` are highway-env's runs."""
        before_contact = precision == "float32"
        tolerance = self.options.tolerance_f32 if before_contact else self.options.tolerance_f64
        bounds = {"tolerance": tolerance, "only_before_contact": before_contact}
        excepted, first_excepted = comparison.first_disagreement(compared, **bounds)
        # A float32 scene that differs after contact is no exception, but its cause is recorded.
        differs, first = comparison.first_disagreement(compared, tolerance=tolerance, only_before_contact=False)
        first = np.where(excepted, first_excepted, first)
        rows = []
        measured = comparison.rows(compared, batch.tracks, batch.start.is_meta)
        for number, (job, row) in enumerate(zip(jobs, measured, strict=True)):
            contact = int(compared.contact[number])
            scene = {
                "set": scenario_set.name,
                "size": scenario_set.size,
                "index": job.scenario.index,
                "scenario": job.scenario.identity(),
                "vehicles": scenario_set.n_vehicles,
                "precision": precision,
                "first_contact": contact / TICKS_PER_SECOND if contact < len(compared.position) else None,
                "agrees": not excepted[number],
            }
            facts = _facts(compared, batch, number, int(first[number]), tolerance) if differs[number] else {}
            rows.append(scene | row | dict.fromkeys(FACT_COLUMNS) | facts)
        return rows

    def _with_own_differences(self, scenes: pd.DataFrame, sets: Sequence[ScenarioSet]) -> pd.DataFrame:
        """The rows with the column `own_difference`: largest difference between runs of highway-env that differ by
        one unit in the last place at the start [m].

        Measured for the scenes that disagree in float64; empty for all others.
        """
        by_name = {scenario_set.name: scenario_set for scenario_set in sets}
        excepted = summary.rows_with(scenes, precision="float64", agrees=False)
        jobs = {}
        for name, index in zip(excepted["set"], excepted["index"], strict=True):
            scenario = by_name[name].scenario(int(index), seed=self.options.seed, n_seconds=self.options.seconds)
            jobs[scenario.identity()] = Job(scenario, Variant.nudged)
        self._collect(list(jobs.values()), "highway-env, nudged")
        own_differences = {}
        for identity, job in jobs.items():
            plain = self.store.load(dataclasses.replace(job, variant=Variant.plain)).tracks
            nudged = self.store.load(job).tracks
            own_differences[identity] = float(max(np.abs(plain.x - nudged.x).max(), np.abs(plain.y - nudged.y).max()))
        return scenes.assign(own_difference=[own_differences.get(identity, np.nan) for identity in scenes["scenario"]])


def _facts(compared: Comparison, batch: Recorded, number: int, tick: int, tolerance: float) -> dict:
    facts = causes.measure(compared, batch, number, tick, tolerance)
    return {
        "cause": causes.name_cause(facts).value,
        "first_time": facts.tick / TICKS_PER_SECOND,
        "first_vehicle": facts.vehicle,
        "first_difference": facts.difference,
        "first_growth": facts.growth,
        "first_speed": facts.speed,
        "slowest": facts.slowest,
    }


def _errors(scenario_set: ScenarioSet, precision: str, batches: Sequence[Comparison]) -> pd.DataFrame:
    """Quantiles over scenes of the difference of position at every tick, of all and of those before their first
    contact.
    """
    position = np.concatenate([compared.errors["position"] for compared in batches], axis=1)
    before = np.concatenate([compared.before_contact for compared in batches], axis=1)
    tables = []
    for scope, kept in (("all", np.ones_like(before)), ("before_contact", before)):
        ticks = np.flatnonzero(kept.any(1))
        values = [position[tick, kept[tick]] for tick in ticks]
        columns = {
            "set": scenario_set.name,
            "size": scenario_set.size,
            "precision": precision,
            "scope": scope,
            "tick": ticks,
            "time": ticks / TICKS_PER_SECOND,
            "scenes": kept.sum(1)[ticks],
        }
        for name, level in (("median", 0.5), ("q90", 0.9), ("q99", 0.99), ("largest", 1.0)):
            columns[name] = np.array([np.quantile(row, level) for row in values])
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)
