"""Figures of the kept studies, read from their files so that no number is copied by hand."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from rearl_jax.blind.questions import QUESTIONS
from rearl_jax.discovery.report.words import error_words, verdict_words

KEPT = Path(__file__).resolve().parents[2] / "results" / "kept"
"""Folder of the kept studies."""


def blind_scores() -> str:
    """Questions, rates and goals of the kept blind studies."""
    titles = {question.name: question.title for question in QUESTIONS}
    blocks = []
    for study, summary in _of("discover blind", "summary.json"):
        drawn = summary["n_drawn"]
        blocks.append(
            f"`results/kept/{study}`: the first {summary['n_cases']} of {drawn} data sets in random order, generated; "
            f"code {summary['code_hash']}, master seed {summary['master_seed']}."
        )
        rows = [
            f"| {titles.get(score['name'], score['name'])} | {score['hits']} of {score['cases']} | "
            f"{100 * score['rate']:.0f} % ({100 * score['low']:.0f} to {100 * score['high']:.0f}) | {score['goal']} |"
            for score in summary["scores"]
        ]
        blocks.append("\n".join(["| | | rate | goal |", "|---|---|---|---|", *rows]))
    return "\n\n".join(blocks)


def verdicts() -> str:
    """Verdicts and errors of the kept studies of recordings."""
    blocks = []
    for study, verdict in _of("discover", "verdict.json"):
        blocks.append(f"`results/kept/{study}`\n:   {verdict_words(verdict)}. {error_words(verdict['error'])}.")
    return "\n\n".join(blocks)


PREDICTING = {
    "population": "Parameters of the population",
    "first_half": "Parameters of the driver's first half, predicting the second",
    "other_runs": "Parameters of the same driver's (car's) other runs",
}
"""Protocols that predict, and their titles."""

FIGURES = ("idm", "before", "after", "change_share", "idm_share")


def recording_errors() -> str:
    """Gap errors of the kept studies of recordings and of their groups: a table for each protocol that predicts."""
    heads = ("recording", "verdict", "drivers", "calibrated IDM", "chosen model", "", "final model", "change")
    blocks = []
    for protocol, title in PREDICTING.items():
        rows = [*_rows_of_verdicts(protocol), *_rows_of_groups(protocol)]
        lines = [" | ".join(cells) for cells in ((*heads, "against calibrated IDM"), ("---",) * 9, *rows)]
        blocks.append("\n".join([f"**{title}**", "", *(f"| {line} |" for line in lines)]))
    return "\n\n".join(blocks)


def _rows_of_verdicts(protocol: str) -> Iterator[list[str]]:
    """Rows of the kept discoveries under one protocol."""
    for study, verdict in _of("discover", "verdict.json"):
        parts = [(f"{group['by']} {group['value']}", group) for group in verdict.get("groups", [])]
        for name, one in parts or [("all drivers", verdict)]:
            tested = one["error"]["protocols"][protocol]
            if tested is not None:
                first = [f"`{study}`, {name}", f"`{one['verdict']}`", str(tested["n_drivers"])]
                yield first + _errors(tested["gap_rmse"]["mean"], one["base"]["chosen"])


def _rows_of_groups(protocol: str) -> Iterator[list[str]]:
    """Rows of the groups of the kept studies of real traffic under one protocol."""
    ends = {"value": "", "low": "_low", "high": "_high"}
    for folder, _ in _kept("study real"):
        for row in pd.read_parquet(folder / "real.parquet").astype(object).to_dict("records"):
            if pd.isna(row[f"{protocol}_before"]):
                continue
            mean = {
                figure: {end: row[f"{protocol}_{figure}{suffix}"] for end, suffix in ends.items()} for figure in FIGURES
            }
            first = [f"`{folder.name}`, {row['title']} {row['group']}", f"`{row['verdict']}`"]
            yield [*first, str(row[f"{protocol}_drivers"]), *_errors(mean, row["base"])]


def _errors(mean: Mapping[str, Any], chosen: str) -> list[str]:
    """Cells of the errors of calibrated IDM, of the chosen model, of the final model, and of the changes."""
    idm, before, after = (metres(mean[figure]) for figure in ("idm", "before", "after"))
    return [idm, before, chosen.replace("_", " "), after, percent(mean["change_share"]), percent(mean["idm_share"])]


def known_time_gaps() -> str:
    """Known and calibrated time gaps by car and setting, of the kept studies of real traffic."""
    rows = []
    for folder, summary in _kept("study real"):
        facts = pd.read_parquet(folder / "facts.parquet").dropna(subset=["known"])
        settings = sorted(set(facts["setting"]), reverse=True)
        heads = " | ".join(f"{setting}, known [s] | calibrated [s]" for setting in settings)
        rows += [f"| `{folder.name}`: car | {heads} |", "|---" * (1 + 2 * len(settings)) + "|"]
        for car, own in facts.groupby("car"):
            by_setting = own.set_index("setting").astype(object).to_dict("index")
            cells = [_time_gap(by_setting.get(setting)) for setting in settings]
            rows.append(f"| {str(car).replace('_', ' ')} | {' | '.join(cells)} |")
        rows += ["", f"{summary['n_within']} of {summary['n_known']} are within .15 s."]
    return "\n".join(rows)


def _time_gap(row: Mapping[str, Any] | None) -> str:
    """Cells of the known and of the calibrated time gap of a car."""
    if row is None:
        return "- | -"
    calibrated = "-" if pd.isna(row["calibrated"]) else f"{row['calibrated']:.2f}"
    return f"{row['known']:.2f} ± {row['known_deviation']:.2f} | {calibrated}"


def metres(figure: Mapping[str, float]) -> str:
    """A figure in metres."""
    return f"{figure['value']:.2f} m"


def percent(figure: Mapping[str, float]) -> str:
    """A relative change with its interval."""
    value, low, high = (100 * figure[key] for key in ("value", "low", "high"))
    return f"{value:+.1f} % ({low:+.1f} to {high:+.1f})"


def _of(task: str, file: str) -> Iterator[tuple[str, Any]]:
    """A file of every kept study of a task."""
    for folder, _ in _kept(task):
        yield folder.name, json.loads((folder / file).read_text(encoding="utf-8"))


def _kept(task: str) -> Iterator[tuple[Path, Any]]:
    """Folder and summary of every kept study of a task."""
    for folder in sorted(KEPT.iterdir()):
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        # A summary that is a list of rows belongs to another task.
        if isinstance(summary, dict) and summary["task"] == task:
            yield folder, summary
