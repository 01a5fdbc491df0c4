"""Figures of the kept blind study in README and pages, compared with its tables."""

import json
from collections import Counter

import pandas as pd
import pytest

from rearl_jax.blind.traffic.catalogue import LISTED
from rearl_jax.blind.traffic.measurement import ARTEFACTS
from rearl_jax.blind.traffic.scenario import Scenario
from tests.docs.blocks import DOCS, ROOT

FOLDER = ROOT / "results" / "kept" / "blind_fourth"
SUMO_OTHERS = ("eidm", "krauss", "acc", "cacc")
SUMO_LISTED = ("idm_no_passing_right", "idm_limit")


def table(name):
    return pd.read_parquet(FOLDER / f"{name}.parquet")


def text_of(page):
    """The page on one line."""
    return " ".join(page.read_text(encoding="utf-8").split())


@pytest.fixture(scope="module")
def readme():
    return text_of(ROOT / "README.md")


@pytest.fixture(scope="module")
def page():
    return text_of(DOCS / "discovery" / "blind.md")


@pytest.fixture(scope="module")
def sets():
    return table("sets").set_index("set")


@pytest.fixture(scope="module")
def cases():
    return table("cases")


@pytest.fixture(scope="module")
def scores():
    return table("scores").set_index("name")


def false_names(cases, name, variant=None, source="traffic"):
    """Names that are not there in the data sets of one set, data set by data set."""
    chosen = cases[(cases["set"] == name) & (cases["source"] == source) & (cases["false"] != "")]
    if variant is not None:
        chosen = chosen[chosen["variant"] == variant]
    return Counter(f"{row['variant']}: {row['false']}" for row in chosen.to_dict("records"))


SAYS = {"named": ("n_right", "n_more"), '"nothing"': ("n_right",), '"unexplained"': ("n_unexplained",)}
"""Outcomes that are what should be said; where it is something else, those of `named`."""

LINES = (
    (f"an effect of the library, usual strength ({len(LISTED)} effects, 10 data sets each)", "named", ["named"]),
    ("the same at half strength", "named", ["half"]),
    ("at half strength, with four times the data", "named", ["half_four_times"]),
    ("at a quarter of the strength", "named", ["quarter"]),
    ("at twice the strength", "named", ["double"]),
    ("in records of 14 s", "named", ["short"]),
    ("an effect on lane choice", "named", ["lane_choice"]),
    ("two effects at once", "both named", ["two"]),
    ("one of two similar effects", "only the right effect", ["confusable"]),
    ("two opposite effects that nearly cancel", "the difference named", ["cancelling"]),
    ("an effect outside the library, over a measured variable", "the right variable", ["unlisted, over a variable"]),
    ("action points, misjudged gaps, distraction", '"unexplained"', ["unlisted, no variable"]),
    (f"a measurement fault ({len(ARTEFACTS)} faults, 10 data sets each)", "named", ["artefact"]),
    ("nothing", '"nothing"', ["control"]),
    ("nothing, with free lane changes", '"nothing"', ["lane_choice_control"]),
    ("SUMO: nothing", '"nothing"', ["SUMO idm"]),
    ("SUMO: an effect of the library", "named", [f"SUMO {model}" for model in SUMO_LISTED]),
    ("SUMO: decisions every .8 s", "named as a delay", ["SUMO idm_action_steps"]),
    ("SUMO: other driver models", '"unexplained"', [f"SUMO {model}" for model in SUMO_OTHERS]),
)
"""Rows of the page's table: what is hidden, the right outcome, and the sets."""


def line_of(hidden, said, row):
    """A row of the page's table."""
    right = SAYS.get(said, SAYS["named"])
    words = {"n_nothing": '"nothing"', "n_unexplained": '"unexplained"', "n_wrong": "false effect only"}
    words |= {"n_ambiguous": "among the alternatives", "n_part": "one of two", "n_failed": "stopped", "n_more": "more"}
    other = [f"{row[key]} {word}" for key, word in words.items() if row[key] and key not in right]
    line = (
        f"| {hidden} | {row['n']} | {sum(row[key] for key in right)} {said} | {', '.join(other)} | {row['n_false']} |"
    )
    return line.replace("|  |", "| |")


def test_the_table_of_the_page(page, sets):
    counts = sets.drop(columns=["rate", "low", "high"])
    lines = [line_of(hidden, said, counts.loc[names].sum().to_dict()) for hidden, said, names in LINES]
    heading = "| hidden | data sets | correct | other outcomes | with a false effect | |---|---|---|---|---|"
    assert f"{heading} {' '.join(lines)} - **False effects**" in page
    shown = [name for _, _, names in LINES for name in names]
    assert sorted(shown) == sorted(set(sets.index) - {"all with effects of the list"})
    assert counts.loc[shown, "n"].sum() == 802


def test_the_table_of_readme(readme, sets):
    named, half, control, listed = (
        sets.loc[name] for name in ("named", "half", "control", "all with effects of the list")
    )
    hits = [f"{row['n_right'] + row['n_more']:.0f} of {row['n']:.0f}" for row in (named, half, control)]
    assert f"{hits[0]} at usual strength, {hits[1]} at half strength | " in readme
    assert f"Is nothing reported if nothing is hidden? *Generated data* | {hits[2]} |" in readme
    assert control["n_more"] == 0
    assert (
        "in addition to the hidden one or instead of it? *Generated data* | "
        f"{listed['n_false']:.0f} of {listed['n']:.0f} |" in readme
    )


def test_what_of_two_alike_is_named_is_alone(sets, scores):
    assert scores.n_hits["confusable_alone"] == sets.n_right["confusable"]


def test_false_effects(page, sets):
    listed = sets.loc["all with effects of the list"]
    n, n_false, n_more, n_wrong = (int(listed[key]) for key in ("n", "n_false", "n_more", "n_wrong"))
    assert n_false == n_more + n_wrong
    low, high = 100 * listed["low"], 100 * listed["high"]
    ends = f"{low:.1f} to {high:.1f} %".removeprefix("0")
    share = f"({100 * listed['rate']:.1f} %, 95 % interval {ends})"
    hiding = "data sets that hide only effects of the library"
    assert f"{n_false} of the {n} {hiding} {share}, {n_more} of them in addition to the right effect" in page
    assert f"### False effects in the {n} data sets" in page
    limits = text_of(DOCS / "discovery" / "limits.md")
    n_sumo = sum(int(sets.n_false[f"SUMO {model}"]) for model in SUMO_LISTED)
    cancelling = sets.loc["cancelling"]
    assert f"in addition to the right effect in {n_more} of the {n} {hiding}, and alone in {n_wrong} of them" in limits
    assert f"in {cancelling['n_false']:.0f} of {cancelling['n']:.0f} where two opposite effects nearly cancel" in limits
    assert f"in {n_sumo} of 10 SUMO data sets with an effect of the library" in limits
    limitations = text_of(DOCS / "limitations.md")
    assert f"in the stored blind study {n_false} of {n} data sets with effects of the library" in limitations


def test_figures_below_the_table(page, cases, scores):
    summary = json.loads((FOLDER / "summary.json").read_text(encoding="utf-8"))
    assert (cases["n_drivers"].median(), Scenario(1).duration, summary["n_cases"]) == (36, 60.0, 802)
    assert "holds all 802 data sets of `blind.size=full`, most of them with 36 drivers of 60 s" in page
    share, n_oracles = summary["oracle_share"], summary["n_oracles"]
    oracle = "of the error reduction of the oracle, which knows the hidden effect"
    assert f"repaired models recover {100 * share:.0f} % {oracle} ({n_oracles} data sets)" in page
    rose, n_changed = (int(scores[key]["error_rose"]) for key in ("n_hits", "n_cases"))
    named = cases[cases["named"] != ""]["named"]
    assert n_changed == sum(not set(names.split("+")) <= set(ARTEFACTS) for names in named)
    assert f"Of {n_changed} repaired models, {rose} † have a significantly larger error than before" in page
    parameters = table("parameters")
    n = int(parameters["n_intervals"].sum())
    covered = round((parameters["coverage"] * parameters["n_intervals"]).sum())
    assert f"{covered} of {n} intervals ({100 * covered / n:.0f} %) contain the true value" in page
    low, high = (dict(row) for _, row in table("calibration").iterrows())
    n_low, n_high = (f"{row['true'] * row['n_claims']:.0f} of {row['n_claims']:.0f}" for row in (low, high))
    assert (high["from"], low["to"]) == (0.95, 0.5)
    assert f"with a confidence of .95 or more, {n_high} are in the data ({100 * high['true']:.0f} %)" in page
    assert f"with .5 or less, {n_low}." in page


def test_goals_that_were_missed(page, scores):
    missed = scores[~scores["is_met"]]
    goals = {"cancelling_false": 0, "confusable_in_set": 100, "sumo_error": 95, "error_rose": 0, "error_fell": 80}
    assert set(missed.index) == set(goals)
    assert all(scores.goal[name].endswith(f" {goal} %") for name, goal in goals.items())
    hits = {name: f"{row['n_hits']} of {row['n_cases']}" for name, row in scores.iterrows()}
    marked = {name: f"{row['n_hits']} † of {row['n_cases']}" for name, row in scores.iterrows()}
    named, control = (100 * scores.loc[name, ["low", "high"]] for name in ("identified", "control_false"))
    surely = scores.n_hits["error_surely_fell"]
    for said in (
        f"{len(missed)} of the {len(scores)} goals were missed",
        f"no false effect where two opposite effects nearly cancel | {hits['cancelling_false']} have one |",
        f"the true one of two similar effects is always kept | {hits['confusable_in_set']} |",
        "a lower error for 95 % of the repaired models on SUMO's action steps and other models | "
        f"{hits['sumo_error']} |",
        f"no significantly larger error after a repair | {marked['error_rose']} |",
        "an error reduction beyond its interval for 80 % of the named effects | "
        f"{marked['error_fell']}; driver by driver {surely} † |",
        f"{hits['identified']} is {named['low']:.1f} to {named['high']:.1f} %",
        f"{scores.n_hits['control_false']} false effect in {scores.n_cases['control_false']} controls is "
        f"{control['low']:.0f} to {control['high']:.1f} %",
    ):
        assert said in page


def test_false_effects_in_addition_to_listed_ones(page, cases):
    assert false_names(cases, "named") == {"resignation: weather": 1, "no_undertaking: lens+grade": 1}
    assert (
        "Usual strength: weather in addition to resignation; a camera distortion and a slope in addition to the" in page
    )
    assert false_names(cases, "half_four_times") == {"speed_dependent_time_gap: dependence": 1}
    assert "Half strength with four times the data: a free curve in addition to a speed-dependent time gap" in page
    assert false_names(cases, "double") == {
        "resignation: weather": 2, "lane_friction: grade": 1, "reaction_delay: variance_driven_time_gap": 1,
    }  # fmt: skip
    assert (
        "weather in addition to resignation (twice); a slope in addition to friction between lanes; a time gap that"
        in page
    )
    assert false_names(cases, "quarter") == {"speed_limit: grade": 1}
    assert "A quarter of the strength: a slope instead of a speed limit" in page
    assert not any(
        false_names(cases, name) for name in ("half", "short", "two", "confusable", "lane_choice", "artefact")
    )


def test_what_was_missed(page, cases):
    strengths = table("strengths").query("effect != 'all'")
    usual, half = (strengths[strengths["strength"] == value].set_index("effect") for value in (1.0, 0.5))
    few = usual[usual["n_named"] < usual["n"]]
    assert dict(few["n"] - few["n_named"]) == {"speed_dependent_time_gap": 2, "leader_class": 1}
    assert set(usual["n"]) == {10}
    missed = cases[(cases["set"] == "confusable") & (cases["outcome"] != "right")]
    assert list(missed["variant"]) == ["leader_class"]
    assert (
        "speed-dependent time gap was `unexplained` in 2 of 10 at usual strength, the leader's class in 1 of 10 and in "
        "1 of the 3" in page
    )
    assert set(half["n"]) == {5}
    assert dict(half["n_named"][half["n_named"] < 5]) == {
        "speed_dependent_time_gap": 0, "lane_desired_speed": 1, "leader_class": 3, "resignation": 3, "asymmetry": 4,
        "relaxation": 4,
    }  # fmt: skip
    assert (
        "a speed-dependent time gap was named in 0 of 5, a lane's own desired speed in 1 of 5, the leader's class "
        "and resignation in 3 of 5, asymmetry and relaxation in 4 of 5, every other effect in 5 of 5" in page
    )


def test_what_was_said_in_other_sets(page, cases, sets):
    assert false_names(cases, "control") == {"camera: asymmetry": 1}
    assert (sets.n_unexplained["control"], sets.n["control"]) == (1, 108)
    assert "asymmetry was named in one of 108, in a camera's view; another of these was `unexplained`" in page
    assert sum(false_names(cases, "cancelling").values()) == 3
    assert "a free curve or another effect in addition to the difference in 3 of 10" in page
    assert false_names(cases, "unlisted", "roadworks") == {"roadworks: dependence": 2}
    assert "a free curve over another variable in addition to the right one in 2 of 5" in page
    acting = false_names(cases, "unlisted", "action_points")
    assert (sets.n_unexplained["unlisted, no variable"], sets.n_false["unlisted, no variable"]) == (20, 6)
    assert (sum(acting.values()), sum(n for said, n in acting.items() if "reaction_delay" in said)) == (5, 4)
    assert (
        "all 20 `unexplained`, and 6 of them with a false effect, 5 of these for action points, of which 4 are a"
        in page
    )
    for model in SUMO_LISTED:
        said = false_names(cases, "sumo", model, "sumo")
        assert sum(n for names, n in said.items() if "resignation" in names) == sum(said.values()) == 2
    assert (
        "passing on the right: resignation in addition in 2 of 5. SUMO's speed limit: resignation in addition in "
        "2 of 5, once with the limit only among the alternatives" in page
    )
    assert sets.n_ambiguous["SUMO idm_limit"] == 1


def test_what_was_said_of_other_driver_models(page, cases, sets):
    others = cases[cases["variant"].isin(SUMO_OTHERS) & (cases["source"] == "sumo")]
    unexplained = others[others["outcome"] == "unexplained"]
    assert (len(others), len(unexplained), sum(unexplained["false"] != "")) == (20, 19, 18)
    assert "19 of 20 `unexplained`, 18 of these with a false effect. For EIDM asymmetry alone was named once" in page
    assert list(others["named"][others["outcome"] == "wrong"]) == ["asymmetry"]
    acc = others[others["variant"] == "acc"]
    assert (len(acc), sum(acc["named"] != ""), sum(acc["change"] > 0)) == (5, 5, 3)
    assert "ACC: all 5 models were changed; in 3 the error of other drivers is larger afterwards" in page
