"""The page of a discovery: the verdict is on it, markup in names is text, no figure is missing a number."""

import re

import numpy as np

from rearl_jax.config import DiscoverTask
from rearl_jax.discovery.report.map_figures import draw_maps
from rearl_jax.discovery.report.page import write_page
from rearl_jax.discovery.report.presentation import map_table
from rearl_jax.discovery.search.atlas import Atlas
from rearl_jax.discovery.search.finder import Selected
from rearl_jax.discovery.search.maps import Basis, Curve
from rearl_jax.discovery.search.reactions import Reaction
from tests.discovery.made_verdict import KEEP_RIGHT, LANE_SCORES, LOSS, VERDICT


def atlas() -> Atlas:
    variable = Reaction("gap", np.zeros((2, 1)))
    basis = Basis(variable, np.array([1.0, 2.0, 3.0]), np.full(3, 1 / 3))
    value = np.array([-0.1, 0.0, 0.1])
    curve = Curve(basis, value, value - 0.05, value + 0.05, "acceleration", 0.3, 12.0)
    return Atlas({"gap": curve}, {}, [Selected("gap", "acceleration", 1.0, 1.0)], {"gap": "rises by 0.20 m/s^2"})


def test_page_says_the_verdict_escapes_markup_and_has_no_nan():
    page = write_page(DiscoverTask(), VERDICT, {"before": atlas()}, {"maps": b"png"}, [])
    body = re.sub(r"base64,[^\"]*", "", page)
    assert "Missing in the model: reaction delay" in body
    assert "Generated recordings, no measurements" in body
    assert "rises by 0.20 m/s^2" in body
    assert "faster changes" in body
    assert "<b>speed</b>" not in body
    assert "&lt;b&gt;speed" in body
    assert "<i>" not in body
    assert not re.search(r"\bnan\b|\bNone\b", body.split("Complete configuration")[0])
    assert 'name="viewport"' in body


def test_page_has_the_choice_of_the_lane_where_there_was_one():
    page = write_page(DiscoverTask(), VERDICT, {"before": atlas()}, {}, [])
    assert "The choice of the lane" not in page
    bias = {"bias": {"value": 0.3, "low": 0.2, "high": 0.4, "unit": "m/s^2"}}
    effect = KEEP_RIGHT | {"parameters": bias, "confidence": 0.98, "evidence": 50.0}
    with_lanes = VERDICT | {
        "effects": [*VERDICT["effects"], effect],
        "candidates": [
            *VERDICT["candidates"],
            KEEP_RIGHT | LANE_SCORES,
            KEEP_RIGHT | LANE_SCORES | {"name": "politeness"},
        ],
        "lane_choice": {"changes": 400, "opportunities": 9000, "loss": LOSS},
    }
    page = write_page(DiscoverTask(), with_lanes, {"before": atlas()}, {}, [])
    assert "Missing in the model: reaction delay; missing in the choice of the lane: keep right" in page
    following, lanes = page.split("The choice of the lane</h2>")
    assert "400 changes by choice in 9000 opportunities" in lanes
    assert "change -0.0500 (-0.0600 to -0.0400) nats" in lanes
    assert re.search(r"<td>keep right</td><td>12.0</td><td>30.0</td><td>20.0</td><td class=\"text\">added</td>", lanes)
    assert re.search(r"<td>politeness</td>.*<td class=\"text\"></td>", lanes)
    assert "<td>keep right</td>" not in following
    assert "<td>reaction delay</td>" in following


def test_map_table_has_no_value_where_nothing_was_added():
    table = map_table({"before": atlas()}, {})
    assert table["added"].isna().all()
    assert table["value"].notna().all()
    assert list(table["knot"]) == [1.0, 2.0, 3.0]
    assert list(map_table({"before": atlas()}, {"gap": np.ones(3)})["added"]) == [1.0] * 3


def test_maps_are_drawn_with_fewer_variables_than_panels():
    assert draw_maps({"before": atlas(), "after": atlas()}, {"gap": np.ones(3)}, generated=True).startswith(b"\x89PNG")


def test_page_has_the_thresholds_of_the_verdict():
    assert "Thresholds of the decision" not in write_page(DiscoverTask(), VERDICT, {"before": atlas()}, {}, [])
    verdict = VERDICT | {"thresholds": {"least_total": 16.25}}
    page = write_page(DiscoverTask(), verdict, {"before": atlas()}, {}, [])
    assert re.search(r"<td>least total</td><td>16.25</td><td class=\"text\">Gain and check, .*\[nats\]", page)
