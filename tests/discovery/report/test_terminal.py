"""The verdict as the terminal prints it."""

import pytest

from rearl_jax.discovery.report.terminal import print_verdict
from rearl_jax.discovery.report.words import verdict_words
from tests.discovery.made_verdict import KEEP_RIGHT, LANE_SCORES, LOSS, VERDICT

CURVE = {"name": "dependence", "kind": "generic"}
NUMBERS = {"parameters": {}, "confidence": 0.9, "evidence": 50.0}
REAR_GAP = {"name": "lane_choice_dependence", "kind": "generic", "variables": ["rear_gap"], **NUMBERS}


@pytest.fixture(autouse=True)
def wide(monkeypatch):
    monkeypatch.setenv("COLUMNS", "300")


def line_of(text, start):
    (line,) = [line for line in text.splitlines() if line.strip().startswith(start) and ":" not in line]
    return line.split()


def test_of_two_curves_the_one_that_was_added_is_marked(capsys):
    gap, speed = (CURVE | LANE_SCORES | {"variables": [name]} for name in ("gap", "speed"))
    effect = CURVE | NUMBERS | {"variables": ["gap"]}
    print_verdict(VERDICT | {"effects": [effect], "candidates": [gap, speed]})
    said = capsys.readouterr().out
    assert line_of(said, "dependence on gap")[-1] == "named"
    assert line_of(said, "dependence on speed")[-1] == "20.0"
    assert "choice of the lane" not in said
    assert "made for a test" in said


def test_the_choice_of_the_lane_has_a_table_of_its_own(capsys):
    lanes = [KEEP_RIGHT | LANE_SCORES, KEEP_RIGHT | LANE_SCORES | {"name": "politeness", "ambiguous": True}]
    verdict = VERDICT | {
        "effects": [KEEP_RIGHT | NUMBERS],
        "candidates": [*VERDICT["candidates"] * 6, *lanes],
        "lane_choice": {"changes": 400, "opportunities": 9000, "loss": LOSS},
    }
    print_verdict(verdict)
    following, table = capsys.readouterr().out.split("choice of the lane: 400 changes by choice")
    assert "missing in the choice of the lane: keep right [36 drivers fitted" in following
    assert line_of(table, "keep right")[-1] == "named"
    assert line_of(table, "politeness")[-3:] == ["not", "told", "apart"]
    assert "gain of the right lane + bias" in table


def test_what_no_effect_of_the_library_does_is_said_to_be_in_no_model(capsys):
    print_verdict(VERDICT | {"verdict": "unexplained", "effects": [REAR_GAP]})
    said = " ".join(capsys.readouterr().out.split())
    assert "lane choice dependence on rear_gap: ; confidence 0.90; not in model.yaml" in said


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
