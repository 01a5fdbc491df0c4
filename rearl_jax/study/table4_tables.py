"""Inference times as one long table, as flat figures, and as people read them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.config import StudyTable4Task
from rearl_jax.document.document import Section
from rearl_jax.document.table import NONE, Cell, Emphasis, Row, Table
from rearl_jax.study.document import long_table
from rearl_jax.timing.decision_steps import BASE, DECISION, DETECTION, LOOP, PAPER_MS, PPO
from rearl_jax.timing.measurement import Spread, spread_of

MODEL = "llm"
"""Row of the steps with a language model."""

TITLES = {
    BASE: "IDM+MOBIL",
    PPO: "PPO",
    DETECTION: "REARL, detection alone",
    DECISION: "REARL, matcher alone",
    LOOP: "REARL, whole loop with matcher",
    MODEL: "REARL, whole loop with language model",
}
"""Rows of the table in their order, and what people read for them."""

PAPER = {BASE: "idm_mobil", PPO: "ppo", MODEL: "rearl"}
"""The paper's figure a row stands beside; its REARL asks a language model, so the matcher's rows stand beside none."""


@dataclass(frozen=True)
class Timing:
    """Consecutive decision steps of one program, one batch at a time.

    Attributes:
        program: One of `TITLES`.
        batch: Scenarios at a time.
        ms: Elapsed time of all steps of the whole batch [ms].
        compile_s: Elapsed time of compiling [s]; None where it is not measured.
        n_repetitions: Measurements.
        note: What else must be known.
    """

    program: str
    batch: int
    ms: Spread
    compile_s: float | None
    n_repetitions: int
    note: str = ""

    @property
    def title(self) -> str:
        """What people read."""
        return TITLES[self.program]

    @property
    def paper_ms(self) -> float | None:
        """The paper's figure [ms]; it has none for batches."""
        return PAPER_MS[PAPER[self.program]] if self.batch == 1 and self.program in PAPER else None


def timings_of(steps: pd.DataFrame, with_model: pd.DataFrame | None) -> list[Timing]:
    """The timings in the order of the table.

    Args:
        steps: One row per measurement: `program`, `batch`, `wall_s` [s], `compile_s` [s].
        with_model: Measurements with a language model; None without.
    """
    found = []
    programs, batches = steps["program"].to_numpy(str), steps["batch"].to_numpy(int)
    for program, batch in dict.fromkeys(zip(programs.tolist(), batches.tolist(), strict=True)):
        own = (programs == program) & (batches == batch)
        compile_s = float(steps["compile_s"].to_numpy(float)[own][0])
        found.append(Timing(program, batch, _spread_ms(steps, own), compile_s, int(own.sum())))
    if with_model is not None:
        batches = with_model["batch"].to_numpy(int)
        for batch in dict.fromkeys(batches.tolist()):
            own = batches == batch
            asked, sent, answered = (
                int(with_model[name].to_numpy(int)[own].sum()) for name in ("n_questions", "n_sent", "n_answered")
            )
            note = f"{with_model['model'].to_numpy(str)[own][0]}: {asked} questions, {sent} sent, {answered} answered"
            found.append(Timing(MODEL, batch, _spread_ms(with_model, own), None, int(own.sum()), note))
    order = list(TITLES)
    return sorted(found, key=lambda timing: (order.index(timing.program), timing.batch))


def _spread_ms(measured: pd.DataFrame, own: np.ndarray) -> Spread:
    """Elapsed time of the measurements of one program and batch [ms]."""
    return spread_of((1e3 * measured["wall_s"].to_numpy(float)[own]).tolist())


def sections(config: StudyTable4Task, table: pd.DataFrame, summary: Mapping[str, Any]) -> tuple[Section, ...]:
    """Every program beside the paper's figure."""
    headings = ("batch", "ms", "least", "greatest", "ms per scenario", "compile s", "paper ms")
    rows = []
    for record in table.astype(object).to_dict("records"):
        values = (
            *(f"{record[name]:#.4g}" for name in ("ours", "low", "high")),
            f"{record['ours'] / record['batch']:#.3g}",
        )
        compile_s = NONE if pd.isna(record["compile_s"]) else f"{record['compile_s']:.1f}"
        cells = (f"{record['batch']:,}", *values, compile_s, _paper(record["paper"]))
        rows.append(Row(record["title"], tuple(map(Cell, cells))))
    if MODEL not in set(table["row"]):
        cells = (*(NONE for _ in headings[1:]), _paper(PAPER_MS["rearl"]))
        rows.append(Row("paper: REARL (language model)", tuple(map(Cell, cells)), Emphasis.subdued))
    title = f"Table 4: {summary['n_steps']} consecutive decision steps of {config.loop.steps_vehicles} vehicles"
    times = Table(f"{title}, elapsed time of the whole batch", headings, tuple(rows))
    return (Section("Inference time", tables=(times,)),)


def _paper(value: float | None) -> str:
    return NONE if value is None or pd.isna(value) else f"{value:,}"


def conclusions(timings: list[Timing], n_steps: int) -> list[str]:
    """What the times say, computed from them; no ratio is taken to the paper's."""
    said = []
    ms = {(timing.program, timing.batch): timing.ms.median for timing in timings}
    for batch in sorted({batch for program, batch in ms if program == BASE}):
        base = ms[BASE, batch]
        times = ", ".join(
            f"{TITLES[program]} {ms[program, batch] / base:.2f}" for program in (PPO, LOOP) if (program, batch) in ms
        )
        parts = " and ".join(
            f"{TITLES[program]} {100 * ms[program, batch] / base:.0f} %"
            for program in (DETECTION, DECISION)
            if (program, batch) in ms
        )
        said.append(f"Batch {batch}: times IDM+MOBIL: {times}; of its time: {parts}.")
    for timing in timings:
        if timing.program == MODEL:
            said.append(
                f"Language model ({timing.note}), batch {timing.batch}: {timing.ms.median / n_steps:,.0f} ms per "
                "decision step, waiting for the server included."
            )
    said.append(
        f"The paper orders IDM+MOBIL < PPO < REARL: {PAPER_MS['idm_mobil']:g} < {PAPER_MS['ppo']:g} < "
        f"{PAPER_MS['rearl']:,g} ms."
    )
    return said


def long_timings(timings: list[Timing]) -> pd.DataFrame:
    """`row`, `title`, `batch`, `metric` (steps_ms), `ours`, `low` and `high` (least and greatest), `paper`,
    `compile_s`, `n_repetitions`, `note`.
    """
    records = [
        {
            "row": timing.program,
            "title": timing.title,
            "batch": timing.batch,
            "metric": "steps_ms",
            "ours": timing.ms.median,
            "low": timing.ms.least,
            "high": timing.ms.greatest,
            "paper": timing.paper_ms,
            "compile_s": timing.compile_s,
            "n_repetitions": timing.n_repetitions,
            "note": timing.note,
        }
        for timing in timings
    ]
    return long_table(records).astype({"compile_s": "Float64"})


def summary_of(timings: list[Timing], n_steps: int) -> dict[str, Any]:
    """Flat figures: `n_steps`; per program and batch (`_loop_b256`) `steps_ms` with `_min`, `_max`, and `compile_s`;
    `paper_ms_METHOD`.
    """
    figures: dict[str, Any] = {"n_steps": n_steps}
    for timing in timings:
        key = f"{timing.program}_b{timing.batch}"
        figures[f"steps_ms_{key}"] = timing.ms.median
        figures |= {f"steps_ms_{key}_min": timing.ms.least, f"steps_ms_{key}_max": timing.ms.greatest}
        figures[f"compile_s_{key}"] = timing.compile_s
    return figures | {f"paper_ms_{name}": value for name, value in PAPER_MS.items()}
