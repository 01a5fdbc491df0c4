"""Figures of discovery in measured recordings on README and pages, beside the kept verdicts."""

import json
import re

import pytest
import yaml

from tests.docs.blocks import DOCS, ROOT

STUDIES = ("discover_i80", "discover_openacc", "discover_us101")


def verdict(study):
    return json.loads((ROOT / "results" / "kept" / study / "verdict.json").read_text(encoding="utf-8"))


def text_of(page):
    """The page on one line."""
    return " ".join(page.read_text(encoding="utf-8").split())


def number(value, digits=2, sign=False):
    """A number as the pages write it, without a zero before the point."""
    text = f"{value:{'+' if sign else ''}.{digits}f}"
    return re.sub(r"^([+-]?)0\.", r"\1.", text)


def interval(value, **how):
    return f"{number(value['low'], **how)} to {number(value['high'], **how)}"


def signed(value):
    """Change with its interval; a plus sign only where the interval contains zero."""
    low, high = number(value["low"]), number(value["high"], sign=value["high"] > 0)
    return f"{low} to {high}"


@pytest.fixture(scope="module")
def page():
    return text_of(DOCS / "discovery" / "recordings.md")


def row(page, title):
    """Cells of a row of the page's table."""
    return re.search(rf"\| {re.escape(title)} \| ([^|]+) \| ([^|]+) \| ([^|]+) \|", page).groups()


def test_the_table(page):
    found = [verdict(study) for study in STUDIES]
    assert row(page, "verdict") == tuple(f"`{one['verdict']}`" for one in found)
    errors = [one["error"] for one in found]
    for state in ("before", "after"):
        cells = tuple(f"{number(error[state]['value'])} m ({interval(error[state])})" for error in errors)
        assert row(page, f"gap error {state}") == cells
    cells = tuple(f"{number(error['change']['value'])} m ({signed(error['change'])})" for error in errors)
    assert row(page, "change") == cells
    relative = [error["all"]["gap_nrmse"] for error in errors]
    cells = tuple(f"{100 * one['before']['value']:.1f} %, {100 * one['after']['value']:.1f} %" for one in relative)
    assert row(page, "error relative to the gap, before and after") == cells
    cells = tuple(f"{number(error['floor']['value'])} m" for error in errors)
    assert row(page, "error from driver noise alone") == cells


def test_no_verdict_is_named(page):
    assert not any(verdict(study)["verdict"] == "named" for study in STUDIES)
    assert "no verdict is `named`" in page


def test_candidates(page):
    delay = verdict("discover_i80")["candidates"][0]
    assert delay["name"] == "reaction_delay"
    assert f"gain of {delay['gain']:.0f} nats for the fitted drivers and {delay['check']:.0f} nats for" in page
    found = verdict("discover_openacc")
    leader, late = found["effects"]
    gain, delay = leader["parameters"]["gain"], late["parameters"]["delay"]
    first = found["candidates"][0]
    assert (leader["name"], late["name"], first["name"]) == ("leader_acceleration", "reaction_delay", leader["name"])
    nats = f"{first['gain']:.0f} nats for the fitted drivers, {first['check']:.0f} for others"
    assert f"(gain {number(gain['value'])}, {interval(gain)}; {nats})" in page
    assert f"they respond late ({number(delay['value'])} s, {interval(delay)})" in page
    assert leader["confidence"] == late["confidence"] == 0.5
    score = found["error"]["all"]["energy_score"]
    ends = f"from {number(score['before']['value'])} to {number(score['after']['value'])}"
    assert f"({ends}, change {interval(score['change'])})" in page
    assert "positions jump 1249 times" in " ".join(found["data"]["notes"])
    assert "Positions jump 1,249 times" in page


def test_readme(page):
    readme = text_of(ROOT / "README.md")
    for study, words in (("discover_i80", "three candidate"), ("discover_openacc", "two")):
        error = verdict(study)["error"]
        effects = yaml.safe_load((ROOT / "results" / "kept" / study / "model.yaml").read_text(encoding="utf-8"))[
            "effects"
        ]
        assert len(effects) == {"three candidate": 3, "two": 2}[words]
        before, after = (number(error[state]["value"]) for state in ("before", "after"))
        assert f"{before} m, with {words} effects {after} m (change {signed(error['change'])} m)" in readme
