"""The real thing: a server and a small model of the extra `llm`, started and stopped by the command."""

import json
import subprocess
import sys

import pandas as pd
import pytest

pytestmark = pytest.mark.llm


def evaluate(root, study, *words):
    keys = [
        "eval.n_runs=1",
        "eval.seed_scope=run",
        "init.source=seed",
        "speed.norm=minmax",
        "detection.interval=20",
        "core.collisions=false",
    ]
    command = [sys.executable, "-m", "rearl_jax", "evaluate", *keys, *words, f"results.root={root}", f"study={study}"]
    done = subprocess.run(
        [*command, f"llm.cache={root / 'answers.sqlite'}"], capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, done.stderr
    folder = root / study
    summary = json.loads((folder / "summary.json").read_text())[0]
    return summary, pd.read_parquet(folder / "requests.parquet"), pd.read_parquet(folder / "runs.parquet")


def test_a_real_model_decides_and_its_answers_are_kept(tmp_path):
    pytest.importorskip("xllamacpp", reason="needs `make llm`")
    summary, requests, runs = evaluate(tmp_path, "first", "decision=llm", "decision.server=local")
    assert summary["questions"] == len(requests) >= 10
    assert summary["requests"] == requests["digest"].nunique()
    assert summary["cause_answered"] == len(requests)  # the server restricts the answers
    assert summary["cached_tokens"] > 0.4 * summary["prompt_tokens"]
    again, _, rows = evaluate(tmp_path, "second", "decision=llm", "decision.server=local")
    assert again["requests"] == 0
    pd.testing.assert_frame_equal(rows, runs)
    replayed, _, rows = evaluate(tmp_path, "third", "decision=replay")
    assert replayed["requests"] == 0
    pd.testing.assert_frame_equal(rows, runs)
