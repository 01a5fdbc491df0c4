"""Hand-made verdicts and what they are worth."""

import math
from dataclasses import replace

import pytest

from rearl_jax.blind.again import judged_of_row
from rearl_jax.blind.details import (
    ALL_LISTED,
    by_set,
    by_strength,
    confidence_calibration,
    oracle_share,
    parameter_rows,
)
from rearl_jax.blind.judging import judge, recoveries
from rearl_jax.blind.questions import Judged, changes_the_model, claims_anything
from rearl_jax.blind.results import BlindResults
from rearl_jax.blind.scores import binomial_interval, score_all
from rearl_jax.blind.verdicts import failed_verdict, read_verdict


def effect(name, kind="driver", confidence=0.9, variables=(), **parameters):
    ends = {key: {"value": value, "low": value - 0.1, "high": value + 0.1} for key, value in parameters.items()}
    about = {"name": name, "kind": kind, "confidence": confidence}
    return about | {"variables": list(variables), "parameters": ends}


def said(*effects, verdict=None, alternatives=(), **errors):
    error = {name: {"value": value, "low": value - 0.2, "high": value + 0.2} for name, value in errors.items()}
    return {
        "verdict": verdict or ("named" if effects else "nothing"),
        "effects": list(effects),
        "candidates": [{"name": name, "ambiguous": True} for name in alternatives] + [{"name": "weather"}],
        "error": {"measure": "m", "n_drivers": 36, "floor": None, "oracle": None, **error},
        "data": {},
        "seconds": 2.0,
    }


def hidden(
    *names, group="named", kind="listed", truths=None, variables=(), strength=1.0, source="traffic", **parameters
):
    planted = [
        {"name": name, "strength": strength, "kind": kind, "truths": [name] if truths is None else truths,
         "variables": list(variables), "parameters": parameters}
        for name in names
    ]  # fmt: skip
    return {"group": group, "variant": "+".join(names) or "default", "source": source, "planted": planted}


NAMELESS = hidden("distraction", kind="unlisted", truths=[])
FORCED = hidden(group="control") | {"scenario": {"lane_changes": 12}}
GRADE, DELAY = effect("grade", "road"), effect("reaction_delay")
POLITENESS = effect("politeness", variables=["gain_of_others"])

CASES = {
    "named": (hidden("grade"), said(GRADE), "right"),
    "and another": (hidden("grade"), said(GRADE, DELAY), "more"),
    "another": (hidden("grade"), said(DELAY), "wrong"),
    "another, but not alone": (hidden("grade"), said(DELAY, alternatives=["grade"]), "ambiguous"),
    "nothing": (hidden("grade"), said(), "nothing"),
    "unexplained": (hidden("grade"), said(verdict="unexplained"), "unexplained"),
    "other name": (hidden("bend", truths=["bend", "speed_limit"]), said(effect("speed_limit", "road")), "right"),
    "control": (hidden(group="control"), said(), "right"),
    "control, named": (hidden(group="control"), said(DELAY), "wrong"),
    "control, unexplained": (hidden(group="control"), said(verdict="unexplained"), "unexplained"),
    "variable": (
        hidden("rain", kind="unlisted", truths=[], variables=["time"]),
        said(effect("dependence", "generic", variables=["time"])),
        "right",
    ),
    "variable of a named effect": (
        hidden("rain", kind="unlisted", truths=[], variables=["time"]),
        said(effect("weather", "road")),
        "right",
    ),
    "wrong variable": (
        hidden("rain", kind="unlisted", truths=[], variables=["time"]),
        said(effect("dependence", "generic", variables=["lane"])),
        "wrong",
    ),
    "nameless, noticed": (NAMELESS, said(DELAY, verdict="unexplained"), "unexplained"),
    "nameless, explained away": (NAMELESS, said(DELAY), "wrong"),
    "nameless with a name": (hidden("action_points", kind="unlisted"), said(effect("action_points")), "right"),
    "one of two": (hidden("grade", "reaction_delay"), said(GRADE), "part"),
    "both": (hidden("grade", "reaction_delay"), said(DELAY, GRADE), "right"),
    "same artefact": (hidden("speed_scale", kind="artefact"), said(effect("position_scale", "artefact")), "right"),
    "politeness in forced changes": (FORCED, said(POLITENESS), "wrong"),
    "failed": (hidden("grade"), failed_verdict("ValueError: no", 1.0), "failed"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_outcome(name):
    truth, verdict, expected = CASES[name]
    assert judge(truth, read_verdict(verdict)).outcome == expected


def judged(truth, verdict):
    found = read_verdict(verdict)
    return Judged("x", truth, found, judge(truth, found), tuple(recoveries(truth, found)))


@pytest.mark.parametrize("name", CASES)
def test_a_row_of_the_table_is_judged_as_the_verdict_was(name):
    case = judged(*CASES[name][:2])
    table = BlindResults([case], 1).case_table()
    assert set(table["outcome"]) == {case.judgement.outcome}
    (row,) = table.astype(object).where(table.notna(), None).to_dict("records")
    again = judged_of_row(case.truth, row)
    # The table holds neither confidences nor the kinds of names that are no artefacts.
    first, second = (replace(one.judgement, claims=(), false_kinds=()) for one in (case, again))
    assert first == second
    is_artefact = [[kind == "artefact" for kind in one.judgement.false_kinds] for one in (case, again)]
    assert is_artefact[0] == is_artefact[1]
    assert (claims_anything(case), changes_the_model(case)) == (claims_anything(again), changes_the_model(again))


def rates(cases):
    return {score.name: (score.n_hits, score.n_cases) for score in score_all(cases)}


def test_rates_count_what_they_say():
    cases = [
        judged(hidden("grade"), said(GRADE)),
        judged(hidden("grade"), said(DELAY, alternatives=["grade"])),
        judged(hidden("grade"), said(DELAY)),
        judged(hidden(group="control"), said()),
        judged(hidden(group="control"), said(effect("lens", "artefact"))),
        judged(hidden("lens", group="artefact", kind="artefact"), said(GRADE)),
        judged(hidden("grade", "reaction_delay", group="two"), said(GRADE, verdict="unexplained")),
        judged(hidden("rain", group="unlisted", kind="unlisted", truths=[], variables=["time"]), said()),
        judged(hidden("krauss", group="sumo", source="sumo", kind="unlisted", truths=[]), said(verdict="unexplained")),
    ]
    found = rates(cases)
    assert found["identified"] == (1, 3)
    assert found["in_set"] == (2, 3)
    assert found["wrong_name"] == (2, 3)  # also where the right one is among the alternatives
    assert found["control_false"] == (0, 2)  # an artefact named is no effect named
    assert found["control_clean"] == (1, 2)
    assert found["artefact_as_effect"] == (1, 1)
    assert found["both_named"] == (0, 1)
    assert found["one_and_flagged"] == (1, 1)
    assert found["variable"] == (0, 1)
    assert found["sumo_other"] == (1, 1)
    assert found["failed"] == (0, 9)
    assert "half_identified" not in found


@pytest.mark.parametrize(("group", "question"), [("named", "wrong_name"), ("half", "half_wrong")])
def test_a_name_that_is_not_there_counts_beside_the_right_one(group, question):
    truth = hidden("grade", group=group)
    found = rates([
        judged(truth, said(GRADE)),
        judged(truth, said(GRADE, DELAY)),
        judged(truth, said(DELAY)),
        judged(truth, said(GRADE, effect("dependence", "generic", variables=["speed"]))),
        judged(truth, said(GRADE, DELAY, verdict="unexplained")),
        judged(truth, said(verdict="unexplained")),
    ])  # fmt: skip
    assert found[question] == (4, 6)


def test_names_that_are_not_there_are_counted_by_set():
    rain = hidden("rain", group="unlisted", kind="unlisted", truths=[], variables=["time"])
    cases = [
        judged(hidden("grade"), said(GRADE)),
        judged(hidden("grade"), said(GRADE, DELAY)),
        judged(hidden("grade", group="double", strength=2.0), said(GRADE, DELAY)),
        judged(hidden("grade", "reaction_delay", group="two"), said(GRADE, effect("weather", "road"))),
        judged(hidden("grade", "reaction_delay", group="two"), said(GRADE, DELAY)),
        judged(hidden("leader_length", group="confusable", kind="unlisted"), said(DELAY)),
        judged(hidden(group="control"), said(DELAY)),
        judged(hidden("lens", group="artefact", kind="artefact"), said(effect("lens", "artefact"))),
        judged(rain, said(effect("weather", "road"), DELAY)),
        judged(hidden("distraction", group="unlisted", kind="unlisted", truths=[]), said(DELAY, verdict="unexplained")),
        judged(hidden("acc", group="sumo", source="sumo", kind="unlisted", truths=[]), said(DELAY)),
    ]
    rows = {row["set"]: row for row in by_set(reversed(cases))}
    assert {name: (row["n_false"], row["n"]) for name, row in rows.items()} == {
        ALL_LISTED: (3, 5), "named": (1, 2), "artefact": (0, 1), "control": (1, 1), "double": (1, 1),
        "unlisted, no variable": (1, 1), "unlisted, over a variable": (1, 1), "two": (1, 2), "confusable": (1, 1),
        "SUMO acc": (1, 1),
    }  # fmt: skip
    assert next(iter(rows)) == ALL_LISTED
    assert (rows["named"]["n_right"], rows["named"]["n_more"]) == (1, 1)
    assert (rows["two"]["n_right"], rows["two"]["n_part"]) == (1, 1)
    assert (rows["named"]["low"], rows["named"]["high"]) == binomial_interval(1, 2)
    summary = BlindResults(cases, len(cases)).summary()
    assert (summary["n_false"], summary["n_more"], summary["n_wrong"]) == (8, 3, 3)


def test_effects_on_the_choice_of_the_lane_are_asked_for_on_their_own():
    lanes, free = hidden("keep_right", group="lane_choice"), hidden(group="lane_choice_control")
    found = rates([
        judged(lanes, said(effect("keep_right", variables=["side"]))),
        judged(lanes, said(effect("truck_aversion"))),
        judged(free, said()),
        judged(free, said(POLITENESS)),
    ])  # fmt: skip
    assert found["lane_choice_identified"] == (1, 2)
    assert found["lane_choice_false"] == (1, 2)
    assert not {"identified", "control_false"} & set(found)


def test_confusable_pairs_ask_for_the_true_one_alone():
    cases = [
        judged(hidden("grade", group="confusable"), said(GRADE)),
        judged(hidden("grade", group="confusable"), said(GRADE, alternatives=["speed_limit"])),
    ]
    assert rates(cases)["confusable_in_set"] == (2, 2)
    assert rates(cases)["confusable_alone"] == (1, 2)


def test_binomial_interval_is_exact():
    """At each end the tail beyond the count holds 2.5 %, summed term by term."""

    def at_least(n_hits, n_cases, rate):
        return sum(math.comb(n_cases, k) * rate**k * (1 - rate) ** (n_cases - k) for k in range(n_hits, n_cases + 1))

    low, high = binomial_interval(62, 65)
    assert at_least(62, 65, low) == pytest.approx(0.025)
    assert at_least(63, 65, high) == pytest.approx(0.975)
    assert binomial_interval(0, 30) == pytest.approx((0.0, 1 - 0.025 ** (1 / 30)))
    assert binomial_interval(30, 30) == pytest.approx((0.025 ** (1 / 30), 1.0))


def test_goals_are_met_or_not():
    met = {score.name: score.is_met for score in score_all([judged(hidden("grade"), said(GRADE))])}
    assert met["identified"]
    assert met["wrong_name"]
    met = {score.name: score.is_met for score in score_all([judged(hidden("grade"), said(DELAY))])}
    assert not met["identified"]
    assert not met["wrong_name"]


def test_parameters_are_compared_where_they_mean_the_same():
    cases = [
        judged(hidden("reaction_delay", delay=0.7), said(effect("reaction_delay", delay=0.65))),
        judged(hidden("reaction_delay", delay=0.7), said(effect("reaction_delay", delay=0.45))),
        judged(hidden("reaction_delay", delay=0.7), said(GRADE)),
    ]
    (row,) = parameter_rows(cases)
    assert (row["effect"], row["parameter"], row["n"]) == ("reaction_delay", "delay", 2)
    assert row["bias"] == pytest.approx(-0.15)
    assert row["coverage"] == 0.5


def test_oracle_share_is_of_squared_errors():
    cases = [judged(hidden("grade"), said(GRADE, before=3.0, after=1.5, oracle=1.0))]
    share, n = oracle_share(cases)
    assert n == 1
    assert share == pytest.approx((9 - 2.25) / (9 - 1))
    assert oracle_share([judged(hidden("grade"), said(GRADE, before=3.0, after=1.0))]) == (None, 0)


def test_error_that_fell_beyond_its_interval():
    found = rates([
        judged(hidden("grade"), said(GRADE, before=3.0, after=1.0)),
        judged(hidden("grade"), said(GRADE, before=1.1, after=1.0)),
    ])  # fmt: skip
    assert found["error_fell"] == (1, 2)


def test_stated_confidence_is_compared_with_what_is_there():
    cases = [
        judged(hidden("grade"), said(effect("grade", "road", confidence=0.97))),
        judged(hidden("grade"), said(effect("reaction_delay", confidence=0.6))),
        judged(hidden("grade"), said(effect("grade", "road", confidence=0.7))),
    ]
    low, high = confidence_calibration(cases)
    assert (low["n_claims"], low["true"]) == (2, 0.5)
    assert low["stated"] == pytest.approx(0.65)
    assert (high["n_claims"], high["true"]) == (1, 1.0)


def test_strengths_are_kept_apart():
    cases = [
        judged(hidden("grade"), said(GRADE)),
        judged(hidden("grade", group="half", strength=0.5), said()),
        judged(hidden("grade", group="half_four_times", strength=0.5), said(GRADE)),
    ]
    rows = {(row["effect"], row["strength"]): row["rate"] for row in by_strength(cases)}
    assert rows == {("all", 0.5): 0.0, ("all", 1.0): 1.0, ("grade", 0.5): 0.0, ("grade", 1.0): 1.0}
    beside = by_strength([judged(hidden("grade"), said(GRADE, DELAY)), judged(hidden("grade"), said(GRADE))])
    assert [(row["n"], row["n_named"], row["n_false"]) for row in beside] == [(2, 2, 1), (2, 2, 1)]


@pytest.mark.parametrize("key", ["verdict", "effects", "candidates", "error", "seconds"])
def test_a_verdict_without_a_key_is_refused(key):
    verdict = said(GRADE)
    del verdict[key]
    with pytest.raises(ValueError, match=key):
        read_verdict(verdict)


def test_what_two_effects_share_is_no_truth_of_either():
    """A delay that an anticipation takes back can be found only as the difference."""
    pair = hidden("reaction_delay", "anticipation", truths=["reaction_delay"], delay=0.7)
    said_delay = said(effect("reaction_delay", delay=0.3))
    assert judged(hidden("reaction_delay", delay=0.7), said_delay).recoveries
    assert not judged(pair, said_delay).recoveries


def test_errors_are_compared_driver_by_driver():
    lower = judged(hidden("grade"), said(GRADE, before=2.0, after=1.9, change=-0.3))
    unsure = judged(hidden("grade"), said(GRADE, before=2.0, after=1.9, change=-0.1))
    higher = judged(hidden("grade"), said(GRADE, before=2.0, after=2.3, change=0.3))
    found = rates([lower, unsure, higher])
    assert found["error_surely_fell"] == (1, 3)
    assert found["error_rose"] == (1, 3)
    krauss = hidden("sumo_krauss", group="sumo", kind="unlisted", truths=[], source="sumo")
    assert rates([judged(krauss, said(DELAY, change=-0.1)), judged(krauss, said())])["sumo_error"] == (1, 1)
