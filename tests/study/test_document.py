"""The end of every study: page, Parquet, what is printed, that generated data are marked, and the report on it."""

from unittest.mock import Mock

import pandas as pd
import pytest

from rearl_jax import drawing
from rearl_jax.config import ResultsConfig, StudyFig7Task
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.document.table import Cell, Emphasis
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.report.documents import paper_document
from rearl_jax.report.finished import read_finished
from rearl_jax.results import Study
from rearl_jax.study.document import beside_paper, document_of, long_table, publish
from rearl_jax.study.fig7 import FORM

RECORDS = [
    {"row": "[5 %]", "metric": "mape", "ours": 1.0, "low": None, "paper": 0.1982, "n_values": None},
    {"row": "[5 %]", "metric": "h", "ours": 0.25, "low": 0.2, "high": 0.3, "paper": None, "n_values": 7},
]
REMARKS = Remarks("No data.", ("They differ.", "By much."), ("data: others", "unit: seconds"))


def png():
    figure, (axes,) = drawing.panels(3, 2, generated=True)
    axes.plot([1], [1], "o")
    return drawing.png(figure)


@pytest.fixture
def study(tmp_path):
    config = StudyFig7Task(results=ResultsConfig(root=str(tmp_path)))
    study = Study(tmp_path, config.study, config, "study fig7", generated=True)
    study.write_config()
    return study, config


def test_everything_is_written_generated_data_are_marked_and_the_report_says_the_same(study, tmp_path, capsys):
    study, config = study
    table, summary = long_table(RECORDS), {"n_scenes": 3, "missing": None}
    scenes = Mock(spec=SceneSet, generated=True, data_id="of-a-test")
    publish(study, FORM, config, scenes, table, summary, REMARKS, lambda: {"fig7": png()})
    printed = capsys.readouterr().out
    assert printed.count("GENERATED") == 2
    places = [printed.index(text) for text in ("They differ.", "[5 %]", "paper: [5 %]", "By much.")]
    assert places == sorted(places)
    assert "order of methods can be compared with the paper; page.html lists what differs: data, unit." in " ".join(
        printed.split()
    )
    page = (study.path / "page.html").read_text(encoding="utf-8")
    for text in (
        "Generated recordings, not measured",
        "paper: [5 %]",
        "<li>data: others</li>",
        "rearl study fig7",
        "of-a-test",
    ):
        assert text in page
    assert "data:image/png;base64," in page
    stored = pd.read_parquet(study.path / "fig7.parquet")
    assert stored["low"].isna().tolist() == [True, False]
    assert stored["n_values"].dtype == "Int64"
    assert (study.path / "fig7.png").exists()
    document = document_of(FORM, config, table, summary, REMARKS, generated=True)
    assert paper_document(read_finished(str(tmp_path), config.study)) == document
    assert document.sections[-1].tables[0].rows[0].cells == (Cell("3"),)


def test_other_figures_are_those_outside_the_table(study):
    _, config = study
    summary = {"n_scenes": 3, "[5 %]_mape": 1.0, "[5 %]_h_low": 0.2, "[5 %]_score": 0.7}
    document = document_of(FORM, config, long_table(RECORDS), summary, REMARKS, generated=True)
    (figures,) = document.sections[-1].tables
    assert [row.cells for row in figures.rows] == [(Cell("3"),), (Cell("0.700"),)]


def test_a_study_without_remarks_is_reported_by_its_figures(study, tmp_path):
    study, config = study
    study.write_table("fig7", long_table(RECORDS))
    study.write_summary({"n_scenes": 3})
    document = paper_document(read_finished(str(tmp_path), config.study))
    assert document.verdict == "Errors of base, compared with Fig. 7 of the paper."
    assert document.sections[0].tables[0].rows[0].cells == (
        Cell("0.2500", "0.2000 to 0.3000"),
        Cell("-"),
        Cell("1.0000"),
    )


def test_rows_of_the_paper_stand_once_below_the_last_row_they_belong_to():
    rows = [("first", 0.3, "base"), ("second", 0.4, "base"), ("third", 0.5, None), ("paper_ppo", None, "ppo")]
    records = [
        {"row": row, "title": row, "metric": "h_legacy", "ours": ours, "paper": 0.346, "paper_row": name}
        for row, ours, name in rows
    ]
    records[2]["paper"] = None
    table = beside_paper("Table", long_table(records), {"h_legacy": "H legacy", "lcr": "LCR"})
    assert [row.title for row in table.rows] == ["first", "second", "paper: Base", "third", "paper: PPO"]
    assert [row.emphasis for row in table.rows].count(Emphasis.subdued) == 2
    assert table.rows[2].cells == (Cell("0.346"), Cell("-"))


def test_long_tables_have_nulls_where_there_is_no_figure():
    table = long_table([{"row": "a", "ours": 1, "paper": float("nan")}, {"row": "b", "ours": None, "paper": 2.0}])
    assert table["ours"].isna().tolist() == [False, True]
    assert table["paper"].isna().tolist() == [True, False]
    assert str(table["paper"].dtype) == "Float64"
