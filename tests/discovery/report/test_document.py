"""The document of a discovery, in the terminal and on the page, and the maps that it rests on."""

import re
from dataclasses import replace

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
from rearl_jax.discovery.search.variables import Variable
from rearl_jax.discovery.thresholds import THRESHOLDS
from rearl_jax.document.html import page_of
from rearl_jax.document.terminal import text_of
from tests.discovery.made_verdict import FIGURE, KEEP_RIGHT, LANE_SCORES, LOSS, VERDICT

CURVE = {"name": "dependence", "kind": "generic"}
NUMBERS = {"parameters": {}, "confidence": 0.9, "evidence": 50.0}


def atlas() -> Atlas:
    basis = Basis(Variable("gap", np.zeros((2, 1))), np.array([1.0, 2.0, 3.0]), np.full(3, 1 / 3))
    value = np.array([-0.1, 0.0, 0.1])
    curve = Curve(basis, value, value - 0.05, value + 0.05, "acceleration", 0.3, 12.0)
    return Atlas({"gap": curve}, {}, [Selected("gap", 1.0, 1.0)], {"gap": "rises by 0.20 m/s^2"})


def document(atlases=None, **changes):
    """The document of the made verdict with some keys changed."""
    return document_of(DiscoverTask(), VERDICT | changes, map_table(atlases or {"before": atlas()}, {}))


def printed(**changes):
    """The text on the terminal, without line breaks and rules."""
    return " ".join(text_of(document(**changes)).replace("─", "").split())


def folded(title, **changes):
    """A folded section."""
    (section,) = [part for part in document(**changes).sections if part.title == title]
    assert section.is_folded
    return section


def test_the_terminal_says_what_is_missing_how_we_know_and_what_it_changes():
    text = printed()
    parts = (
        "Missing in the model: reaction delay.",
        "GENERATED recordings",
        "closed-loop gap error [m] 1.50 1.50 +1.50 1.00 to 2.00 1.00 to 2.00 +1.00 to +2.00",
        "gap error by the drivers' own noise alone [m] 0.400 1.00 to 2.00",
        "response time beyond the model's [s] +0.650 - +1.00 to +2.00",
        "first half 30 3.00 1.50 1.20 -20.0 %",
        "other drivers, own parameters calibrated to the drive itself: 1.50",
        "That is 90 % of the squared error beyond",
        "Response time beyond the model's: +0.65 s (+1.00 to +2.00) before.",
        "reaction delay delay [s] 0.700 0.90 0.600 to 0.800",
        "The columns themselves show: the <b>speed</b> column is late.",
        "Leader acceleration explains the data equally well; to distinguish: faster changes <i>.",
        "reaction delay 40.0 30.0 20.0 named leader acceleration 40.0 - - not distinguished",
        "Fitted to 36 drivers and checked on 35 others",
        "Made for a test.",
    )
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    assert "of lane choice" not in text


def test_every_protocol_is_explained_and_has_its_measures_on_the_page():
    section = folded("Errors by source of a driver's parameters")
    assert [table.title for table in section.tables] == ["Population", "First half", "In sample"]
    assert section.notes[1].endswith("the second half; 4 drivers were recorded too briefly and are left out.")
    assert section.notes[2].endswith("no driver could be tested.")
    assert [row.title for row in section.tables[1].rows[:4]] == [
        *(f"{name} gap error [m]" for name in ("mean", "median", "pooled")),
        "mean gap error as a share of the gap [-]",
    ]


def test_the_page_has_what_is_folded_escapes_markup_and_has_no_nan():
    body = page_of(document(), DiscoverTask(), {}, data_id="abc")
    for words in ("rises by 0.20 m/s^2", "faster changes", "rear pressure", "&lt;b&gt;speed", "z-score"):
        assert words in body
    assert not re.search(r"<b>speed</b>|<i>", body)
    assert not re.search(r"\bnan\b|\bNone\b", body.split("Complete configuration")[0])


def test_of_two_curves_the_one_that_was_added_is_marked_and_its_values_are_left_to_the_maps():
    gap, speed = (CURVE | LANE_SCORES | {"variables": [name]} for name in ("gap", "speed"))
    values = {f"value_{k}": {"value": 0.3, "low": None, "high": None, "unit": "-"} for k in range(9)}
    effect = CURVE | NUMBERS | {"variables": ["gap"], "parameters": values}
    text = printed(effects=[effect], candidates=[gap, speed])
    assert "dependence on gap a curve through 9 values - 0.90" in text
    assert "dependence on gap 12.0 30.0 20.0 named dependence on speed 12.0 30.0 20.0 Fitted" in text


def test_the_choice_of_the_lane_has_a_table_of_its_own():
    lanes = [KEEP_RIGHT | LANE_SCORES, KEEP_RIGHT | LANE_SCORES | {"name": "politeness", "ambiguous": True}]
    text = printed(
        effects=[KEEP_RIGHT | NUMBERS],
        candidates=[*VERDICT["candidates"] * 7, *lanes],
        lane_choice={"changes": 400, "opportunities": 9000, "loss": LOSS},
    )
    assert "Missing in lane choice: keep right." in text
    assert "gain of the right lane + bias" in text
    following, table = text.split("Candidates of lane choice")
    assert "(the first 12 of 14; candidates.parquet has all)" in following
    assert "keep right 12.0 30.0 20.0 named politeness 12.0 30.0 20.0 not distinguished" in table
    assert "400 changes by choice in 9000 opportunities" in table
    assert "change -0.0500 (-0.0600 to -0.0400) nats" in table


def test_the_page_says_what_the_residual_depends_on_before_and_after():
    seen, title = atlas(), "What the model leaves unexplained"
    repaired = replace(seen, selected=[Selected("gap", 0.1, 0.1)])
    assert folded(title).paragraphs[1].endswith("finds a dependence on gap.")
    both = folded(title, atlases={"before": seen, "after": repaired})
    assert both.paragraphs[1].endswith("finds a dependence on gap. After the repair it finds nothing.")
    assert "at most 30.0 %" in both.paragraphs[2]
    assert [cell.value for cell in both.tables[0].rows[0].cells] == ["100 %", "30.0 %", "rises by 0.20 m/s^2"]


def test_the_largest_share_is_told_even_if_another_variable_gains_more():
    seen = atlas()
    speed = replace(
        seen.curves["gap"], basis=replace(seen.curves["gap"].basis, variable=Variable("speed", np.zeros((2, 1))))
    )
    both = replace(
        seen,
        curves=seen.curves | {"speed": replace(speed, share=0.4, gain=2.0)},
        selected=[*seen.selected, Selected("speed", 0.0, 0.0)],
        shapes=seen.shapes | {"speed": "does not change"},
    )
    told = folded("What the model leaves unexplained", atlases={"before": both}).paragraphs[2]
    assert "at most 40.0 %" in told
    assert "(speed)" in told


def test_the_source_of_each_interval_is_told():
    (told,) = [note for note in folded("Method and definitions").notes if note.startswith("Intervals")]
    assert "time gaps: from resampling drivers" in told
    assert "Of parameters of effects: normal" in told
    assert f"factor of {THRESHOLDS.interval_stretch:g}" in told


def test_the_error_of_an_effect_that_was_told_stands_under_its_name():
    error = VERDICT["error"] | {"after": None, "oracle": VERDICT["error"]["before"]}
    text = printed(effects=[], candidates=[], adequacy=None, lane_choice=None, error=error)
    assert "before with the given effect change" in text
    assert "1.50 (1.00 to 2.00) m for the oracle" in text


def test_the_thresholds_of_a_verdict_have_their_meaning():
    assert "Thresholds of the decision" not in [section.title for section in document().sections]
    (row,) = folded("Thresholds of the decision", thresholds={"least_total": 16.25}).tables[0].rows
    assert (row.title, row.cells[0].value) == ("least total", "16.25")
    assert re.match(r"Total .*\[nats\]", row.cells[1].value)


@pytest.mark.parametrize(
    ("word", "effects", "said"),
    [
        ("nothing", [], "nothing significant is missing"),
        ("named", [], "the given effect was fitted, and no other was searched for"),
        ("named", [KEEP_RIGHT], "missing in lane choice: keep right"),
        ("improved", [], "other drivers are predicted better with a curve without a name"),
        (
            "improved",
            [CURVE | {"variables": ["position"]}],
            "other drivers are predicted better with dependence on position",
        ),
        (
            "artefact",
            [{"name": "speed_lag", "kind": "artefact", "variables": []}, KEEP_RIGHT],
            "fault of the measurement: speed lag; missing in lane choice: keep right",
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


def compared(**changes):
    """A comparison made by hand in which constant time headway was chosen."""
    measures = {measure: dict.fromkeys(("mean", "median", "pooled"), FIGURE) for measure in ("gap_rmse", "speed_rmse")}
    protocols = {"population": measures | {"n_drivers": 35}, "first_half": None, "other_runs": None, "in_sample": None}
    row = {"name": "idm", "n_parameters": 5, "log_likelihood": FIGURE, "gain": dict.fromkeys(FIGURE, 0.0)}
    row |= {"better_share": 0.0, "best_share": 0.02, "is_vetoed": False, "protocols": protocols}
    gain = {"value": 60.0, "low": 40.0, "high": 80.0}
    other = row | {"name": "constant_time_headway", "n_parameters": 6, "gain": gain, "best_share": 0.98}
    last = row | {"name": "krauss", "is_vetoed": True, "protocols": dict.fromkeys(protocols)}
    return {
        "chosen": "constant_time_headway",
        "driver": "idm",
        "differs": True,
        "compared": [row, other, last],
        "drivers": {"fitted": 36, "checked": 35},
        "equilibrium_time_gap": {"10": FIGURE, "20": None},
    } | changes


def test_what_the_usual_car_following_model_lacks_is_said_and_shown():
    text = printed(base=compared())
    parts = (
        "The car-following model constant time headway predicts better than idm, +60 (+40 to +80) nats on 35 "
        "other drivers; missing in the model: "
        "reaction delay.",
        "Car-following models compared (GENERATED recordings) gain [nats] most likely in population [m]",
        "constant time headway +60.0 98.0 % 1.50 chosen +40.0 to +80.0",
        "krauss +0 2.0 % - rejected by simulations",
        "Time gap at equilibrium under constant time headway: 1.50 s (1.00 to 2.00) at 10 m/s.",
    )
    for part in parts:
        assert part in text
    assert "first half [m]" not in text  # nobody could be tested


def test_where_the_usual_model_stays_the_verdict_says_nothing_of_it():
    base = compared(chosen="idm", differs=False)
    assert "lacks" not in printed(base=base)
    assert "No model is significantly better than idm, which is kept." in printed(base=base)
    assert "Car-following models compared" not in printed(base=None)


def test_an_effect_that_depends_on_the_car_following_model_is_said_to():
    effects = [VERDICT["effects"][0] | {"depends_on_base": ["idm", "fvdm"]}]
    text = printed(base=compared(), effects=effects)
    assert "reaction delay (depends on the car-following model: not found with idm and fvdm)" in text
    assert "Reaction delay holds with constant time headway but not with idm and fvdm" in text
