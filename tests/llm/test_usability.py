"""A run in which no question gets a usable answer is stopped with the reason; one with answers goes on."""

import pytest

from rearl_jax.cli.running import is_for_user
from rearl_jax.llm.client import Client
from rearl_jax.llm.records import Cause
from rearl_jax.llm.requests_table import Counts
from rearl_jax.llm.usability import MAX_UNUSABLE, check_usable
from rearl_jax.problems import InvalidInputError
from tests.llm.asking import make_config, make_questions
from tests.llm.stub import Stub
from tests.refusal import refused


def check(causes, *, is_finished=False, in_a_row=0, reasons=None, any_text=False):
    counts = Counts(sum(causes.values()), sum(causes.values()), causes, 0, 0, 0, 0, 0)
    limits = {"refused_in_a_row": in_a_row, "most_refused": 8}
    check_usable(counts, reasons or {}, is_finished=is_finished, any_text=any_text, **limits)


@pytest.mark.parametrize(
    "case",
    [
        ({}, False, 0),
        ({}, True, 0),
        ({Cause.late: MAX_UNUSABLE - 1}, False, 0),
        ({Cause.refused: 7}, False, 7),
        ({Cause.answered: 1, Cause.unparsable: 5000}, True, 0),
        ({Cause.answered: 1, Cause.refused: 5000}, True, 7),
    ],
)
def test_a_run_that_may_go_on(case):
    causes, is_finished, in_a_row = case
    check(causes, is_finished=is_finished, in_a_row=in_a_row)


@pytest.mark.parametrize(
    ("case", "code"),
    [
        (({Cause.late: MAX_UNUSABLE}, False, 0), "answers-unusable"),
        (({Cause.unparsable: 1}, True, 0), "answers-unusable"),
        (({Cause.not_kept: 3}, True, 0), "answers-unusable"),
        (({Cause.refused: 8}, False, 0), "requests-refused"),
        (({Cause.answered: 50, Cause.refused: 8}, False, 8), "requests-refused"),
    ],
)
def test_a_run_that_is_stopped(case, code):
    causes, is_finished, in_a_row = case
    with refused(code) as caught:
        check(causes, is_finished=is_finished, in_a_row=in_a_row, reasons=dict.fromkeys(Cause, "HTTP 402: no credit"))
    assert "HTTP 402: no credit" in caught.value.problem.fault
    assert is_for_user(caught.value)


def test_a_text_may_be_enough():
    check({Cause.unparsable: 500}, is_finished=True, any_text=True)
    with refused("answers-unusable"):
        check({Cause.failed: 3}, is_finished=True, any_text=True)


def test_credit_that_runs_out_stops_the_run_and_keeps_the_answers(tmp_path):
    config = make_config(tmp_path, breaker_failures=3)
    with Stub() as stub, Client(config, stub.url) as client:
        client.submit(make_questions(20)).result()
        client.check_usable(is_finished=False)
        stub.fault = lambda seen: 402
        client.submit(make_questions(5, "later")).result()
        with refused("requests-refused") as caught:
            client.check_usable(is_finished=False)
        assert "status 402" in caught.value.problem.fault
        stub.fault = lambda seen: None
        client.submit(make_questions(5, "later")).result()
        client.check_usable(is_finished=True)
    with Client(config, "", replay=True) as client:
        client.submit(make_questions(20)).result()
        client.check_usable(is_finished=True)


def test_a_replay_of_other_questions_is_no_run(tmp_path):
    with Stub() as stub, Client(make_config(tmp_path), stub.url) as client:
        client.submit(make_questions(1)).result()
    with Client(make_config(tmp_path), "", replay=True) as client:
        client.submit(make_questions(3, "other")).result()
        with refused("answers-unusable"):
            client.check_usable(is_finished=True)


def test_the_last_answer_is_shown(tmp_path):
    message = {"choices": [{"message": {"content": "1. 1. 1."}}]}
    with Stub(say=lambda body: message) as stub, Client(make_config(tmp_path), stub.url) as client:
        client.submit(make_questions(3)).result()
        client.check_usable(is_finished=False)
        with pytest.raises(InvalidInputError, match=r"1\. 1\. 1\."):
            client.check_usable(is_finished=True)
