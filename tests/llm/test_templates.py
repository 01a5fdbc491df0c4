"""Prompt templates of the user: what they replace, and what is wrong with them."""

from pathlib import Path

import pytest

from rearl_jax.llm.records import Message
from rearl_jax.llm.template import load_template
from rearl_jax.problems import MissingInputError
from tests.llm.situations import ask_small
from tests.refusal import refused


def write_template(folder, text) -> Path:
    path = folder / "own.j2"
    path.write_text(text, encoding="utf-8")
    return path


OWN = """{% block system %}
Choose.
{% endblock %}
{% block user %}
{% set twice = 2 * car.speed %}
{{ car.vehicle }}: {{ twice }} {{ "%.3f" | format(car.speed) }} {{ scene.mean_distance }} {{ choices }}
{% include "more.txt" %}
{% endblock %}
"""


def test_own_template_replaces_the_shipped_one(tmp_path):
    (tmp_path / "more.txt").write_text("{{ car.last_action }}, {{ reference.cars[0].speed }}\n", encoding="utf-8")
    questions = ask_small(template=str(write_template(tmp_path, OWN)))
    assert {question.messages[0] for question in questions} == {Message("system", "Choose.")}
    assert questions[1].messages[1] == Message("user", "2: 18.0 9.000 133.3 (1, 2, 3, 4)\nslower, 10.0")
    assert questions[2].messages[1] == Message("user", "0: 36.0 18.000 26.7 (1, 2, 3, 4)\nnone, 6.0")


BOTH = "{{% block system %}}\n{}{{% endblock %}}\n{{% block user %}}\n{}{{% endblock %}}"
# Template; code and line of the problem; text that the problem contains.
BROKEN = {
    "no block": ("hello", "block-missing", None, "block system"),
    "one block": ("{% block system %}{% endblock %}", "block-missing", None, "block user"),
    "syntax": (BOTH.format("", "\n{{ car.speed car }}"), "template-syntax", 5, "'car'"),
    "unknown name": (BOTH.format("", "\n{{ cra.speed }}"), "variable-unknown", 5, "'cra'"),
    "in a branch": (BOTH.format("", "{% if car %}\n{% else %}{{ x }}{% endif %}"), "variable-unknown", 5, "'x'"),
    "too early": (BOTH.format("{{ car.speed }}", ""), "variable-unknown", 2, "'car'"),
    "unknown filter": (BOTH.format("{{ 1 | wrong }}", ""), "template-syntax", 2, "'wrong'"),
    "unknown field": (BOTH.format("", "{{ car.sped }}"), "template-fails", 4, "'sped'"),
    "undefined item": (BOTH.format("{{ actions[7] }}", ""), "template-fails", 2, "element 7"),
    "wrong sum": (BOTH.format("{{ 1 / (levels[0] - levels[0]) }}", ""), "template-fails", 2, "ZeroDivisionError"),
    "code": (BOTH.format("{{ actions.__class__.__base__ }}", ""), "template-fails", 2, "'__class__'"),
    "missing include": (BOTH.format("", "{% include 'b' %}"), "template-fails", 4, "'b'"),
    "shared early": (BOTH.format("", "{% block scene %}\n{{ car }}{% endblock %}"), "variable-unknown", 5, "'car'"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_an_error_in_a_template_names_file_line_and_fault(tmp_path, name):
    text, code, line, named = BROKEN[name]
    template = str(write_template(tmp_path, text))
    with refused(code, file=template, line=line) as caught:
        ask_small(template=template)
    assert named in caught.value.problem.fault
    assert "\n" not in str(caught.value)


def test_a_template_that_is_missing_or_not_text_is_an_error(tmp_path):
    for wrong in (tmp_path / "missing.j2", tmp_path):
        with refused("file-missing", MissingInputError, key="prompt.template"):
            load_template(str(wrong))
    (tmp_path / "own.j2").write_bytes(b"{% block system %}\xff")
    with refused("not-text", file=str(tmp_path / "own.j2")):
        load_template(str(tmp_path / "own.j2"))
