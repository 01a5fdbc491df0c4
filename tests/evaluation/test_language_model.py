"""The whole loop with a language model behind a stub server: only what must be asked is asked, and nothing is lost."""

import threading
import time
from collections import Counter
from concurrent.futures import Future
from dataclasses import replace
from zlib import crc32

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.decision import DecisionConfig, PolicyName
from rearl_jax.decision.policies import make_policy
from rearl_jax.evaluation.language_model import LanguageModel, language_model, request_figures, request_note
from rearl_jax.evaluation.runner import evaluate
from rearl_jax.progress import progress_bar
from tests.llm.asking import make_config
from tests.llm.stub import Fault, Stub
from tests.refusal import refused

HELD_OUT = np.array([1, 4])
THRESHOLDS = (0.3, 0.2)


def asking(task, tmp_path, server, policy="llm", **llm):
    decision = DecisionConfig(policy=PolicyName[policy], server=server)
    return replace(task, decision=decision, llm=make_config(tmp_path, **({"constrained": True} | llm)))


def run(config, scenes, references):
    """Values of the method's row, what was decided, the table of requests."""
    with progress_bar() as bar, language_model(config, bar) as asked:
        evaluation = evaluate(
            config, scenes, HELD_OUT, references=references, thresholds=THRESHOLDS, host_policy=asked.make_policy
        )
        return evaluation.rows[0].values, evaluation.log.decisions, asked.requests()


def assert_same(one, other, rtol=0.0):
    for name, values in one.items():
        np.testing.assert_allclose(values, other[name], rtol=rtol, err_msg=name)


@pytest.mark.slow
def test_the_matcher_asked_from_outside_gives_the_rows_of_the_matcher_inside(scenes, intervening, references):
    class Matcher:
        def __init__(self, table, model):
            self._decide = jax.jit(make_policy(PolicyName.matcher, intervening.matcher, model))
            self._table = table

        def ask(self, situation):
            keys = jax.random.split(jax.random.key(0), situation.detection.mask.shape[-1])
            answer = Future()
            answer.set_result(np.asarray(self._decide(jax.tree.map(jnp.asarray, situation), self._table, keys)))
            return answer

    outside = replace(intervening, decision=DecisionConfig(policy=PolicyName.llm))
    found = evaluate(
        outside,
        scenes,
        HELD_OUT,
        references=references,
        thresholds=THRESHOLDS,
        host_policy=lambda block: Matcher(block.table, block.model),
    )
    inside = evaluate(intervening, scenes, HELD_OUT, references=references, thresholds=THRESHOLDS)
    assert inside.log.decisions.n_accepted.sum() > 0
    # Two programs may round the last place of a mean differently; what is decided may not differ.
    assert_same(inside.rows[0].values, found.rows[0].values, rtol=1e-6)
    for one, other in zip(jax.tree.leaves(inside.log.decisions), jax.tree.leaves(found.log.decisions), strict=True):
        is_measured = np.issubdtype(np.asarray(one).dtype, np.floating)
        np.testing.assert_allclose(one, other, rtol=1e-6 if is_measured else 0.0)


def test_who_is_asked_outside_must_be_said(scenes, intervening, references):
    config = replace(intervening, decision=DecisionConfig(policy=PolicyName.llm))
    with refused("policy-outside", key="decision.policy=llm"):
        evaluate(config, scenes, HELD_OUT, references=references, thresholds=THRESHOLDS)


@pytest.mark.thorough
def test_requests_are_the_distinct_questions_and_a_second_run_sends_none(scenes, intervening, references, tmp_path):
    with Stub() as stub:
        values, decisions, requests = run(asking(intervening, tmp_path, stub.url), scenes, references)
        assert len(requests) > 50
        assert len(stub.chats) == requests["digest"].nunique() == request_figures(requests)["requests"]
        # Of the last second nobody is asked, as nothing follows it; all others that were asked follow or are counted.
        assert decisions.n_accepted.sum() == (requests["cause"] == "answered").sum() > 0
        assert decisions.n_asked.sum() == len(requests)
        again, _, second = run(asking(intervening, tmp_path, stub.url), scenes, references)
        assert len(stub.chats) == requests["digest"].nunique()
    assert second["from_cache"].all()
    assert_same(values, again)
    replayed, _, third = run(asking(intervening, tmp_path, "nowhere", "replay"), scenes, references)
    assert_same(values, replayed)
    assert request_figures(third)["requests"] == 0


@pytest.mark.thorough
def test_a_server_that_fails_a_third_of_the_time_changes_nothing(scenes, intervening, references, tmp_path):
    """Every kind of fault, each time the first try at a chat; what arrives at the second is what a good server says."""
    kinds = [kind for kind in Fault if kind not in (Fault.never, Fault.endless)]

    def fault(seen):
        number = crc32(seen.raw) % 1000
        return kinds[number % len(kinds)] if number < 330 and seen.number == 1 else None

    with Stub() as stub:
        (tmp_path / "good").mkdir()
        values, _, _ = run(asking(intervening, tmp_path / "good", stub.url), scenes, references)
    with Stub(fault=fault, stall=0.1) as stub:
        found, _, requests = run(asking(intervening, tmp_path, stub.url), scenes, references)
        struck = Counter(fault(seen) for seen in stub.chats)
    assert sum(struck.values()) - struck[None] > 10
    assert (requests["cause"] == "answered").all()
    assert_same(values, found)


def test_vehicles_without_an_answer_are_counted_by_cause_and_no_run_is_lost(scenes, intervening, references, tmp_path):
    def fault(seen):
        return None if seen.is_trial else [None, Fault.html, None, 400, None][crc32(seen.raw) % 5]

    with Stub(fault=fault) as stub:
        values, decisions, requests = run(asking(intervening, tmp_path, stub.url, tries=2), scenes, references)
    assert np.isfinite(values["h"]).all()
    assert len(values["h"]) == 3 * len(HELD_OUT)
    figures = request_figures(requests)
    assert figures["cause_failed"] > 0
    assert figures["cause_refused"] > 0
    assert figures["left_out"] == figures["cause_failed"] + figures["cause_refused"]
    assert decisions.n_invalid.sum() == figures["left_out"]
    assert f"failed {figures['cause_failed']}" in request_note(requests)


class Outage(threading.Thread):
    """Kills a stub server after so many chats and starts it again after a while."""

    def __init__(self, stub, after, pause):
        super().__init__(daemon=True)
        self.stub, self.after, self.pause = stub, after, pause
        self.before = 0

    def run(self):
        while len(self.stub.chats) < self.after:
            time.sleep(0.002)
        self.stub.stop()
        self.before = len(self.stub.chats)
        time.sleep(self.pause)
        self.stub.start()


@pytest.mark.slow
def test_a_server_that_is_killed_and_comes_back_during_a_run_changes_nothing(scenes, intervening, references, tmp_path):
    with Stub() as stub:
        (tmp_path / "good").mkdir()
        values, _, calm = run(asking(intervening, tmp_path / "good", stub.url), scenes, references)
    with Stub(latency=0.03) as stub:
        outage = Outage(stub, after=len(calm) // 4, pause=0.5)
        outage.start()
        patient = asking(intervening, tmp_path, stub.url, tries=12, backoff=0.05)
        found, _, requests = run(patient, scenes, references)
        outage.join()
    assert 0 < outage.before < calm["digest"].nunique() < len(stub.chats)
    assert (requests["cause"] == "answered").all()
    assert requests["tries"].max() > 1
    assert_same(values, found)


def test_a_run_goes_on_while_the_server_is_down_and_asks_again_when_it_is_back(
    scenes, intervening, references, tmp_path, monkeypatch
):
    """Nobody waits for a server that counts as down: those vehicles are left to IDM and MOBIL, and counted."""
    # Seconds that take a while, or the run would be over before the server is back.
    monkeypatch.setattr(LanguageModel, "_show", lambda self, second, n_seconds: time.sleep(0.1))
    with Stub(latency=0.03) as stub:
        outage = Outage(stub, after=10, pause=0.5)
        outage.start()
        quick = asking(intervening, tmp_path, stub.url, tries=1, breaker_failures=2, breaker_pause=0.1)
        values, decisions, requests = run(quick, scenes, references)
        outage.join()
    causes = Counter(requests["cause"])
    assert set(causes) == {"answered", "failed", "broken"}
    assert causes["answered"] > outage.before - 2
    assert decisions.n_invalid.sum() == causes["failed"] + causes["broken"]
    second = requests["second"]
    assert second[requests["cause"] == "answered"].max() > second[requests["cause"] == "broken"].min()
    assert np.isfinite(values["h"]).all()
    assert len(values["h"]) == 3 * len(HELD_OUT)


@pytest.mark.parametrize(("fault", "code"), [(402, "requests-refused"), (Fault.null_content, "answers-unusable")])
def test_a_run_without_a_usable_answer_is_no_result(scenes, intervening, references, tmp_path, fault, code):
    with Stub(fault=lambda seen: fault) as stub, refused(code):
        quick = asking(intervening, tmp_path, stub.url, tries=1, breaker_failures=8)
        run(quick, scenes, references)
    assert len(stub.chats) < 200
