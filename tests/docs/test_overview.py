"""The picture of README compared with the kept results it is drawn from."""

import importlib.util
import json

import pandas as pd
import pytest

from tests.docs.blocks import DOCS, ROOT

KEPT = ROOT / "results" / "kept"


@pytest.fixture(scope="module")
def overview():
    """The module that draws it."""
    spec = importlib.util.spec_from_file_location("overview", DOCS / "_hooks" / "overview.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_committed_picture_is_the_one_that_is_drawn(overview):
    assert overview.PICTURE.read_text(encoding="utf-8") == overview.draw()


def test_the_picture_shows_the_kept_figures(overview):
    picture = overview.draw()
    strengths = pd.read_parquet(KEPT / "blind_fourth" / "strengths.parquet").query("effect == 'all'")
    assert len(strengths) == 4
    for row in strengths.to_dict("records"):
        assert f">{row['n_named']} of {row['n']}<" in picture
    error = json.loads((KEPT / "discover_i80" / "verdict.json").read_text(encoding="utf-8"))["error"]
    known = error["protocols"]["first_half"]["gap_rmse"]["mean"]
    assert known["after"]["value"] < known["population"]["low"]
    for state in ("population", "before", "after"):
        assert f">{known[state]['value']:.2f} m<" in picture


def test_the_picture_is_shown():
    for page, address in ((ROOT / "README.md", "docs/overview.svg"), (DOCS / "index.md", "overview.svg")):
        assert f"]({address})" in page.read_text(encoding="utf-8")
