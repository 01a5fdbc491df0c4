"""Figures of the kept studies, read from their files so that no number is copied by hand."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

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


def _of(task: str, file: str) -> Iterator[tuple[str, Any]]:
    """A file of every kept study of a task."""
    for folder in sorted(KEPT.iterdir()):
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        # A summary that is a list of rows belongs to another task.
        if isinstance(summary, dict) and summary["task"] == task:
            yield folder.name, json.loads((folder / file).read_text(encoding="utf-8"))
