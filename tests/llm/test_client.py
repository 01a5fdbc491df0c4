"""The client: order of requests, stored answers, replay, votes, keys."""

import logging
import threading
import time
from concurrent.futures import CancelledError
from dataclasses import replace

import pytest

from rearl_jax.config.llm import Profile, Thinking
from rearl_jax.llm.answers import Answers
from rearl_jax.llm.client import Client
from rearl_jax.llm.records import NO_DECISION, Cause, Message
from rearl_jax.llm.requests_table import COLUMNS
from rearl_jax.problems import MissingInputError
from tests.llm.asking import CHOICES, SECRET, make_config, make_questions, outcomes, run_together
from tests.llm.stub import Fault, Stub, right_answer
from tests.refusal import refused


def test_answers_come_in_the_order_of_the_questions(tmp_path):
    questions = make_questions(100)
    with Stub() as stub, Client(make_config(tmp_path), stub.url) as client:
        answers = client.submit(questions).result()
    answer_to = {request.raw: int(right_answer(request.body)) for request in stub.chats}
    by_text = {request.body["messages"][1]["content"]: answer_to[request.raw] for request in stub.chats}
    actions = [by_text[question.messages[1].text] for question in questions]
    assert len(set(actions)) == 5
    assert [reply.text for answer in answers for reply in answer.replies] == [str(action) for action in actions]
    for action, got in zip(actions, answers, strict=True):
        expected = (action, Cause.answered) if action in CHOICES else (NO_DECISION, Cause.inadmissible)
        assert (got.action, got.cause) == expected
        (reply,) = got.replies
        assert (reply.cause, reply.tries, reply.status, reply.from_cache) == (Cause.answered, 1, 200, False)
        assert (reply.prompt_tokens, reply.cached_tokens, reply.answer_tokens) == (700, 500, 2)
        assert reply.latency > 0


def test_requests_are_sent_in_the_order_of_the_questions(tmp_path):
    questions = make_questions(40)
    with Stub() as stub, Client(make_config(tmp_path, max_in_flight=1), stub.url) as client:
        client.submit(questions).result()
    assert [request.body["messages"][1]["content"] for request in stub.chats] == [q.messages[1].text for q in questions]


def test_many_slow_requests_are_not_lost_and_no_more_are_sent_at_a_time_than_allowed(tmp_path):
    """Default limits of httpx lose requests that wait for a connection."""
    config = make_config(tmp_path, connect_timeout=0.5, max_in_flight=7)
    with Stub(latency=0.05) as stub, Client(config, stub.url) as client:
        start = time.monotonic()
        answers = client.submit(make_questions(100)).result()
    assert time.monotonic() - start > config.connect_timeout
    assert all(answer.replies[0].cause is Cause.answered for answer in answers)
    assert 3 < stub.busiest <= 7


def test_equal_questions_are_sent_once(tmp_path):
    distinct = make_questions(20)
    questions = [replace(question, scenario=100 + k) for k in range(3) for question in distinct]
    with Stub() as stub, Client(make_config(tmp_path), stub.url) as client:
        answers = client.submit(questions).result()
        frame = client.requests_frame()
    assert len(stub.chats) == 20
    assert outcomes(answers[:20]) == outcomes(answers[20:40]) == outcomes(answers[40:])
    assert list(frame["was_sent"]) == [True] * 20 + [False] * 40


def test_bursts_at_the_same_time_share_their_requests(tmp_path):
    questions = make_questions(60)
    with Stub(latency=0.1) as stub, Client(make_config(tmp_path), stub.url) as client:
        parts = [questions[:40], questions[20:], questions[10:50]]
        ready = threading.Barrier(len(parts))
        futures = {}

        def submit(number):
            ready.wait()
            futures[number] = client.submit(parts[number])

        threads = [threading.Thread(target=submit, args=(number,)) for number in range(len(parts))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        answers = {number: future.result() for number, future in futures.items()}
        alone = dict(zip(questions, outcomes(client.submit(questions).result()), strict=True))
        assert client.counts.kept == 60
    assert len(stub.chats) == 60
    for number, part in enumerate(parts):
        assert outcomes(answers[number]) == [alone[question] for question in part]


def test_the_second_run_sends_nothing(tmp_path):
    questions = make_questions(50)
    config = make_config(tmp_path)
    with Stub() as stub, Client(config, stub.url) as client:
        first = client.submit(questions).result()
    with Stub() as elsewhere, Client(config, elsewhere.url) as client:
        more = client.submit(questions + make_questions(5, "new")).result()
        counts = client.counts
    assert stub.port != elsewhere.port
    assert (len(stub.chats), len(elsewhere.chats)) == (50, 5)
    assert outcomes(more[:50]) == outcomes(first)
    assert all(reply.from_cache and reply.tries == 0 for answer in more[:50] for reply in answer.replies)
    assert (counts.kept, counts.sent, counts.tries, counts.questions, counts.answers) == (50, 5, 5, 55, 55)


def test_replay_needs_no_server(tmp_path):
    questions = make_questions(30)
    config = make_config(tmp_path)
    with Stub() as stub, Client(config, stub.url) as client:
        first = client.submit(questions).result()
    for model, profile in (("", Profile.auto), ("stub-model", Profile.vllm)):
        replayed = replace(config, model=model, profile=profile)
        with Client(replayed, stub.url, replay=True) as client:
            answers = client.submit(questions + make_questions(3, "new")).result()
            assert client.counts.causes[Cause.not_kept] == 3
        assert outcomes(answers[:30]) == outcomes(first)
        assert [(answer.action, answer.cause) for answer in answers[30:]] == [(NO_DECISION, Cause.not_kept)] * 3
        assert answers[30].replies[0].tries == 0
    assert len(stub.chats) == 30


def test_replay_of_an_unknown_model_names_the_stored_ones(tmp_path):
    config = make_config(tmp_path)
    with refused("answers-missing", MissingInputError):
        Client(config, "", replay=True).open()
    for model in ("one", "two"):
        with Stub(models=(model,)) as stub, Client(config, stub.url) as client:
            client.submit(make_questions(1)).result()
    for wanted in ("", "three"):
        with refused("kept-model", key="llm.model") as caught:
            Client(replace(config, model=wanted), "", replay=True).open()
        assert all(f"llm.model={model} " in caught.value.problem.fault for model in ("one", "two"))
    with Client(replace(config, model="two"), "", replay=True) as client:
        assert client.server.model == "two"


def test_votes_have_different_seeds_and_are_stored_separately(tmp_path):
    questions = make_questions(40)
    config = make_config(tmp_path, seed=7)
    with Stub() as stub:
        with Client(config, stub.url) as client:
            single = client.submit(questions).result()
        assert {request.body["seed"] for request in stub.chats} == {7}
        with Client(replace(config, votes=3), stub.url) as client:
            answers = client.submit(questions).result()
            frame = client.requests_frame()
    assert sorted(request.body["seed"] for request in stub.chats[40:]) == [8] * 40 + [9] * 40
    assert [answer.replies[0].text for answer in answers] == [answer.replies[0].text for answer in single]
    assert all(len(answer.replies) == 3 for answer in answers)
    agreed = [answer for answer in answers if len({reply.text for reply in answer.replies}) < 3]
    assert 0 < len(agreed) < 40
    for answer in answers:
        texts = [reply.text for reply in answer.replies]
        most = max(texts, key=texts.count)
        if texts.count(most) > 1 and int(most) in CHOICES:
            assert (answer.action, answer.cause) == (int(most), Cause.answered)
        elif len(set(texts)) == 3 and "2" not in texts:
            assert (answer.action, answer.cause) == (NO_DECISION, Cause.disagreed)
    assert len(frame) == 120
    assert list(frame["vote"][:3]) == [0, 1, 2]
    assert list(frame["from_cache"][:3]) == [True, False, False]


def test_table_of_requests_has_a_row_per_question(tmp_path):
    def say(body):
        text = "I cannot tell" if "car 3" in body["messages"][1]["content"] else "action: 1"
        return {"choices": [{"finish_reason": "stop", "message": {"content": text, "reasoning": "hmm " * 5}}]}

    with Stub(say=say) as stub, Client(make_config(tmp_path), stub.url) as client:
        assert list(client.requests_frame().columns) == list(COLUMNS)
        client.submit(make_questions(10)).result()
        client.submit(make_questions(10), second=59).result()
        frame = client.requests_frame()
    assert frame.dtypes.astype(str).to_dict() == COLUMNS
    assert len(frame) == 20
    assert frame["second"].isna().tolist() == [True] * 10 + [False] * 10
    assert frame["cause"].tolist() == 2 * [*["answered"] * 3, "unparsable", *["answered"] * 6]
    assert frame["action"].tolist()[2:5] == [1, NO_DECISION, 1]
    assert frame["text"][3] == "I cannot tell"
    assert set(frame["thinking_length"]) == {20}
    assert frame["prompt_tokens"].isna().all()
    assert frame["from_cache"].tolist() == [False] * 10 + [True] * 10
    assert frame.groupby("from_cache")["latency"].max()[True] == 0.0
    assert frame["digest"].nunique() == 10


def test_an_empty_burst_has_no_answers_and_a_second_open_is_an_error(tmp_path):
    with Stub() as stub, Client(make_config(tmp_path), stub.url) as client:
        assert client.submit([]).result() == []
        with pytest.raises(RuntimeError):
            client.open()


def test_a_cancelled_burst_does_not_end_requests_of_other_bursts(tmp_path, monkeypatch):
    questions = make_questions(20)
    find = Answers.find
    monkeypatch.setattr(Answers, "find", lambda self, digests: time.sleep(0.03) or find(self, digests))
    with Stub(latency=0.1) as stub, Client(make_config(tmp_path), stub.url) as client:
        for number in range(5):  # cancelled at different stages
            futures = [client.submit(make_questions(20, f"{number}")) for _ in range(2)]
            time.sleep(0.01 * number)
            assert futures[0].cancel()
            answers = futures[1].result(timeout=20)
            assert {answer.replies[0].cause for answer in answers} == {Cause.answered}
        alone = client.submit(questions)
        time.sleep(0.05)
        alone.cancel()
        assert {answer.replies[0].cause for answer in client.submit(questions).result()} == {Cause.answered}


def test_counts_of_a_client_at_work(tmp_path):
    with Stub(latency=0.05) as stub, Client(make_config(tmp_path, max_in_flight=5), stub.url) as client:
        future = client.submit(make_questions(50))
        progress = []
        while not future.done():
            progress.append(client.counts)
            time.sleep(0.005)
        done = client.counts
    assert any(0 < counts.in_flight <= 5 and counts.waiting > 0 for counts in progress)
    assert [counts.sent for counts in progress] == sorted(counts.sent for counts in progress)
    assert (done.questions, done.answers, done.sent, done.waiting, done.in_flight) == (50, 50, 50, 0, 0)


def test_close_does_not_wait_for_the_server(tmp_path):
    with Stub(fault=lambda request: Fault.never if "stuck" in request.raw.decode() else None) as stub:
        client = Client(make_config(tmp_path), stub.url).open()
        client.submit(make_questions(5)).result()
        future = client.submit(make_questions(100, "stuck"))
        while not client.counts.in_flight:
            time.sleep(0.005)
        start = time.monotonic()
        client.close()
        assert time.monotonic() - start < 5.0
        with pytest.raises(CancelledError):
            future.result()
        client.close()
        with pytest.raises(RuntimeError):
            client.submit([])
    with Client(make_config(tmp_path), "", replay=True) as client:
        assert all(answer.replies[0].from_cache for answer in client.submit(make_questions(5)).result())


def test_key_is_sent_and_appears_nowhere_else(tmp_path, monkeypatch, caplog):
    """Not even if the server repeats it, in an answer or in an error."""
    monkeypatch.setenv("STUB_KEY", f" {SECRET}\n")
    caplog.set_level(logging.DEBUG)

    def say(body):
        message = {"content": f"1 {SECRET}", "reasoning_content": f"the key is {SECRET}"}
        return {"choices": [{"finish_reason": SECRET, "message": message}]}

    faults = {1: None, 2: 400, 3: Fault.garbage}
    config = make_config(tmp_path, api_key_env="STUB_KEY", constrained=True, breaker_failures=1)
    with Stub(key=SECRET, say=say, fault=lambda request: faults.get(len(request.raw) % 4)) as stub:
        with Client(config, stub.url) as client:
            texts = [f"{'x' * number} question" for number in range(12)]
            questions = [replace(make_questions(1)[0], messages=(Message("user", text),)) for text in texts]
            answers = client.submit(questions).result()
            texts_shown = [repr(client), repr(answers), client.requests_frame().to_csv(), repr(client.counts)]
        assert all(request.headers["authorization"] == f"Bearer {SECRET}" for request in stub.log)
        for key in (SECRET[:-1], f"{SECRET}\u00e9"):
            monkeypatch.setenv("STUB_KEY", key)
            with refused("server-key") as caught:
                Client(config, stub.url).open()
            texts_shown.append(repr(caught.value))
    causes = {answer.cause for answer in answers}
    assert {Cause.refused, Cause.failed} <= causes or {Cause.refused, Cause.broken} <= causes
    kept = b"".join(path.read_bytes() for path in tmp_path.iterdir())
    assert b"the key is ***" in kept
    assert "ignores the constraint" in caplog.text
    assert "status 400 was asked for" in caplog.text
    for text in [*texts_shown, caplog.text, kept.decode("latin-1")]:
        assert SECRET[:-1] not in text


def test_reasoning_that_was_cut_off_is_stored_with_the_cause_truncated(tmp_path):
    def say(body):
        message = {"content": None, "reasoning_content": "well, " * 50}
        return {"choices": [{"finish_reason": "length", "message": message}]}

    config = make_config(tmp_path, thinking=Thinking.on, max_tokens=512)
    with Stub(say=say) as stub:
        for _ in range(2):
            with Client(config, stub.url) as client:
                (answer,) = client.submit(make_questions(1)).result()
            assert (answer.action, answer.cause) == (NO_DECISION, Cause.truncated)
            assert answer.replies[0].finish == "length"
    assert len(stub.chats) == 1


TWO_PROCESSES = """
import sys
from rearl_jax.llm.client import Client
from tests.llm.asking import make_config, make_questions, outcomes
from pathlib import Path
folder, url = Path(sys.argv[1]), sys.argv[2]
print("ready", flush=True)
sys.stdin.readline()
with Client(make_config(folder, max_in_flight=4), url) as client:
    answers = client.submit(make_questions(60)).result()
    print(outcomes(answers))
"""


def test_two_processes_share_the_answers(tmp_path):
    """Both use the same answers, although the server answers a repeated request differently."""
    number = iter(range(10_000))

    def say(body):
        return {"choices": [{"finish_reason": "stop", "message": {"content": str((0, 1, 3, 4)[next(number) % 4])}}]}

    with Stub(say=say, latency=0.02) as stub:
        printed = run_together(TWO_PROCESSES, *[[str(tmp_path), stub.url]] * 2)
    assert 60 <= len(stub.chats) <= 120
    assert printed[0] == printed[1]
    with Client(make_config(tmp_path), "", replay=True) as client:
        assert f"{outcomes(client.submit(make_questions(60)).result())}\n" == printed[0]
