"""The report on `rearl discover blind`: tables and what follows from them."""

from rearl_jax.blind.page import CAPTIONS
from rearl_jax.report.content import Cell, Content, Line, Section, Shown, shown_frame
from rearl_jax.report.finished import FinishedStudy

_WHY_BLIND = (
    "What is hidden was written down and sealed before discovery saw the first data set, and read after the last "
    "verdict."
)


def blind_content(study: FinishedStudy) -> Content:
    """What the report on a blind study says: rates with exact intervals, what was said to what.

    Raises:
        FileNotFoundError, ValueError: A table is missing, or of an older version.
    """
    (summary,) = study.rows
    scores = study.table("scores")
    study.needs(scores, ("title", "n_hits", "n_cases", "rate", "low", "high", "goal", "is_met"), "scores.parquet")
    lines = [
        Line(
            row["title"],
            (
                Cell(f"{row['n_hits']} of {row['n_cases']}"),
                Cell(_percent(row["rate"]), f"{_percent(row['low'])} to {_percent(row['high'])}"),
                Cell(row["goal"]),
                Cell("reached" if row["is_met"] else "missed"),
            ),
        )
        for row in scores.to_dict("records")
    ]
    rates = Shown("Rates with exact 95 % intervals", ("hits", "rate", "goal", ""), tuple(lines))
    confusion, cases = study.table("confusion"), study.table("cases")
    columns = ("variant", "set", "verdict", "named", "outcome", "confidence", "before", "after", "floor", "seconds")
    n_right, n_cases = summary["n_right"], summary["n_cases"]
    matrix = shown_frame("Hidden (lines), said (columns)", confusion, list(confusion))
    return Content(
        title="Blind study of discovery",
        result=f"Discovery was right about {n_right} of {n_cases} data sets whose hidden effects it was not told.",
        sections=(
            Section("Rates", (_WHY_BLIND,), (rates,)),
            Section("What was said to what", tables=(matrix,)),
            Section("Data sets", tables=(shown_frame("Every data set", cases, columns),), is_folded=True),
        ),
        data=f"{n_cases} generated data sets, master seed {summary['master_seed']}.",
        words="discover blind",
        captions=CAPTIONS,
    )  # fmt: skip


def _percent(value: float) -> str:
    return f"{100 * value:.0f} %"
