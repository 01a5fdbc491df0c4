"""The table of verdicts and errors, its document and its figures."""

import pandas as pd
import pytest

from rearl_jax.config import StudyRealTask
from rearl_jax.document.html import page_of
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.study.real.document import document_of, summary_of
from rearl_jax.study.real.facts import FACT_COLUMNS
from rearl_jax.study.real.table import real_table, rows_of
from tests.study.real.made import verdict


def row(**found):
    (made,) = rows_of("i80", "I-80", "all", verdict(**found))
    return made


def test_a_discovery_without_groups_is_one_row():
    made = row(word="named")
    assert (made["set"], made["group"], made["verdict"], made["base"]) == ("i80", "all", "named", "idm")
    assert made["drivers"] == 105
    assert made["effects"] == "reaction delay 0.700 s"
    assert made["population_before"] == 1.5
    assert (made["population_change_share"], made["population_change_share_low"]) == (-0.2, 1.25)
    assert (made["population_idm"], made["population_idm_share"]) == (1.6, -0.25)
    assert made["first_half_drivers"] == 30
    assert made["other_runs_before"] is None
    assert (made["time_gap_10"], made["time_gap_20"]) == (1.5, None)


def test_a_discovery_by_groups_has_a_row_for_each():
    found = verdict(groups=[("ACC", "constant_time_headway"), ("person", "idm")])
    made = rows_of("fhwa", "FHWA", "all", found)
    assert [(one["group"], one["base"]) for one in made] == [("ACC", "constant_time_headway"), ("person", "idm")]


def test_it_says_which_tests_fail():
    assert row(word="unexplained")["failed_tests"] == "old_decisions,heavy_tails"
    assert row(word="named")["failed_tests"] == ""


@pytest.mark.parametrize(("change", "said"), [(-0.2, ""), (0.009, ""), (0.011, "population")])
def test_it_says_where_the_repaired_model_is_worse(change, said):
    assert row(change_share=change)["worse_in"] == said


@pytest.fixture
def tables():
    """A table of three groups, facts of two cars, and differences."""
    rows = rows_of("i80", "I-80", "all", verdict())
    rows += rows_of("fhwa", "FHWA", "", verdict("nothing", 0.5, [("ACC", "idm"), ("person", "idm")]))
    facts = pd.DataFrame(
        [
            {"car": "A", "setting": "S", "calibrated": 1.5, "model_free": 1.8, "known": 1.6, "within": True},
            {"car": "A", "setting": "L", "calibrated": 2.5, "model_free": 2.0, "known": 2.0, "within": False},
            {"car": "B", "setting": "S", "calibrated": None, "model_free": 2.0, "known": 2.0, "within": None},
        ]
    ).reindex(columns=list(FACT_COLUMNS))
    facts = facts.assign(set="openacc", title="ZalaZone").astype({"within": "boolean"})
    difference = {"set": "fhwa", "title": "FHWA", "cars": 9, "first_mean": 1.0, "second_mean": 1.0, "longer": 4}
    difference |= {"value": 0.0, "low": -0.1, "high": 0.1}
    differences = pd.DataFrame(
        [
            difference | {"first": "ACC", "second": "person", "method": "calibrated"},
            difference | {"first": "ACC", "second": "person", "method": "model_free", "low": 0.05},
            difference | {"first": "L", "second": "S", "method": "calibrated", "longer": 8},
        ]
    )
    return real_table(rows), facts, differences


def test_the_summary_scores_the_facts(tables):
    summary = summary_of(*tables)
    assert (summary["n_sets"], summary["n_groups"], summary["n_worse"]) == (2, 3, 2)
    assert (summary["n_improved"], summary["n_nothing"], summary["n_named"]) == (1, 2, 0)
    assert (summary["n_known"], summary["n_within"], summary["n_within_model_free"]) == (3, 1, 2)
    assert (summary["n_shorter"], summary["n_cars"]) == (8, 9)
    assert summary["is_leader_equal"] is True
    assert summary["leader_difference_low"] == -0.1


def test_a_difference_beside_zero_is_no_equality(tables):
    table, facts, differences = tables
    differences.loc[0, "low"] = 0.01
    assert summary_of(table, facts, differences)["is_leader_equal"] is False


def test_without_facts_nothing_is_scored(tables):
    table, facts, differences = tables
    summary = summary_of(table, facts[:0], differences[:0])
    assert summary["n_known"] == 0
    assert summary["n_cars"] is None
    assert summary["is_leader_equal"] is None
    document = document_of(table, facts[:0], differences[:0], Remarks(), generated=False)
    assert [section.title for section in document.sections] == ["Verdicts", "Gap error before and after, by protocol"]


def test_the_document_has_every_group_protocol_and_fact(tables):
    document = document_of(*tables, Remarks("some data"), generated=False)
    assert document.verdict.startswith("Groups of drivers: 1 improved, 2 nothing; 1 of 3 known time gaps")
    verdicts, errors, score, time_gaps, differences = document.sections
    assert [one.title for one in verdicts.tables[0].rows] == ["I-80, all", "FHWA, ACC", "FHWA, person"]
    assert [one.cells[-1].value for one in verdicts.tables[0].rows] == ["-", "population", "population"]
    assert len(errors.tables) == 3  # nobody has several runs
    assert [cell.value for cell in errors.tables[0].rows[0].cells[-3:]] == ["-20.0", "1.60", "-25.0"]
    assert [one.cells[0].value for one in score.tables[0].rows] == ["1 of 3", "2 of 3", "8 of 9 cars", "yes, 9 persons"]
    assert score.tables[0].rows[-1].title == "behind ACC not distinguished from behind people"
    assert len(time_gaps.tables[0].rows) == 3
    assert len(differences.tables[0].rows) == 3
    assert "FHWA, person" in page_of(document, StudyRealTask(), {}, data_id="x")
