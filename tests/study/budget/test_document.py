"""Tables, findings and figure of a budget whose errors are made."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.budget import StudyBudgetTask
from rearl_jax.config.evaluation import EvaluationConfig
from rearl_jax.document.html import page_of
from rearl_jax.evaluation.remarks import Remarks
from rearl_jax.evaluation.scores import NOISE_FLOOR, REAL, REAL_VS_REAL
from rearl_jax.metrics import METRICS
from rearl_jax.study.budget.components import TITLES, row_name, rows_of
from rearl_jax.study.budget.document import document_of, findings_of
from rearl_jax.study.budget.figures import budgets
from rearl_jax.study.budget.tables import BUDGET_COLUMNS, STEP_COLUMNS, budget_table, step_table, summary_of

COMPONENTS = ("start", "boundary", "calibrated")
EVAL = EvaluationConfig(resamples=200)
EFFECT = {"start": 0.3, "boundary": 0.1, "calibrated": -0.02}


def figures(row, effects, n_scenes=6):
    """Figures of a row: errors fall by fixed amounts; a little differs between scenes."""
    scene = np.arange(n_scenes)
    fall = sum(effects[name] for name in row)
    frame = pd.DataFrame({"row": row_name(row), "scene_id": scene})
    frame = frame.assign(**{name: 0.8 - fall + 0.01 * scene for name in METRICS}, overlap_share=0.0)
    position = 90.0 - 100 * fall + scene if "start" in row else np.full(n_scenes, np.nan)
    return frame.assign(thw=2.5 - fall, realism=0.6 + fall, collisions=0.0, position_error=position)


def made_rows(effects=EFFECT, real=0.4, components=COMPONENTS):
    """Rows of all subsets, and the reference rows."""
    parts = [figures(row, effects) for row in rows_of(components)]
    for name in (REAL_VS_REAL, NOISE_FLOOR, REAL):
        frame = figures(frozenset(), effects).assign(row=name, position_error=np.nan)
        parts.append(frame.assign(h=real + 0.02 * frame["scene_id"], thw=2.0))
    return pd.concat(parts, ignore_index=True)


@pytest.fixture
def tables():
    rows = made_rows()
    return budget_table(budgets(rows, COMPONENTS), EVAL), step_table(rows, COMPONENTS, EVAL)


def part(table, error, name):
    (row,) = table[(table["error"] == error) & (table["part"] == name)].to_dict("records")
    return row


def test_shares_of_every_error_sum_to_its_fall(tables):
    table, _ = tables
    assert tuple(table.columns[: len(BUDGET_COLUMNS)]) == BUDGET_COLUMNS
    for error, own in table.groupby("error", sort=False):
        shares = own[own["part"].isin(COMPONENTS)]["value"].sum()
        assert shares == pytest.approx(part(table, error, "whole")["value"])
        whole = part(table, error, "first")["value"] - part(table, error, "last")["value"]
        assert abs(part(table, error, "whole")["value"]) == pytest.approx(abs(whole))


def test_a_fall_is_towards_the_recording_in_every_column(tables):
    table, _ = tables
    assert part(table, "h", "start")["value"] == pytest.approx(0.3)
    assert part(table, "realism", "start")["value"] == pytest.approx(0.3)  # which is better if higher
    assert part(table, "thw_error", "start")["value"] == pytest.approx(0.3)  # less far from the recorded 2 s
    assert part(table, "thw_error", "first")["value"] == pytest.approx(0.5)
    assert part(table, "realism", "last")["value"] == pytest.approx(0.98)


def test_position_errors_begin_with_the_recorded_start(tables):
    table, _ = tables
    own = table[table["error"] == "position_error"]
    assert "start" not in set(own["part"])
    assert part(table, "position_error", "boundary")["value"] == pytest.approx(10.0)
    assert "real" not in set(own["part"])
    assert own["n_orders"].unique().tolist() == [2]


def test_the_rest_stands_beside_real_against_real(tables):
    table, _ = tables
    assert part(table, "h", "rest")["value"] == pytest.approx(0.42 - 0.4 - 0.01 * 2.5)
    low, high = (part(table, "h", "rest")[end] for end in ("low", "high"))
    assert low < part(table, "h", "rest")["value"] < high


def test_steps_are_the_stated_order_and_the_references(tables):
    _, steps = tables
    assert tuple(steps.columns) == STEP_COLUMNS
    names = list(dict.fromkeys(steps["row"]))
    assert names == ["base", "start", "start+boundary", "start+boundary+calibrated", REAL_VS_REAL, NOISE_FLOOR, REAL]
    assert len(steps[(steps["row"] == "base") & (steps["figure"] == "position_error")]) == 0


@pytest.mark.parametrize(
    ("effects", "real", "said"),
    [
        (EFFECT, 0.4, "the order hardly matters"),
        (EFFECT, 0.1, "larger than between recorded scenes"),
        (EFFECT, 0.7, "smaller than between recorded scenes"),
    ],
)
def test_findings_follow_from_the_figures(effects, real, said):
    table = budget_table(budgets(made_rows(effects, real), COMPONENTS), EVAL)
    verdict, *findings = findings_of(table, "mape_a", COMPONENTS)
    assert verdict.startswith("H goes from 0.825 to 0.445 with all components; the largest share")
    assert said in findings[0] or said.capitalize() in findings[0]
    assert len([text for text in findings if " goes from " in text]) == 3


@pytest.mark.parametrize(
    ("effects", "said"),
    [
        (
            {"start": -0.1, "boundary": 0.02, "calibrated": -0.02},
            "does not fall; the largest share that reduces it, +0.020",
        ),
        ({"start": -0.1, "boundary": -0.02, "calibrated": -0.02}, "does not fall, and no component reduces it"),
    ],
)
def test_an_error_that_rises_is_not_called_a_reduction(effects, said):
    verdict, *findings = findings_of(budget_table(budgets(made_rows(effects), COMPONENTS), EVAL), "mape_a", COMPONENTS)
    assert said in verdict
    assert "this reduction" not in verdict
    assert any(text.startswith("Position error goes from") for text in findings)  # the unit is not part of the name


def test_the_waterfall_has_the_stated_order(monkeypatch):
    from rearl_jax.study.budget import waterfall

    order, drawn = ("calibrated", "start", "boundary"), []
    rows = made_rows(components=order)
    table, steps = budget_table(budgets(rows, order), EVAL), step_table(rows, order, EVAL)
    monkeypatch.setattr(waterfall, "png", lambda figure: drawn.append(figure) or b"")
    waterfall.draw_waterfall(table, "mape_a", generated=False)
    panel, _, of_positions = drawn[0].axes
    names = [label.get_text() for label in panel.get_yticklabels()]
    assert names == ["Base", *(TITLES[name] for name in order), "all components"]
    crosses = [line.get_xydata()[0] for line in panel.lines if line.get_marker() == "x"]
    of_rows = steps[steps["figure"] == "h"].set_index("row")["value"].astype(float)
    expected = of_rows[["calibrated", "start+calibrated", "start+boundary+calibrated"]].tolist()
    np.testing.assert_allclose(crosses, np.stack([expected, [1, 2, 3]], axis=1))
    # Position errors begin with the row that starts as recorded.
    assert [bar.get_y() + bar.get_height() / 2 for bar in of_positions.patches] == pytest.approx([2, 1, 3, 4])


def test_it_says_where_the_order_decides():
    rows = made_rows()
    # Either of two components alone brings nearly all of the fall, whichever comes first.
    both = {"start": 0.3, "start+boundary": 0.31, "calibrated": 0.3, "start+calibrated": 0.31}
    both |= {"base": 0.0, "start+boundary+calibrated": 0.32}
    own = rows["row"].isin(list(both))
    rows.loc[own, "h"] = 0.8 - rows.loc[own, "row"].map(both) + 0.01 * rows.loc[own, "scene_id"]
    table = budget_table(budgets(rows, COMPONENTS), EVAL)
    finding = findings_of(table, "mape_a", COMPONENTS)[1]
    assert "The order decides" in finding


def test_scenes_in_which_nobody_stays_have_no_position_error():
    rows = made_rows().assign(position_error=np.nan)
    table = budget_table(budgets(rows, COMPONENTS), EVAL)
    assert "position_error" not in set(table["error"])
    assert any(
        "picked in the first snapshot and in the second" in text for text in findings_of(table, "mape_a", COMPONENTS)
    )


def test_where_only_the_start_is_added_position_errors_do_not_fall():
    rows = made_rows()
    table = budget_table(budgets(rows, ("start",)), EVAL)
    assert "position_error" not in set(table["error"])
    assert not any("osition error" in text for text in findings_of(table, "mape_a", ("start",)))


def test_without_any_figure_there_is_nothing_to_divide():
    rows = made_rows()
    rows[[*METRICS, "position_error"]] = np.nan
    table = budget_table(budgets(rows, COMPONENTS), EVAL)
    assert "nothing can be divided" in findings_of(table, "mape_a", COMPONENTS)[0]


def test_the_summary_is_flat_and_names_the_leader(tables):
    table, _ = tables
    summary = summary_of(table, COMPONENTS, 6, 3)
    assert (summary["components"], summary["n_scenes"], summary["n_orders"]) == ("start+boundary+calibrated", 6, 3)
    assert summary["h_leader"] == "start"
    assert summary["h_leads"] == 1.0
    assert summary["h_start"] == pytest.approx(0.3)
    assert summary["h_start_low"] <= summary["h_start"] <= summary["h_start_high"]


@pytest.mark.parametrize("generated", [True, False])
def test_page_and_figure(tables, generated):
    from rearl_jax.study.budget.waterfall import draw_waterfall

    table, steps = tables
    remarks = Remarks("some data", findings_of(table, "mape_a", COMPONENTS), ("a definition",))
    document = document_of(table, steps, remarks, generated=generated)
    png = draw_waterfall(table, "mape_a", generated=generated)
    assert png.startswith(b"\x89PNG")
    page = page_of(document, StudyBudgetTask(), {"waterfall": png}, data_id="x")
    assert "replayed neighbours" in page
    assert "rearl study budget" in page
