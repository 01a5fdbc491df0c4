"""The speed of asking: the questions are real, both askers send the same number of them, and the figures add up."""

import json
import subprocess
import sys

import pandas as pd
import pytest

from rearl_jax.bench.load_generator import send_all
from rearl_jax.bench.real_questions import make_questions
from rearl_jax.bench.requests_results import Asking, Burst, RequestsResults
from rearl_jax.config.bench import BenchRequestsConfig
from tests.llm.stub import Stub


@pytest.mark.slow
def test_questions_are_those_of_a_closed_loop_and_all_different():
    questions = make_questions(90, seed=0)
    texts = [question.messages[-1].text for question in questions]
    assert len(set(texts)) == len(questions) == 90
    assert {question.messages[0].text for question in questions} == {questions[0].messages[0].text}
    assert all("REFERENCE" in text and question.choices for text, question in zip(texts, questions, strict=True))
    assert [question.messages for question in make_questions(90, seed=0)] == [q.messages for q in questions]
    assert make_questions(90, seed=1)[0].messages != questions[0].messages


def test_the_load_generator_sends_every_body_once_and_waits():
    with Stub(latency=0.02) as stub:
        send_all(stub.url, [f'{{"messages": [{{"role": "user", "content": "{i}"}}]}}' for i in range(20)], 4)
        assert len(stub.chats) == 20
        assert stub.busiest == 4


def test_a_server_that_fails_stops_the_measurement():
    with Stub() as stub, pytest.raises(ExceptionGroup) as raised:
        send_all(f"{stub.url}/nowhere", ["{}"], 1)
    assert "404" in str(raised.value.exceptions[0])


def test_figures():
    ours = (Burst(100, 0.5, 0.1, 1000, 700), Burst(100, 1.0, 0.2, 1000, 900))
    plain = (Burst(100, 0.5, 0.01), Burst(100, 0.8, 0.01))
    asking = Asking("http://x/v1", "m", ours, plain)
    requests = BenchRequestsConfig(latency=0.1, slots=20)
    found = RequestsResults(requests, 48, asking, asking, None, {}).summary()
    assert found["fixed_ideal_per_s"] == 200
    assert found["fixed_per_s"] == pytest.approx(150)
    assert found["fixed_share_of_ideal"] == pytest.approx(0.75)
    assert (found["fixed_ratio_to_plain_min"], found["fixed_ratio_to_plain_max"]) == pytest.approx((0.8, 1.0))
    assert found["fixed_cpu_ms"] == pytest.approx(1.5)
    assert (found["server_prompt_tokens"], found["server_cached_tokens"]) == (2000, 1600)
    assert "server_per_s" not in RequestsResults(requests, 48, asking, None, None, {}).summary()


@pytest.mark.parametrize(("key", "value"), [("requests", 0), ("latency", 0.0), ("slots", 0), ("repetitions", 0)])
def test_out_of_range(key, value):
    with pytest.raises(ValueError, match=key):
        BenchRequestsConfig(**{key: value}).check()


@pytest.mark.slow
def test_the_command_measures_both_askers_and_both_servers(tmp_path):
    with Stub(latency=0.01) as stub:
        overrides = [f"results.root={tmp_path}", "study=r", f"requests.server={stub.url}", "requests.requests=40"]
        overrides += ["requests.latency=0.01", "requests.repetitions=2", "requests.server_requests=20"]
        command = [sys.executable, "-m", "rearl_jax", "bench", "requests", *overrides, "llm.profile=plain"]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stderr
        asked = [seen for seen in stub.chats if not seen.is_canary]
    assert "plain load generator" in run.stdout
    table = pd.read_parquet(tmp_path / "r" / "bench_requests.parquet")
    assert table.groupby(["server", "asker"])["n_requests"].sum().to_dict() == {
        ("fixed", "ours"): 80,
        ("fixed", "plain"): 80,
        ("server", "ours"): 40,
        ("server", "plain"): 40,
    }
    assert len(asked) == 80
    summary = json.loads((tmp_path / "r" / "summary.json").read_text())
    assert 0 < summary["fixed_share_of_ideal"] <= 1.0
    assert 0 < summary["fixed_plain_share_of_ideal"] <= 1.0
