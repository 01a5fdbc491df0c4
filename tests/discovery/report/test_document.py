"""The document of a discovery, in the terminal and on the page, and the maps that it rests on."""

import re

import numpy as np
import pytest

from rearl_jax.config import DiscoverTask
from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.report.document import document_of
from rearl_jax.discovery.report.figures import draw_evidence
from rearl_jax.discovery.report.map_figures import draw_maps
from rearl_jax.discovery.report.presentation import map_table
from rearl_jax.discovery.report.words import verdict_words
from rearl_jax.discovery.search.atlas import Atlas
from rearl_jax.discovery.search.finder import Selected
from rearl_jax.discovery.search.maps import Basis, Curve
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.search.reactions import Reaction
from rearl_jax.document.html import page_of
from rearl_jax.document.terminal import text_of
from tests.discovery.made_verdict import KEEP_RIGHT, LANE_SCORES, LOSS, VERDICT

CURVE = {"name": "dependence", "kind": "generic"}
NUMBERS = {"parameters": {}, "confidence": 0.9, "evidence": 50.0}
REAR_GAP = {"name": "lane_choice_dependence", "kind": "generic", "variables": ["rear_gap"], **NUMBERS}


def atlas() -> Atlas:
    basis = Basis(Reaction("gap", np.zeros((2, 1))), np.array([1.0, 2.0, 3.0]), np.full(3, 1 / 3))
    value = np.array([-0.1, 0.0, 0.1])
    curve = Curve(basis, value, value - 0.05, value + 0.05, "acceleration", 0.3, 12.0)
    return Atlas({"gap": curve}, {}, [Selected("gap", "acceleration", 1.0, 1.0)], {"gap": "rises by 0.20 m/s^2"})


def document(verdict=VERDICT, atlases=None):
    return document_of(DiscoverTask(), verdict, map_table(atlases or {"before": atlas()}, {}))


def table_of(verdict, title):
    """Cells of a table of the document by the titles of its rows."""
    (table,) = [
        table
        for section in document(verdict).sections
        for table in section.tables
        if table.title.partition(" (")[0] == title
    ]
    return {row.title: [cell.value for cell in row.cells] for row in table.rows}


def words(text):
    return " ".join(text.split())


def test_page_says_the_verdict_escapes_markup_and_has_no_nan():
    page = page_of(document(), DiscoverTask(), {"maps": b"png"}, data_id="abc")
    body = re.sub(r"base64,[^\"]*", "", page)
    assert "Missing in the model: reaction delay" in body
    assert "Generated recordings, no measurements" in body
    assert "rises by 0.20 m/s^2" in body
    assert "faster changes" in body
    assert "<b>speed</b>" not in body
    assert "&lt;b&gt;speed" in body
    assert "<i>" not in body
    assert not re.search(r"\bnan\b|\bNone\b", body.split("Complete configuration")[0])


def test_the_terminal_says_what_is_missing_how_we_know_and_what_it_changes():
    text = words(text_of(document()))
    parts = (
        "Missing in the model: reaction delay.",
        "GENERATED recordings",
        "That is 90 % of the squared error beyond",
        "The columns themselves show: the <b>speed</b> column is late.",
        "Leader acceleration explains the data as well; to tell them apart: faster changes <i>.",
        "Fitted to 36 drivers and checked on 35 others",
        "Made for a test.",
    )
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    assert "choice of the lane" not in text
    assert "Thresholds" not in text


def test_errors_and_effects_stand_beside_their_intervals():
    errors, effects = (part.tables[0] for part in document().sections[:2])
    cells = [(cell.value, cell.interval) for cell in errors.rows[0].cells]
    assert cells == [("1.50", "1.00 to 2.00")] * 2 + [("+1.50", "+1.00 to +2.00")]
    assert [cell.value for cell in errors.rows[-1].cells] == ["", "0.400", ""]
    (row,) = effects.rows
    assert row.title == "reaction delay"
    assert [(cell.value, cell.interval) for cell in row.cells] == [
        ("delay [s]", ""),
        ("0.700", "0.600 to 0.800"),
        ("0.90", ""),
    ]


def test_a_curve_of_many_values_is_one_row_and_an_effect_without_parameters_another():
    value = {"value": 0.3, "low": None, "high": None, "unit": "-"}
    curve = CURVE | NUMBERS | {"variables": ["gap"], "parameters": {f"value_{k}": value for k in range(9)}}
    rows = table_of(VERDICT | {"effects": [curve, REAR_GAP]}, "Effects and their parameters")
    assert rows["dependence on gap"][0] == "a curve through 9 values"
    assert rows["lane choice dependence on rear_gap"] == ["-", "-", "0.90"]


def test_of_two_curves_the_one_that_was_added_is_marked():
    gap, speed = (CURVE | LANE_SCORES | {"variables": [name]} for name in ("gap", "speed"))
    effect = CURVE | NUMBERS | {"variables": ["gap"]}
    rows = table_of(VERDICT | {"effects": [effect], "candidates": [gap, speed]}, "Candidates of car following")
    assert rows["dependence on gap"] == ["12.0", "30.0", "20.0", "named"]
    assert rows["dependence on speed"][-1] == ""


def test_the_choice_of_the_lane_has_a_table_of_its_own():
    lanes = [KEEP_RIGHT | LANE_SCORES, KEEP_RIGHT | LANE_SCORES | {"name": "politeness", "ambiguous": True}]
    verdict = VERDICT | {
        "effects": [KEEP_RIGHT | NUMBERS],
        "candidates": [*VERDICT["candidates"] * 7, *lanes],
        "lane_choice": {"changes": 400, "opportunities": 9000, "loss": LOSS},
    }
    rows = table_of(verdict, "Candidates of the choice of the lane")
    scores = ["12.0", "30.0", "20.0"]
    assert rows == {"keep right": [*scores, "named"], "politeness": [*scores, "not told apart"]}
    assert set(table_of(verdict, "Candidates of car following")) == {"reaction delay", "leader acceleration"}
    text = words(text_of(document(verdict)))
    assert "Missing in the choice of the lane: keep right." in text
    assert "(the first 12 of 14; candidates.parquet has all)" in text
    assert "400 changes by choice in 9000 opportunities" in text
    assert "change -0.0500 (-0.0600 to -0.0400) nats" in text
    assert "gain of the right lane + bias" in text


def test_what_no_effect_of_the_library_does_is_said_to_be_in_no_model():
    text = words(text_of(document(VERDICT | {"verdict": "unexplained", "effects": [REAR_GAP]})))
    assert "Lane choice dependence on rear_gap: not in model.yaml" in text


def test_the_page_says_what_the_residual_depends_on_before_and_after():
    def left(atlases):
        return next(part for part in document(atlases=atlases).sections if part.title == "What the model leaves")

    seen = atlas()
    repaired = Atlas(seen.curves, {}, [Selected("gap", "acceleration", 0.1, 0.1)], seen.shapes)
    assert left({"before": seen}).paragraphs[1].endswith("finds a dependence on gap.")
    both = left({"before": seen, "after": repaired})
    assert both.paragraphs[1].endswith("finds a dependence on gap. After the repair it finds nothing.")
    assert "at most 30.0 %" in both.paragraphs[2]
    assert [cell.value for cell in both.tables[0].rows[0].cells] == ["100 %", "30.0 %", "rises by 0.20 m/s^2"]


def test_the_error_of_an_effect_that_was_told_stands_under_its_name():
    error = VERDICT["error"] | {"after": None, "oracle": VERDICT["error"]["before"]}
    nothing = {"effects": [], "candidates": [], "adequacy": None, "lane_choice": None}
    told = document_of(DiscoverTask(), VERDICT | nothing | {"error": error})
    assert told.sections[0].tables[0].headings[1] == "with the effect that was told"
    assert "1.50 (1.00 to 2.00) m for the oracle" in told.sections[0].paragraphs[0]
    assert "Candidates" not in [section.title for section in told.sections]


def test_the_document_has_the_thresholds_of_the_verdict():
    assert "Thresholds of the decision" not in [section.title for section in document().sections]
    rows = table_of(VERDICT | {"thresholds": {"least_total": 16.25}}, "Thresholds")
    value, meaning = rows["least total"]
    assert value == "16.25"
    assert re.match(r"Gain and check, .*\[nats\]", meaning)


@pytest.mark.parametrize(
    ("word", "effects", "said"),
    [
        ("nothing", [], "nothing significant is missing"),
        ("named", [], "an effect was told, and nothing looked for"),
        ("named", [KEEP_RIGHT], "missing in the choice of the lane: keep right"),
        (
            "unexplained",
            [REAR_GAP],
            "unexplained; missing in the choice of the lane: lane choice dependence on rear_gap",
        ),
        (
            "artefact",
            [{"name": "speed_lag", "kind": "artefact", "variables": []}, KEEP_RIGHT],
            "fault of the measurement: speed lag; missing in the choice of the lane: keep right",
        ),
    ],
)
def test_verdict_in_one_line(word, effects, said):
    assert verdict_words({"verdict": word, "effects": effects}) == said


def test_map_table_has_no_value_where_nothing_was_added():
    table = map_table({"before": atlas()}, {})
    assert table["added"].isna().all()
    assert table["value"].notna().all()
    assert list(table["knot"]) == [1.0, 2.0, 3.0]
    assert list(map_table({"before": atlas()}, {"gap": np.ones(3)})["added"]) == [1.0] * 3


def test_maps_are_drawn_with_fewer_variables_than_panels():
    assert draw_maps({"before": atlas(), "after": atlas()}, {"gap": np.ones(3)}, generated=True).startswith(b"\x89PNG")


def test_evidence_is_drawn_of_candidates_with_and_without_a_null():
    null = Null({Term("reaction_delay"): 1.0}, {Term("reaction_delay"): 0.5}, 7)
    rows = [*VERDICT["candidates"], CURVE | LANE_SCORES | {"variables": ["gap"]}]
    assert draw_evidence(rows, null, generated=True).startswith(b"\x89PNG")
