"""Figures of the kept studies, read from their files so that no number is copied by hand."""

import json
from collections.abc import Iterator, Mapping
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


def recording_errors() -> str:
    """Verdicts and gap errors of the kept studies of recordings and of their groups, in the protocols that predict."""
    rows = [
        "| recording | verdict | model | drivers | parameters of the population | after | first half known | after |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for study, verdict in _of("discover", "verdict.json"):
        parts = [(f"{group['by']} {group['value']}", group) for group in verdict.get("groups", [])]
        for name, one in parts or [("all drivers", verdict)]:
            chosen, protocols = one["base"]["chosen"], one["error"]["protocols"]
            cells = [
                f"`{study}`, {name}",
                f"`{one['verdict']}`",
                chosen.replace("_", " "),
                str(one["error"]["n_drivers"]),
            ]
            for protocol in ("population", "first_half"):
                mean = protocols[protocol]["gap_rmse"]["mean"]
                cells += [metres(mean["before"]), f"{metres(mean['after'])}, {percent(mean['change_share'])}"]
            rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def metres(figure: Mapping[str, float]) -> str:
    """A figure in metres."""
    return f"{figure['value']:.2f} m"


def percent(figure: Mapping[str, float]) -> str:
    """A relative change with its interval."""
    value, low, high = (100 * figure[key] for key in ("value", "low", "high"))
    return f"{value:+.1f} % ({low:+.1f} to {high:+.1f})"


def _of(task: str, file: str) -> Iterator[tuple[str, Any]]:
    """A file of every kept study of a task."""
    for folder in sorted(KEPT.iterdir()):
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        # A summary that is a list of rows belongs to another task.
        if isinstance(summary, dict) and summary["task"] == task:
            yield folder.name, json.loads((folder / file).read_text(encoding="utf-8"))
