"""The thresholds of discovery: documented, written down, and hashed so that another value shows."""

import ast
import functools
import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from rearl_jax.discovery.thresholds import THRESHOLDS, meanings

CODE = sorted((Path(__file__).parents[2] / "rearl_jax" / "discovery").rglob("*.py"))


def test_every_threshold_has_a_meaning_with_a_unit_where_it_is_no_count():
    texts = meanings()
    assert list(texts) == list(THRESHOLDS.plain())
    for name, value in THRESHOLDS.plain().items():
        is_count = isinstance(value, int) or name == "independent_observations"
        said = texts[name] + (" [-]" if texts[name].startswith("The same") else "")
        assert is_count or re.search(r"\[[^\]]+\]", said), name


@functools.cache
def attributes():
    """Names of all attributes that the code uses."""
    trees = [ast.parse(file.read_text(encoding="utf-8")) for file in CODE if file.name != "thresholds.py"]
    return {node.attr for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Attribute)}


@pytest.mark.parametrize("name", THRESHOLDS.plain())
def test_every_threshold_is_used(name):
    assert name in attributes()


@pytest.mark.parametrize("name", THRESHOLDS.plain())
def test_another_value_has_another_fingerprint(name):
    other = replace(THRESHOLDS, **{name: getattr(THRESHOLDS, name) + 1})
    assert other.fingerprint() != THRESHOLDS.fingerprint()


def test_plain_values_survive_a_file():
    assert json.loads(json.dumps(THRESHOLDS.plain())) == THRESHOLDS.plain()
