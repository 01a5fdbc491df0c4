"""The cost of replayed vehicles: what is measured, and its ratios."""

import json

import numpy as np
import pandas as pd

from benchmarks.boundary import MODEL, made_boundary, measure, run
from benchmarks.options import BoundaryBenchmark, BoundaryOptions
from rearl_jax.config import ResultsConfig

SMALL = BoundaryOptions(vehicles=3, scenarios=2, seconds=1, leaders=2, measured=3, repetitions=2)


def test_replayed_vehicles_keep_their_speed():
    boundary = made_boundary(SMALL, 3)
    x = np.asarray(boundary.motion.x)
    assert x.shape == (SMALL.seconds + 1, MODEL.ticks_per_second, 3, 2)
    steps = np.diff(x.reshape(-1, 3, 2), axis=0) * MODEL.ticks_per_second
    np.testing.assert_allclose(steps, np.broadcast_to(boundary.motion.speed[0, 0], steps.shape), rtol=1e-3)
    assert (np.asarray(boundary.identity.number) >= SMALL.vehicles).all()


def test_programs_are_compiled_before_they_are_measured_in_turn():
    calls = []
    cpu_s = measure({name: lambda name=name: calls.append(name) for name in "ab"}, 2)
    assert calls == list("ababab")
    assert [len(own) for own in cpu_s.values()] == [2, 2]


def test_ratios_are_those_of_the_table(monkeypatch, tmp_path, capsys):
    config = BoundaryBenchmark(results=ResultsConfig(str(tmp_path)), boundary=SMALL)
    monkeypatch.setattr("benchmarks.boundary.program", lambda options, n: n)
    monkeypatch.setattr("benchmarks.boundary.measure", lambda programs, _: {k: [1 + n] for k, n in programs.items()})
    summary = run(config)
    assert (summary["ratio_free"], summary["ratio_leaders"], summary["ratio_measured"]) == (1.0, 3.0, 4.0)
    assert "1.40" in capsys.readouterr().out
    table = pd.read_parquet(tmp_path / "bench_boundary" / "bench_boundary.parquet")
    assert table["cpu_ms"].tolist() == [1000.0, 3000.0, 4000.0]
    assert json.loads((tmp_path / "bench_boundary" / "summary.json").read_text())["places_measured"] == 3
