"""Inference times as one long table, as flat figures, and as tables of the document."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pandas as pd

from rearl_jax.config import StudyTable4Task
from rearl_jax.document.document import Section
from rearl_jax.document.table import NONE, Cell, Emphasis, Row, table_of
from rearl_jax.study.document import long_table
from rearl_jax.timing.decision_steps import BASE, DECISION, DETECTION, LOOP, PAPER_MS, PPO
from rearl_jax.timing.measurement import spread_of

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
"""Rows of the table in their order, and their titles."""

PAPER = {BASE: "idm_mobil", PPO: "ppo", MODEL: "rearl"}
"""Key in `PAPER_MS` of the paper's figure that corresponds to a row. The paper's REARL queries a language model, so the
matcher's rows have no counterpart.
"""


def long_timings(steps: pd.DataFrame, with_model: pd.DataFrame | None) -> pd.DataFrame:
    """One row per program and batch, in the order of the table.

    Columns: `row` (the program), `title`, `batch` (scenarios at a time), `metric` (steps_ms), `ours` (median time of
    all steps of the whole batch [ms]), `low` and `high` (least and greatest), `paper` (of one scenario at a time),
    `compile_s` (missing if it is not measured), `n_repetitions`, `note`.

    Args:
        steps: One row per measurement: `program`, `batch`, `wall_s` [s], `compile_s` [s].
        with_model: Measurements with a language model; None without.
    """
    records = [_record(runs["program"].iloc[0], runs) for _, runs in steps.groupby(["program", "batch"], sort=False)]
    for _, runs in () if with_model is None else with_model.groupby("batch", sort=False):
        asked, sent, answered = (runs[name].sum() for name in ("n_questions", "n_sent", "n_answered"))
        note = f"{runs['model'].iloc[0]}: {asked} questions, {sent} sent, {answered} answered"
        records.append(_record(MODEL, runs) | {"note": note})
    order = list(TITLES)
    records.sort(key=lambda record: (order.index(record["row"]), record["batch"]))
    return long_table(records).astype({"compile_s": "Float64"})


def _record(program: str, runs: pd.DataFrame) -> dict[str, Any]:
    batch = int(runs["batch"].iloc[0])
    ms = spread_of((1e3 * runs["wall_s"].to_numpy(float)).tolist())
    return {
        "row": program,
        "title": TITLES[program],
        "batch": batch,
        "metric": "steps_ms",
        "ours": ms.median,
        "low": ms.least,
        "high": ms.greatest,
        "paper": PAPER_MS[PAPER[program]] if batch == 1 and program in PAPER else None,
        "compile_s": float(runs["compile_s"].iloc[0]) if "compile_s" in runs else None,
        "n_repetitions": len(runs),
        "note": "",
    }


def sections(config: StudyTable4Task, table: pd.DataFrame, summary: Mapping[str, Any]) -> tuple[Section, ...]:
    """Section of every program with the paper's figure."""
    columns = {"title": "", "batch": "batch", "ours": "ms", "low": "least", "high": "greatest"}
    columns |= {"each": "ms per scenario", "compile_s": "compile s", "paper": "paper ms"}
    title = f"Table 4: {summary['n_steps']} consecutive decision steps of {config.loop.steps_vehicles} vehicles"
    published = [NONE if pd.isna(value) else f"{value:,}" for value in table["paper"]]  # with all digits
    shown = table.assign(each=table["ours"] / table["batch"], paper=published)
    times = table_of(f"{title}, elapsed time of the whole batch", shown, columns)
    if MODEL not in set(table["row"]):
        cells = (*(Cell(NONE) for _ in times.headings[1:]), Cell(f"{PAPER_MS['rearl']:,}"))
        times = replace(times, rows=(*times.rows, Row("paper: REARL (language model)", cells, Emphasis.subdued)))
    return (Section("Inference time", tables=(times,)),)


def conclusions(table: pd.DataFrame, n_steps: int) -> list[str]:
    """Sentences about the times, computed from them; none compares them with the paper's by a ratio."""
    sentences = []
    ms = {(row, batch): ours for row, batch, ours in zip(table["row"], table["batch"], table["ours"], strict=True)}
    for batch in sorted({batch for program, batch in ms if program == BASE}):
        ratio = {program: ms[program, batch] / ms[BASE, batch] for program in TITLES if (program, batch) in ms}
        times = ", ".join(f"{TITLES[program]} {ratio[program]:.2f}" for program in (PPO, LOOP) if program in ratio)
        parts = (f"{TITLES[name]} {100 * ratio[name]:.0f} %" for name in (DETECTION, DECISION) if name in ratio)
        sentences.append(f"Batch {batch}: times IDM+MOBIL: {times}; of its time: {' and '.join(parts)}.")
    for timing in table.loc[table["row"] == MODEL].to_dict("records"):
        sentences.append(
            f"Language model ({timing['note']}), batch {timing['batch']}: {timing['ours'] / n_steps:,.0f} ms per "
            "decision step, waiting for the server included."
        )
    sentences.append(
        f"The paper orders IDM+MOBIL < PPO < REARL: {PAPER_MS['idm_mobil']:g} < {PAPER_MS['ppo']:g} < "
        f"{PAPER_MS['rearl']:,g} ms."
    )
    return sentences


def summary_of(table: pd.DataFrame, n_steps: int) -> dict[str, Any]:
    """Flat figures: `n_steps`; per program and batch (`_loop_b256`) `steps_ms` with `_min`, `_max`, and `compile_s`;
    `paper_ms_METHOD`.
    """
    figures: dict[str, Any] = {"n_steps": n_steps}
    for timing in table.to_dict("records"):
        key = f"{timing['row']}_b{timing['batch']}"
        figures[f"steps_ms_{key}"] = timing["ours"]
        figures |= {f"steps_ms_{key}_min": timing["low"], f"steps_ms_{key}_max": timing["high"]}
        figures[f"compile_s_{key}"] = None if pd.isna(timing["compile_s"]) else timing["compile_s"]
    return figures | {f"paper_ms_{name}": value for name, value in PAPER_MS.items()}
