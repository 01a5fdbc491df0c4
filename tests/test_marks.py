"""No mark keeps a test out of every run of `.ci/run`, unless it says that the test needs what is not there."""

import argparse
import re
import shlex
import tomllib
from itertools import combinations
from pathlib import Path

import pytest
from _pytest.mark.expression import Expression

ROOT = Path(__file__).resolve().parents[1]
ELSEWHERE = frozenset({"llm", "gpu"})
"""Marks of tests that need more than `.ci/run` has: a language model, a GPU."""

SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["pytest"]["ini_options"]
MARKS = [line.partition(":")[0].strip() for line in SETTINGS["markers"]]
SUBSETS = [frozenset(some) for n in range(len(MARKS) + 1) for some in combinations(MARKS, n)]
"""All sets of marks that one test can bear."""


def shell_lines(text):
    """Lines without comments, those that end in a backslash joined with the next."""
    lines = text.replace("\\\n", " ").splitlines()
    return [line.strip() for line in lines if line.strip() and not line.lstrip().startswith("#")]


def recipe(target, text):
    """The commands of a target of the Makefile and of all that it stands on, in order."""
    rule = re.search(rf"^{re.escape(target)}:([^\n=|#]*)[^\n]*\n((?:\t[^\n]*\n)*)", text, re.MULTILINE)
    if rule is None:  # a file that is there, or a rule made of variables: it sets up
        return []
    own = [line.lstrip("@-+") for line in shell_lines(rule[2])]
    return [line for name in rule[1].split() for line in recipe(name, text)] + own


def pytest_calls(script, makefile):
    """The arguments of pytest in every call of a script, those of its `make` included."""
    calls = []
    for line in shell_lines(script):
        words = shlex.split(line)
        if words[0] == "make":
            commands = [line for target in words[1:] for line in recipe(target, makefile)]
            calls += pytest_calls("\n".join(commands), makefile)
        elif "pytest" in (names := [Path(word).name for word in words]):
            calls.append(words[names.index("pytest") + 1 :])
    return calls


def expression(call, addopts):
    """The marks that a call selects; any other choice among the tests, such as by file name, is refused."""
    words = argparse.ArgumentParser(exit_on_error=False, allow_abbrev=False)
    words.add_argument("-m", default="")
    words.add_argument("-n")
    words.add_argument("--dist")
    words.add_argument("--durations")
    words.add_argument("--jaxtyping-packages")
    asked, others = words.parse_known_args(["-m", words.parse_known_args(addopts)[0].m, *call])
    assert others == [], f"pytest {shlex.join(call)}: only marks choose among the tests"
    return asked.m


def selects(expression, marks):
    """True if a test with these marks is run."""
    return not expression or Expression.compile(expression).evaluate(lambda name, **_: name in marks)


def left_out(expressions):
    """Marks that together keep a test out of every run, though it needs nothing special."""
    anywhere = [marks for marks in SUBSETS if not marks & ELSEWHERE]
    return [set(marks) for marks in anywhere if not any(selects(one, marks) for one in expressions)]


@pytest.fixture(scope="module")
def expressions():
    """One of every run of pytest in `.ci/run`."""
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    calls = pytest_calls(script, (ROOT / "Makefile").read_text(encoding="utf-8"))
    return [expression(call, SETTINGS["addopts"]) for call in calls]


def test_every_mark_is_declared_once_and_means_something():
    assert len(MARKS) == len(set(MARKS))
    assert set(MARKS) > ELSEWHERE
    assert all(line.partition(":")[2].strip() for line in SETTINGS["markers"])


def test_first_of_all_the_tests_that_everybody_runs(expressions):
    script = shell_lines((ROOT / ".ci" / "run").read_text(encoding="utf-8"))
    assert [line for line in script if line.startswith("make")][0] == "make test"
    default = expression([], SETTINGS["addopts"])
    assert expressions[0] == default
    assert selects(default, set())


def test_no_mark_is_left_out(expressions):
    assert left_out(expressions) == []


def test_what_needs_more_is_run_nowhere(expressions):
    assert not any(selects(one, marks) for one in expressions for marks in SUBSETS if marks & ELSEWHERE)


def test_no_test_is_run_twice(expressions):
    assert all(sum(selects(one, marks) for one in expressions) <= 1 for marks in SUBSETS)


def test_a_mark_that_is_left_out_is_seen():
    default = "not thorough and not slow"
    assert {"slow"} in left_out([default, "thorough"])
    assert left_out([default, "thorough and not slow", "slow and not thorough"]) == [
        marks for marks in map(set, SUBSETS) if marks >= {"thorough", "slow"} and not marks & ELSEWHERE
    ]
    assert left_out([default, "thorough or slow"]) == left_out([""]) == []


def test_calls_are_found_wherever_they_stand():
    makefile = "both: first last | made\n\nfirst: x\n\t$(BIN)/python -m pytest -n 2\n\nlast:\n\t@pytest \\\n\t-m a\n"
    script = "#!/bin/sh\n# pytest tests\nmake both\nexec .venv/bin/python -m pytest \\\n  -m 'a or b'\n"
    assert pytest_calls(script, makefile) == [["-n", "2"], ["-m", "a"], ["-m", "a or b"]]
    assert expression(["-n", "2"], ["--strict-markers", "-m", "not a"]) == "not a"
    assert expression(["-m", "a"], ["-m", "not a"]) == "a"


@pytest.mark.parametrize("words", ["tests/sweep", "-m slow tests/report", "-k name", "--ignore=tests/docs", "--lf"])
def test_folders_and_whatever_else_chooses_are_refused(words):
    with pytest.raises(AssertionError, match="only marks choose among the tests"):
        expression(words.split(), [])
