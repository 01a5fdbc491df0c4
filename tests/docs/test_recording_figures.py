"""Figures of discovery in measured recordings on README and pages, beside the kept verdict."""

import json
import subprocess
import sys

import pytest

from tests.docs.blocks import DOCS, ROOT, blocks


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
    assert verdict["effects"] == []
    first = verdict["candidates"][0]
    assert first["name"] == "asymmetry"
    assert f"An asymmetry gains {first['check']:.0f} nats on other drivers one time step ahead. It is left" in page
    assert any("drivers misjudge gaps" in note for note in verdict["data"]["notes"])


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


@pytest.mark.slow
def test_known_time_gaps_of_cars(page):
    (block,) = (one for one in blocks(DOCS / "discovery" / "recordings.md") if "facts_of(" in one.text)
    printed = subprocess.run([sys.executable, "-c", block.text], capture_output=True, text=True, check=True).stdout
    within = printed.splitlines()[-1]
    assert f"{within} known time gaps are within .15 s" in page
    assert f"{within} within .15 s after calibration" in text_of(ROOT / "README.md")
    cars = {}
    for row in map(str.split, printed.splitlines()):
        if len(row) == 8 and row[2] in ("S", "L"):
            cars.setdefault(row[1], {})[row[2]] = [float(value) for value in row[3:6]]
    assert len(cars) == 10
    for car, gaps in cars.items():
        cells = " | ".join("{:.2f} ± {:.2f} | {:.2f}".format(*gaps[setting]) for setting in ("S", "L"))
        assert f"| {car.replace('_', ' ')} | {cells} |" in page
    assert sum(gaps["S"][2] < gaps["L"][2] for gaps in cars.values()) == 10
    assert "in 10 of 10" in text_of(ROOT / "README.md")


def known(verdict):
    """Mean gap errors where the first half of a drive is known."""
    return verdict["error"]["protocols"]["first_half"]["gap_rmse"]["mean"]
