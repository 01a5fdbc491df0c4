"""Faults of a server: every question gets an answer or a cause, and the answers are those of a healthy server."""

import functools
import gc
import hashlib
import threading
import time
from collections import Counter
from dataclasses import replace

import pytest

from rearl_jax.llm.breaker import Breaker
from rearl_jax.llm.client import Client
from rearl_jax.llm.connection import read_retry_after
from rearl_jax.llm.records import NO_DECISION, Cause
from tests.llm.asking import make_config, make_questions, outcomes
from tests.llm.stub import STATUS, Fault, Request, Stub, chat_digest
from tests.refusal import refused

TIMED_OUT = {Fault.late, Fault.never}
NO_RESPONSE = {Fault.garbage, Fault.half_body, Fault.closed, Fault.reset, Fault.enormous, Fault.endless}
SHORT = 0.25
"""Read time-out where requests are to time out [s]."""


def healthy(tmp_path_factory, questions):
    """Answers of a server without faults."""
    with Stub() as stub, Client(make_config(tmp_path_factory.mktemp("healthy")), stub.url) as client:
        return outcomes(client.submit(questions).result())


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    return healthy(tmp_path_factory, make_questions(3))


@pytest.mark.parametrize("fault", Fault, ids=lambda fault: fault.name)
def test_a_lasting_fault_has_its_cause_and_a_passing_one_an_answer(tmp_path, expected, caplog, fault):
    """A lasting fault is counted by its cause, reported once and not kept; after a passing one, answers are there."""
    cause = Cause.late if fault in TIMED_OUT else Cause.failed
    config = make_config(tmp_path, read_timeout=SHORT if fault in TIMED_OUT else 20.0, tries=2)
    with Stub(fault=lambda request: fault if request.number <= 4 else None) as stub:
        with Client(config, stub.url) as client:
            answers = client.submit(make_questions(3)).result()
            assert client.counts.causes == {cause: 3}
        assert len(stub.chats) == 6
        assert [(answer.action, answer.cause) for answer in answers] == [(NO_DECISION, cause)] * 3
        status = None if fault in TIMED_OUT | NO_RESPONSE else STATUS.get(fault, 200)
        replies = [reply for answer in answers for reply in answer.replies]
        assert {(reply.tries, reply.status, reply.text) for reply in replies} == {(2, status, None)}
        assert len([record for record in caplog.records if "remained without an answer" in record.message]) == 1
        with Client(replace(config, tries=3), stub.url) as client:
            answers = client.submit(make_questions(3)).result()
            assert client.counts.kept == 0
    assert outcomes(answers) == expected
    assert {(reply.tries, reply.status) for answer in answers for reply in answer.replies} == {(3, 200)}
    assert len(stub.chats) == 6 + 9


@pytest.mark.parametrize("status", [400, 401, 403, 404, 413, 422, 302])
def test_refusals_are_not_repeated(tmp_path, caplog, status):
    with Stub(fault=lambda request: status) as stub, Client(make_config(tmp_path), stub.url) as client:
        answers = client.submit(make_questions(6)).result()
    assert len(stub.chats) == 6
    assert {(answer.action, answer.cause) for answer in answers} == {(NO_DECISION, Cause.refused)}
    assert {(reply.tries, reply.status) for answer in answers for reply in answer.replies} == {(1, status)}
    assert caplog.text.count(f"HTTP {status}: status {status} was asked for") == 1


@pytest.mark.parametrize("fault", [Fault.too_many_wait, Fault.too_many_date])
def test_retry_after_is_waited_for(tmp_path, expected, fault):
    wait = 2 if fault is Fault.too_many_date else 1  # a date has whole seconds, and may be almost one less
    with Stub(retry_after=wait, fault=lambda request: fault if request.number == 1 else None) as stub:
        with Client(make_config(tmp_path), stub.url) as client:
            answers = client.submit(make_questions(3)).result()
    assert outcomes(answers) == expected
    times = {}
    for request in stub.chats:
        times.setdefault(request.raw, []).append(request.time)
    assert all(second - first > 0.99 for first, second in times.values())


def test_retry_after_the_deadline_is_not_waited_for(tmp_path):
    with Stub(retry_after=3600, fault=lambda request: Fault.too_many_wait) as stub:
        with Client(make_config(tmp_path, breaker_failures=8), stub.url) as client:
            start = time.monotonic()
            answers = client.submit(make_questions(40)).result()
            with refused("requests-refused"):
                client.check_usable(is_finished=False)
    assert time.monotonic() - start < 20.0
    assert {answer.cause for answer in answers} == {Cause.refused}
    assert len(stub.chats) == 40


@pytest.mark.parametrize(
    ("value", "seconds"),
    [
        (None, None),
        ("3", 3.0),
        ("0.5", 0.5),
        ("-1", 0.0),
        ("soon", None),
        ("", None),
        ("nan", None),
        ("inf", None),
        ("Thu, 01 Jan 1970 00:01:40 GMT", 40.0),
        ("Thu, 01 Jan 1970 00:00:00 GMT", 0.0),
        ("Thu, 99 Jan 1970 00:00:00 GMT", None),
    ],
)
def test_seconds_of_a_retry_after_header(value, seconds):
    assert read_retry_after(value, now=60.0) == seconds


def storm(share: float, kinds: list[Fault]):
    """Faults of some kinds in a share of all requests, drawn from the chat and the number of the try."""

    def fault(request: Request) -> Fault | None:
        drawn = hashlib.sha256(f"{chat_digest(request.body)} {request.number}".encode()).digest()
        strikes = int.from_bytes(drawn[:4], "big") < share * 2**32
        return kinds[int.from_bytes(drawn[4:8], "big") % len(kinds)] if strikes else None

    return fault


def test_requests_lost_to_faults_are_sent_again_by_the_next_run(tmp_path, tmp_path_factory):
    """30 % of all requests fail, in every way the stub can fail; the next run sends them again."""
    questions = make_questions(160, "storm")
    healthy_outcomes = healthy(tmp_path_factory, questions)
    fault = storm(0.3, list(Fault))
    config = make_config(tmp_path, read_timeout=1.0, max_in_flight=32)
    with Stub(fault=fault, stall=1.5) as stub, Client(config, stub.url) as client:
        answers = client.submit(questions).result()
        counts, frame = client.counts, client.requests_frame()
        struck = Counter(fault(request) for request in stub.chats)
    assert len(answers) == 160
    assert min(struck[kind] for kind in Fault) >= 1
    assert 0.2 < 1 - struck[None] / len(stub.chats) < 0.4
    arrived = [(got, wanted) for got, wanted in zip(outcomes(answers), healthy_outcomes, strict=True) if got[0] >= 0]
    assert all(got == wanted for got, wanted in arrived)
    lost = [answer for answer in answers if answer.replies[0].cause is not Cause.answered]
    assert 0 < len(lost) < 40
    assert {answer.cause for answer in lost} <= {Cause.failed, Cause.late}
    assert all(answer.replies[0].tries == 3 for answer in lost)
    assert counts.causes == Counter(answer.cause for answer in answers)
    assert sum(counts.causes.values()) == len(frame) == 160
    assert frame["tries"].sum() == counts.tries == len(stub.chats)
    # What was lost is asked for again, what arrived is not.
    sent = len(stub.chats)
    with Stub() as calm, Client(config, calm.url) as client:
        assert outcomes(client.submit(questions).result()) == healthy_outcomes
        assert client.counts.kept == 160 - len(lost)
    assert len(calm.chats) == len(lost)
    assert len(stub.chats) == sent


def test_no_answer_is_lost_when_the_server_restarts(tmp_path, tmp_path_factory):
    """Nothing is lost while the tries last."""
    questions = make_questions(80, "killed")
    config = make_config(tmp_path, tries=12, backoff=0.02, max_in_flight=8)
    stub = Stub(latency=0.08)
    with stub, Client(config, stub.url) as client:
        future = client.submit(questions)
        while len(stub.chats) < 27:
            time.sleep(0.002)
        stub.stop()
        before = len(stub.chats)
        time.sleep(0.2)
        stub.start()
        answers = future.result()
    assert 0 < before < 80 < len(stub.chats)
    assert outcomes(answers) == healthy(tmp_path_factory, questions)
    assert max(reply.tries for answer in answers for reply in answer.replies) > 1


@pytest.fixture
def now(monkeypatch):
    """The clock of the breaker [s], which only the test advances."""
    clock = [0.0]
    monkeypatch.setattr("rearl_jax.llm.sending.Breaker", functools.partial(Breaker, clock=lambda: clock[0]))
    return clock


def test_no_requests_are_sent_to_a_dead_server_until_a_probe_succeeds(tmp_path, tmp_path_factory, caplog, now):
    """Questions are not delayed by a dead server; once it is back, they are answered."""
    config = make_config(tmp_path, tries=2, breaker_failures=4, breaker_pause=10.0, max_in_flight=4)
    stub = Stub()
    with stub, Client(config, stub.url) as client:
        assert {answer.replies[0].cause for answer in client.submit(make_questions(5)).result()} == {Cause.answered}
        stub.stop()
        dead = client.submit(make_questions(100, "dead")).result()
        causes = Counter(answer.cause for answer in dead)
        assert set(causes) == {Cause.failed, Cause.broken}
        assert 4 <= causes[Cause.failed] <= 8
        assert all(answer.replies[0].tries == 0 for answer in dead if answer.cause is Cause.broken)
        now[0] = 9.9
        assert {answer.cause for answer in client.submit(make_questions(50, "more")).result()} == {Cause.broken}
        assert "counts as down" in caplog.text
        # The probe fails: one request, the others are broken.
        now[0] = 10.0
        tries = client.counts.tries
        probed = Counter(answer.cause for answer in client.submit(make_questions(50, "probe")).result())
        assert probed == {Cause.failed: 1, Cause.broken: 49}
        assert client.counts.tries == tries + 1
        # The probe succeeds: all are answered.
        stub.start()
        now[0] = 20.0
        back = client.submit(make_questions(50, "back")).result()
        assert outcomes(back) == healthy(tmp_path_factory, make_questions(50, "back"))
        assert "answers again" in caplog.text
        # What was broken was not kept.
        again = client.submit(make_questions(100, "dead")).result()
        assert outcomes(again) == healthy(tmp_path_factory, make_questions(100, "dead"))


def test_breaker_lets_one_probe_through(tmp_path, now):
    config = make_config(tmp_path, tries=1, breaker_failures=2, breaker_pause=10.0, max_in_flight=16)
    with Stub(latency=0.2, fault=lambda request: Fault.internal_error) as stub, Client(config, stub.url) as client:
        client.submit(make_questions(2)).result()
        now[0] = 10.0
        stub.fault = lambda request: None
        before = len(stub.chats)
        future = client.submit(make_questions(20, "probe"))
        while len(stub.chats) == before:
            time.sleep(0.002)
        assert client.counts.in_flight == 1
        assert all(answer.replies[0].cause is Cause.answered for answer in future.result())
    assert stub.busiest > 2


def test_a_pause_before_a_retry_ends_when_the_server_counts_as_down(tmp_path):
    def fault(request):
        return Fault.too_many_wait if "car 0" in request.raw.decode() else Fault.internal_error

    config = make_config(tmp_path, tries=2, breaker_failures=3)
    with Stub(fault=fault, retry_after=20) as stub, Client(config, stub.url) as client:
        start = time.monotonic()
        answers = client.submit(make_questions(10)).result()
    assert time.monotonic() - start < 10.0
    assert (answers[0].cause, answers[0].replies[0].tries) == (Cause.failed, 1)


def test_a_busy_server_is_not_down(tmp_path):
    config = make_config(tmp_path, tries=1, breaker_failures=2)
    with Stub(fault=lambda request: Fault.too_many) as stub, Client(config, stub.url) as client:
        answers = client.submit(make_questions(50)).result()
    assert {answer.cause for answer in answers} == {Cause.failed}
    assert len(stub.chats) == 50


def test_questions_past_the_deadline_are_late_and_the_others_answered(tmp_path, tmp_path_factory):
    """Answers in time count, late requests are ended: the next burst has the connections."""
    stuck = {f"some scenario 1 car {car}" for car in range(1, 5)}

    def fault(request):
        return Fault.never if request.body["messages"][1]["content"] in stuck else None

    config = make_config(tmp_path, deadline=1.0, max_in_flight=4)
    with Stub(fault=fault) as stub, Client(config, stub.url) as client:
        start = time.monotonic()
        answers = client.submit(make_questions(15, "some")).result()
        took = time.monotonic() - start
        again = client.submit(make_questions(15, "other")).result()
    assert 0.9 < took < 10.0
    assert [answer.cause for answer in answers[11:]] == [Cause.late] * 4
    assert all(reply.latency > 0.3 and reply.tries == 1 for answer in answers[11:] for reply in answer.replies)
    assert outcomes(answers)[:11] == healthy(tmp_path_factory, make_questions(15, "some"))[:11]
    assert outcomes(again) == healthy(tmp_path_factory, make_questions(15, "other"))


def test_no_request_is_sent_after_the_deadline(tmp_path):
    config = make_config(tmp_path, deadline=0.5, max_in_flight=2)
    with Stub(latency=0.1) as stub, Client(config, stub.url) as client:
        answers = client.submit(make_questions(100)).result()
        time.sleep(0.2)
        sent = len(stub.chats)
        causes = Counter(answer.replies[0].cause for answer in answers)
        assert causes[Cause.late] > 80
        assert causes[Cause.answered] + causes[Cause.late] == 100
        assert {reply.tries for answer in answers[-50:] for reply in answer.replies} == {0}
        time.sleep(0.3)
        assert len(stub.chats) == sent < 30


def test_a_burst_past_its_deadline_does_not_end_requests_of_other_bursts(tmp_path):
    """A chat two bursts wait for is finished for the second when the first is past its deadline."""
    config = make_config(tmp_path, deadline=1.0)
    with Stub(latency=1.5) as stub, Client(config, stub.url) as client:
        first = client.submit(make_questions(3))
        timer = threading.Timer(0.8, lambda: futures.append(client.submit(make_questions(3))))
        futures = []
        timer.start()
        assert {answer.cause for answer in first.result()} == {Cause.late}
        timer.join()
        second = futures[0].result()
    assert all(answer.replies[0].cause is Cause.answered for answer in second)
    assert len(stub.chats) == 3


def test_a_programming_error_reaches_the_caller(tmp_path, monkeypatch, caplog):
    """It is not taken for a fault of the server."""
    monkeypatch.setattr("rearl_jax.llm.sending.read_completion", lambda content: content.no_such_thing)
    with Stub() as stub, Client(make_config(tmp_path), stub.url) as client:
        with pytest.raises(AttributeError):
            client.submit(make_questions(3)).result(timeout=10)
    gc.collect()
    assert "never retrieved" not in caplog.text
