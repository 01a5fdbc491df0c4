"""A run without usable answers, or with too few answers, is stopped with the reason; a run with them goes on."""

import pytest

from rearl_jax.cli.running import is_for_user
from rearl_jax.llm.client import Client
from rearl_jax.llm.records import Cause
from rearl_jax.llm.requests_table import Counts
from rearl_jax.llm.usability import MAX_UNANSWERED, MAX_UNUSABLE, check_usable
from rearl_jax.problems import InvalidInputError
from tests.llm.asking import make_config, make_questions
from tests.llm.stub import Stub
from tests.refusal import refused

MOST_REFUSED = 8
"""Number of refused requests that stops a run."""

FEW = int(1000 * MAX_UNANSWERED)
"""Most of a thousand questions that may remain without an answer."""

REFUSAL = "HTTP 402: no credit"


def check(n_by_cause, *, is_finished=False, unanswered_in_a_row=0, refused_in_a_row=0, reasons=None, any_text=False):
    """`check_usable` for a run with this number of questions by cause."""
    n_questions = sum(n_by_cause.values())
    counts = Counts(
        questions=n_questions,
        answers=n_questions,
        causes=n_by_cause,
        kept=0,
        sent=0,
        tries=0,
        waiting=0,
        in_flight=0,
    )
    check_usable(
        counts,
        reasons or {},
        is_finished=is_finished,
        any_text=any_text,
        unanswered_in_a_row=unanswered_in_a_row,
        refused_in_a_row=refused_in_a_row,
        most_refused=MOST_REFUSED,
    )


@pytest.mark.parametrize(
    ("n_by_cause", "is_finished", "refused_in_a_row"),
    [
        ({}, False, 0),
        ({}, True, 0),
        ({Cause.late: MAX_UNUSABLE - 1}, False, 0),
        ({Cause.refused: MOST_REFUSED - 1}, False, MOST_REFUSED - 1),
        ({Cause.answered: 1, Cause.unparsable: 5000}, True, 0),
        ({Cause.answered: 1000 - FEW, Cause.refused: FEW}, True, MOST_REFUSED - 1),
        ({Cause.answered: 1, Cause.unparsable: 999 - FEW, Cause.broken: FEW}, True, 0),
        ({Cause.answered: 1, Cause.failed: 5000}, False, 0),
    ],
)
def test_a_run_with_usable_answers_or_few_questions_goes_on(n_by_cause, is_finished, refused_in_a_row):
    check(n_by_cause, is_finished=is_finished, refused_in_a_row=refused_in_a_row)


@pytest.mark.parametrize(
    ("n_by_cause", "is_finished", "refused_in_a_row", "code"),
    [
        ({Cause.late: MAX_UNUSABLE}, False, 0, "answers-unusable"),
        ({Cause.unparsable: 1}, True, 0, "answers-unusable"),
        ({Cause.not_kept: 3}, True, 0, "answers-unusable"),
        ({Cause.refused: MOST_REFUSED}, False, 0, "requests-refused"),
        ({Cause.answered: 50, Cause.refused: MOST_REFUSED}, False, MOST_REFUSED, "requests-refused"),
        ({Cause.answered: 999 - FEW, Cause.failed: 1, Cause.broken: FEW}, True, 0, "answers-too-few"),
        ({Cause.answered: 1, Cause.late: 2}, True, 0, "answers-too-few"),
    ],
)
def test_a_run_without_usable_answers_or_with_refused_requests_is_stopped(
    n_by_cause, is_finished, refused_in_a_row, code
):
    reasons = dict.fromkeys(Cause, REFUSAL)
    with refused(code) as caught:
        check(n_by_cause, is_finished=is_finished, refused_in_a_row=refused_in_a_row, reasons=reasons)
    assert REFUSAL in caught.value.problem.fault
    assert is_for_user(caught.value)


def test_a_run_is_stopped_after_a_hundred_questions_in_a_row_without_an_answer():
    causes = {Cause.answered: 5000, Cause.broken: MAX_UNUSABLE}
    check(causes, unanswered_in_a_row=MAX_UNUSABLE - 1)
    with refused("answers-too-few"):
        check(causes, unanswered_in_a_row=MAX_UNUSABLE)


def test_an_unparsable_answer_counts_as_usable_if_any_text_does():
    check({Cause.unparsable: 500}, is_finished=True, any_text=True)
    with refused("answers-unusable"):
        check({Cause.failed: 3}, is_finished=True, any_text=True)


def test_a_run_without_credit_is_stopped_and_its_answers_are_stored(tmp_path):
    config = make_config(tmp_path, breaker_failures=3)
    with Stub() as stub, Client(config, stub.url) as client:
        client.submit(make_questions(20)).result()
        client.check_usable(is_finished=False)
        stub.fault = lambda request: 402  # HTTP status: payment required
        client.submit(make_questions(5, "later")).result()
        with refused("requests-refused") as caught:
            client.check_usable(is_finished=False)
        assert "status 402" in caught.value.problem.fault
        stub.fault = lambda request: None
        client.submit(make_questions(5, "later")).result()
        client.check_usable(is_finished=True)
    with Client(config, "", replay=True) as client:
        client.submit(make_questions(20)).result()
        client.check_usable(is_finished=True)


@pytest.mark.parametrize("status", [402, 502])
def test_an_error_sent_as_a_good_response_is_read_as_the_status_it_states(tmp_path, status):
    config = make_config(tmp_path, breaker_failures=3, tries=1)
    error = {"error": {"message": "no credit left", "code": status}}
    good = {"choices": [{"message": {"content": "1"}}]}
    with Stub(say=lambda body: error if "scenario" in str(body) else good) as stub, Client(config, stub.url) as client:
        (answer, *_) = client.submit(make_questions(3)).result()
        with refused("requests-refused" if status == 402 else "answers-unusable") as caught:
            client.check_usable(is_finished=True)
    assert answer.replies[0].status == status
    assert "no credit left" in caught.value.problem.fault


def test_a_run_whose_server_dies_is_stopped_with_the_reason_and_resumed_by_the_same_command(tmp_path):
    config = make_config(tmp_path, breaker_failures=3, tries=1, max_in_flight=1)
    with Stub() as stub, Client(config, stub.url) as client:
        client.submit(make_questions(5)).result()
        stub.fault = lambda request: 500
        causes = [answer.cause for answer in client.submit(make_questions(20)).result()]
        assert causes.count(Cause.broken) > 10
        client.check_usable(is_finished=False)
        with refused("answers-too-few") as caught:
            client.check_usable(is_finished=True)
        assert "status 500" in caught.value.problem.fault
        client.submit(make_questions(MAX_UNUSABLE, "later")).result()
        with refused("answers-too-few"):
            client.check_usable(is_finished=False)
    with Stub() as stub, Client(config, stub.url) as client:
        client.submit(make_questions(20)).result()
        client.check_usable(is_finished=True)
    assert len(stub.chats) == 15


def test_a_replay_without_stored_answers_is_stopped(tmp_path):
    with Stub() as stub, Client(make_config(tmp_path), stub.url) as client:
        client.submit(make_questions(1)).result()
    with Client(make_config(tmp_path), "", replay=True) as client:
        client.submit(make_questions(3, "other")).result()
        with refused("answers-unusable"):
            client.check_usable(is_finished=True)


def test_the_message_of_a_stopped_run_quotes_the_last_answer(tmp_path):
    answer = {"choices": [{"message": {"content": "1. 1. 1."}}]}
    with Stub(say=lambda body: answer) as stub, Client(make_config(tmp_path), stub.url) as client:
        client.submit(make_questions(3)).result()
        client.check_usable(is_finished=False)
        with pytest.raises(InvalidInputError, match=r"1\. 1\. 1\."):
            client.check_usable(is_finished=True)
