"""Scores of a finished blind study computed again, without simulation: `python -m rearl_jax.blind.again FOLDER`.

Reads `protocol.json`, the sealed `truth.json` and `cases.parquet`, the table with the verdict on each data set. Prints
the tables and writes these derived files again: `scores.parquet`, `sets.parquet`, `strengths.parquet`,
`confusion.parquet`, `strata.parquet` (broad priors only), `page.html`, `summary.json`, and those PNG figures that the
folder contains. The files state the provenance of the study, and `judged_again`. Results that cannot be derived from
`cases.parquet` are kept: parameters, stated confidences, and rates for which this table lacks a column.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from rearl_jax.blind.document import document_of
from rearl_jax.blind.judging import Judgement, is_alone, shown_of
from rearl_jax.blind.questions import QUESTIONS, Judged
from rearl_jax.blind.results import BlindResults
from rearl_jax.blind.scores import Score, score_all
from rearl_jax.blind.sealing import Protocol, open_truth, stored_protocol
from rearl_jax.blind.traffic.measurement import ARTEFACTS
from rearl_jax.blind.verdicts import ERRORS, Interval, NamedEffect, Verdict
from rearl_jax.config import DiscoverBlindTask
from rearl_jax.config._schema import from_plain
from rearl_jax.document.terminal import print_document
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.results import PREFIX, PROVENANCE, read_metadata
from rearl_jax.whole_files import replacing


@dataclass(frozen=True)
class KeptResults(BlindResults):
    """Results of a finished study, of whose verdicts only the table `cases.parquet` is left.

    Attributes:
        columns: Columns of this table.
        kept_scores: Rows of scores.parquet as the study itself wrote them.
    """

    columns: frozenset[str]
    kept_scores: Sequence[Mapping[str, Any]]

    @cached_property
    def scores(self) -> list[Score]:
        """Rates, computed again if the table has the necessary columns, else those that the study itself wrote."""
        old_rows = {row["name"]: row for row in self.kept_scores if row["name"] in self._not_computable}
        names = [item.name for item in fields(Score)]
        kept = {name: Score(**{key: row[key] for key in names}) for name, row in old_rows.items()}
        computable = [question for question in QUESTIONS if question.name not in self._not_computable]
        kept |= {score.name: score for score in score_all(self.cases, computable)}
        return [kept[question.name] for question in QUESTIONS if question.name in kept]

    @property
    def _not_computable(self) -> set[str]:
        """Names of the rates that cannot be computed again, because the table lacks a column."""
        return {question.name for question in QUESTIONS if question.needs and question.needs not in self.columns}


def read_study(folder: Path) -> tuple[Protocol, KeptResults]:
    """The protocol of a study, and its results computed again.

    Raises:
        FileNotFoundError: A file is missing.
        ValueError: There is no protocol, or the truth differs from the sealed one.
    """
    protocol = stored_protocol(folder)
    if protocol is None:
        message = "has no protocol.json that can be read: name the folder of a blind study"
        raise InvalidInputError(Problem("no-protocol", message, file=str(folder)))
    truths = open_truth(folder, protocol)
    table = pd.read_parquet(folder / "cases.parquet")
    return protocol, KeptResults(
        cases=[judged_of_row(truths[row["case"]], row) for row in _rows(table)],
        n_drawn=len(truths),
        columns=frozenset(table.columns),
        kept_scores=_rows(pd.read_parquet(folder / "scores.parquet")),
    )


def judge_again(folder: Path) -> dict[str, Any]:
    """Computes the results of a study again and writes them; returns the summary.

    Raises:
        FileNotFoundError, ValueError: As in `read_study`.
    """
    # Imported here, so that reading a study needs neither matplotlib nor jinja2.
    from rearl_jax.blind.figures import draw_figures
    from rearl_jax.document.html import page_of

    protocol, results = read_study(folder)
    old_summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    config = from_plain(DiscoverBlindTask, json.loads((folder / "config.json").read_text(encoding="utf-8")))
    provenance = read_metadata(folder / "cases.parquet") | {"judged_again": "true"}
    made_by = {key: old_summary[key] for key in PROVENANCE}
    sealed = {"master_seed": protocol.master_seed, "truth_sha256": protocol.truth_sha256}
    priors = {"priors": old_summary["priors"]} if "priors" in old_summary else {}
    summary = made_by | {"judged_again": True} | sealed | results.summary() | priors
    kept = {name: pd.read_parquet(folder / f"{name}.parquet") for name in ("parameters", "calibration", "cases")}
    derived = results.tables()
    for name, table in derived.items():
        _write_table(folder / f"{name}.parquet", table, provenance)
    document = document_of(summary, kept | derived, vars(protocol))
    figures = draw_figures(results)
    for name in figures:
        if (path := folder / f"{name}.png").is_file():
            with replacing(path) as unfinished:
                unfinished.write_bytes(figures[name])
    _write_text(folder / "page.html", page_of(document, config, figures, made_by=made_by))
    _write_text(folder / "summary.json", json.dumps(summary, indent=2, allow_nan=False) + "\n")
    print_document(document)
    return summary


def main(arguments: list[str]) -> None:
    """Computes the results of the study in a folder again."""
    if len(arguments) != 1:
        sys.exit((__doc__ or "").strip())
    try:
        judge_again(Path(arguments[0]))
    except (FileNotFoundError, ValueError) as error:
        sys.exit(str(error))


def judged_of_row(truth: Mapping[str, Any], row: Mapping[str, Any]) -> Judged:
    """The data set of a row of `cases.parquet`, judged again."""
    verdict = _verdict(row)
    false_names = _names(row["false"])
    judgement = Judgement(
        outcome=row["outcome"],
        shown=shown_of(verdict, row["n_recognised"], row["is_flagged"]),
        n_hidden=row["n_hidden"],
        n_recognised=row["n_recognised"],
        in_set=row["in_set"],
        alone=is_alone(truth["planted"], verdict, row["n_recognised"]),
        is_flagged=row["is_flagged"],
        false_names=false_names,
        false_kinds=tuple(map(_kind, false_names)),
        claims=(),
    )
    return Judged(row["case"], truth, verdict, judgement, (), row.get("n_intervals", 0), row.get("n_covered", 0))


def _verdict(row: Mapping[str, Any]) -> Verdict:
    """The verdict that a row of `cases.parquet` contains."""
    return Verdict(
        verdict=row["verdict"],
        effects=tuple(NamedEffect(name, _kind(name), {}, frozenset(), None) for name in _names(row["named"])),
        alternatives=frozenset(_names(row["alternatives"])),
        errors={
            name: None if row[name] is None else Interval(row[name], row.get(f"{name}_low"), row.get(f"{name}_high"))
            for name in ERRORS
        },
        n_drivers=row["n_drivers"],
        seconds=row["seconds"],
        message=row["message"],
    )


def _kind(name: str) -> str:
    """Kind of a claimed effect: "artefact", "generic" (a fitted curve) or "traffic"."""
    return "artefact" if name in ARTEFACTS else "generic" if name.endswith("dependence") else "traffic"


def _names(joined: str) -> tuple[str, ...]:
    return tuple(joined.split("+")) if joined else ()


def _rows(table: pd.DataFrame) -> list[dict]:
    """The rows of a table, with None for missing values."""
    return table.astype(object).where(table.notna(), None).to_dict("records")


def _write_table(path: Path, table: pd.DataFrame, provenance: Mapping[str, str]) -> None:
    import pyarrow
    from pyarrow import parquet

    whole = pyarrow.Table.from_pandas(table, preserve_index=False)
    metadata = {PREFIX + key: value for key, value in provenance.items()}
    with replacing(path) as unfinished:
        parquet.write_table(whole.replace_schema_metadata({**(whole.schema.metadata or {}), **metadata}), unfinished)


def _write_text(path: Path, text: str) -> None:
    with replacing(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
