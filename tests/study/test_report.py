"""The end of every study: page, Parquet, what is printed, and that generated data are marked."""

import pandas as pd
import pytest

from rearl_jax import console, drawing
from rearl_jax.config import ResultsConfig, StudyFig7Task
from rearl_jax.results import Study
from rearl_jax.study.report import Cell, Line, Report, Shown, finish, long_table, print_report


@pytest.fixture
def report():
    lines = (Line("[ours]", (Cell("1.0", "0.9–1.1"),)), Line("paper: theirs", (Cell("2.0"),), is_paper=True))
    return Report(
        title="Ours beside theirs",
        tables=(Shown("Table", ("figure",), lines),),
        findings=("They differ.",),
        differences=("data: others",),
        data={"summary": "No data.", "sources": []},
        generated=True,
        captions={"dot": "A dot."},
    )


def png():
    figure, (axes,) = drawing.panels(3, 2, generated=True)
    axes.plot([1], [1], "o")
    return drawing.png(figure)


def test_everything_is_written_and_generated_data_are_marked(report, tmp_path, capsys):
    config = StudyFig7Task(results=ResultsConfig(root=str(tmp_path)))
    study = Study(tmp_path, config.study, config, "study fig7", generated=True)
    table = long_table([{"row": "a", "metric": "h", "ours": 1.0, "low": None, "paper": None, "n_scenes": None}])
    finish(study, "study fig7", config, report, table, {"a": None}, lambda: {"dot": png()})
    printed = capsys.readouterr().out
    assert printed.count("GENERATED") == 2
    assert "[ours]" in printed
    assert "They differ." in printed
    assert "- data: others" in printed
    page = (study.path / "page.html").read_text(encoding="utf-8")
    assert "Generated recordings, no measurements" in page
    assert "paper: theirs" in page
    assert "data:image/png;base64," in page
    assert "rearl study fig7" in page
    assert 'src="http' not in page
    stored = pd.read_parquet(study.path / "fig7.parquet")
    assert stored["low"].isna().all()
    assert stored["n_scenes"].dtype == "Int64"
    assert (study.path / "dot.png").exists()


def test_a_narrow_terminal_loses_intervals_and_nothing_else(report, monkeypatch, capsys):
    class Narrow(console.Console):
        def __init__(self, **options):
            super().__init__(force_terminal=True, color_system=None, **({"width": 80} | options))

    monkeypatch.setattr(console, "Console", Narrow)
    print_report(report)
    said = capsys.readouterr().out
    assert "0.9–1.1" not in said
    assert "intervals: page.html" in said
    assert "1.0" in said


def test_long_tables_have_nulls_where_there_is_no_figure():
    table = long_table([{"row": "a", "ours": 1, "paper": float("nan")}, {"row": "b", "ours": None, "paper": 2.0}])
    assert table["ours"].isna().tolist() == [False, True]
    assert table["paper"].isna().tolist() == [True, False]
    assert str(table["paper"].dtype) == "Float64"
