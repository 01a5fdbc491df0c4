"""Figures of discovery in measured recordings on README and pages, compared with the kept verdict."""

import json

import pandas as pd
import pytest

from tests.docs.blocks import DOCS, ROOT


@pytest.fixture(scope="module")
def verdict():
    return json.loads((ROOT / "results" / "kept" / "discover_i80" / "verdict.json").read_text(encoding="utf-8"))


def text_of(page):
    """The page on one line."""
    return " ".join(page.read_text(encoding="utf-8").split())


@pytest.fixture(scope="module")
def page():
    return text_of(DOCS / "discovery" / "recordings.md")


def test_no_verdict_is_named(verdict, page):
    assert verdict["verdict"] == "unexplained"
    assert "no verdict is `named`" in page
    assert "The verdict is `unexplained`" in page
    (added,) = verdict["effects"]
    assert (added["name"], added["confidence"]) == ("leader_acceleration", 0.5)
    value, low, high = (f"{added['parameters']['gain'][end]:.2f}".lstrip("0") for end in ("value", "low", "high"))
    assert f"a gain of {value} ({low} to {high}) with a confidence of .5" in page
    delay, lens = verdict["candidates"][:2]
    assert (delay["name"], delay["result"]) == ("reaction_delay", "predicts_no_better")
    assert f"a reaction delay gains {delay['check']:.0f} nats on other drivers one time step ahead" in page
    assert (lens["name"], lens["result"]) == ("lens", "predicts_no_better")
    assert f"a distortion by the camera that gains {lens['check']:.0f} nats" in page
    assert {failed["test"] for failed in verdict["failed_tests"]} == {"denied", "misjudged_gaps"}


def test_the_model_and_what_predicts_drivers(verdict, page):
    base = verdict["base"]
    (gain,) = (row["gain"] for row in base["compared"] if row["name"] == base["chosen"] == "fvdm")
    n = base["drivers"]["checked"]
    words = f"more likely than IDM by {gain['value']:.0f} nats ({gain['low']:.0f} to {gain['high']:.0f}) on {n} other"
    assert words in page
    less = {key: -100 * value for key, value in known(verdict)["population_share"].items()}
    assert f"by {less['value']:.0f} % ({less['high']:.0f} to {less['low']:.0f} %)" in page


def test_the_time_gap_varies_within_drivers(verdict, page):
    varied = verdict["time_gap_variation"]
    size = f"varies by {varied['time_gap']:.2f} s".replace("0.", ".")
    assert f"{size} (standard deviation for the median driver) over {varied['time']:.0f} s" in page
    score = varied["energy_score"]
    ends = f"from {score['before']['value']:.2f} to {score['varying']['value']:.2f} m"
    assert score["change"]["high"] < 0
    assert f"{ends} ({change_words(score['change'])})" in page


def change_words(change):
    """The interval of a change, without zeros before the point."""
    low, high = (f"{change[key]:.2f}".replace("0.", ".") for key in ("low", "high"))
    return f"change {low} to {high}"


def test_the_gap_at_the_start_predicts(verdict, page):
    population, own = "with parameters of the population", "with those of the driver's first half"
    words = f"by {{}} % ({{}} to {{}} %) {population}, and by {{}} % ({{}} to {{}} %) {own}"
    figures = []
    for name in ("population", "first_half"):
        share = verdict["error"]["protocols"][name]["gap_rmse"]["mean"]["change_share"]
        assert share["high"] < 0
        figures += [f"{-100 * share[end]:.0f}" for end in ("value", "high", "low")]
    assert words.format(*figures) in page


def test_readme(verdict):
    readme, found = text_of(ROOT / "README.md"), known(verdict)
    assert f"*Measured*, {verdict['error']['n_drivers']} other drivers" in readme
    population, own, repaired = (f"{found[state]['value']:.2f} m" for state in ("population", "before", "after"))
    assert f"with parameters of the population {population}, with those of the driver's first half {own}" in readme
    assert f"(time gaps vary within a driver) {repaired}" in readme


@pytest.fixture(scope="module")
def real():
    """Summary and table of the kept study of real traffic."""
    folder = ROOT / "results" / "kept" / "study_real"
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    return summary, pd.read_parquet(folder / "real.parquet").set_index(["set", "group"])


def test_known_time_gaps_of_cars(real, page):
    summary, _ = real
    within = f"{summary['n_within']} of {summary['n_known']}"
    shorter = f"{summary['n_shorter']} of {summary['n_cars']}"
    said = f"{within} within .15 s after calibration; shorter in the short setting in {shorter} |"
    assert said in text_of(ROOT / "README.md")
    assert summary["n_shorter"] == summary["n_cars"]
    assert "Every car keeps a shorter time gap in S than in L" in page
    assert summary["is_leader_equal"]
    assert f"Of {summary['leader_cars']} people who drove behind" in page


def test_nothing_is_added_that_predicts_worse(real, page):
    summary, table = real
    assert summary["n_worse"] == summary["n_named"] == summary["n_improved"] == 0
    assert "No driver effect was named in a real recording" in text_of(ROOT / "README.md")
    assert (table[[f"{name}_change_share" for name in ("population", "first_half", "other_runs")]].fillna(0) <= 0).all(
        axis=None
    )
    changed = table.index[table["population_change_share"] != 0]
    assert set(changed) == {("i80", "all")}
    assert "No effect is added to these models" in page
    behind_people = table.loc[("fhwa", "person")]
    assert (table.loc[("fhwa", "ACC"), "base"], behind_people["base"]) == ("idm", "fvdm")
    for name in ("population", "first_half", "other_runs"):
        assert behind_people[f"{name}_idm_share_low"] < 0 < behind_people[f"{name}_idm_share_high"]
    people = table.loc[("openacc_people", "people")]
    assert (people["base"], people["verdict"]) == ("constant_time_headway", "unexplained")
    assert f"lower than those of IDM by {lower(people, 'population')} with parameters of the population" in page


def test_cars_under_adaptive_cruise_control(real, page):
    readme, short, long = text_of(ROOT / "README.md"), *(real[1].loc[("openacc", group)] for group in "SL")
    assert (short["base"], long["base"]) == ("approach_gain_idm", "idm")
    runs, halves = (
        " instead of ".join(f"{short[f'{name}_{state}']:.2f}" for state in ("after", "idm"))
        for name in ("other_runs", "first_half")
    )
    assert f"{runs} m with IDM (lower by {lower(short, 'other_runs').partition(' (')[2]}" in readme
    assert f"that of second halves of drives {halves} m, which is not significant" in readme
    assert f"its error is lower than that of IDM by {lower(short, 'other_runs')}" in page
    assert short["first_half_idm_share_low"] < 0 < short["first_half_idm_share_high"]
    assert f"the difference of {-100 * short['first_half_idm_share']:.0f} % is not significant" in page


def lower(row, protocol):
    """By how much the error is below that of IDM, in words."""
    share, high, low = (f"{-100 * row[f'{protocol}_idm_share{end}']:.0f}" for end in ("", "_low", "_high"))
    return f"{share} % ({low} to {high} %)"


def known(verdict):
    """Mean gap errors where the first half of a drive is known."""
    return verdict["error"]["protocols"]["first_half"]["gap_rmse"]["mean"]
