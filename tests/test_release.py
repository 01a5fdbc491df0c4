"""Statements of a release about itself agree with the version of the code."""

from pathlib import Path

import yaml

from rearl_jax.code_version import __version__

ROOT = Path(__file__).resolve().parents[1]


def test_citation_and_changelog_are_of_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == __version__
    assert {"cff-version", "title", "message", "authors", "license"} <= citation.keys()
    headings = [line for line in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines() if line[:3] == "## "]
    assert headings[0] == f"## {__version__}"
