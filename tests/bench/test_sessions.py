from dataclasses import replace

import pytest

from rearl_jax.bench import native, sessions
from rearl_jax.bench.highway import HighwayRoads
from rearl_jax.bench.sessions import C_ALL, GPU, GPU_VEHICLES, WorkerSession, open_sessions
from rearl_jax.config.bench import BenchConfig, Peer

SCENE = {"n_vehicles": 3, "seconds": 2, "density": 2.0, "cpu_s": 1000.0}


class Idle:
    """A session that only remembers whether it was closed."""

    facts = {"unit": 1}

    def __init__(self, *arguments, **keywords):
        self.is_open, self.keywords = True, keywords

    def measure(self, n_scenarios, seed):
        raise AssertionError("nothing is measured here")

    def close(self):
        self.is_open = False


def test_worker_measures_what_the_program_measures():
    session = WorkerSession("highway_env", **SCENE)
    try:
        assert session.facts == {"unit": 1}
        apart = session.measure(2, 7)
    finally:
        session.close()
    here = HighwayRoads(**SCENE).measure(2, 7)
    assert replace(apart, cpu_s=0.0, wall_s=0.0) == replace(here, cpu_s=0.0, wall_s=0.0)
    assert apart.cpu_s > 0
    assert session._process.poll() == 0


def test_worker_that_cannot_start_says_why():
    with pytest.raises(RuntimeError, match="(?s)program nothing ended with code 1.*no program 'nothing' to measure"):
        WorkerSession("nothing")


def test_worker_that_fails_later_says_why():
    session = WorkerSession("highway_env", **SCENE)
    with pytest.raises(RuntimeError, match=r"(?s)highway_env ended with code 1.*bench\.peers.*Error"):
        session.measure(1, -7)  # no seed is negative
    session.close()


def test_absent_programs_are_named_with_a_remedy(monkeypatch):
    monkeypatch.setattr(sessions, "WorkerSession", Idle)
    monkeypatch.setattr(sessions, "find_spec", lambda name: None)
    monkeypatch.setattr(sessions, "sees_gpu", lambda: False)
    monkeypatch.setattr(native, "COMPILER", "no-such-compiler")
    with open_sessions(3, BenchConfig()) as (started, absent):
        assert list(started) == ["rearl_jax"]
    assert {item.program for item in absent} == {"c", "highway_env", "libsumo", "highjax", "gpu"}
    assert all("install" in item.remedy for item in absent)
    assert not started["rearl_jax"].is_open


def test_programs_are_started_as_asked_and_ended(monkeypatch, tmp_path):
    monkeypatch.setattr(sessions, "WorkerSession", Idle)
    monkeypatch.setattr(sessions, "NativeProgram", Idle)
    monkeypatch.setattr(sessions, "compile_limit", lambda n_vehicles, folder: folder / "limit")
    monkeypatch.setattr(sessions, "find_spec", lambda name: object())
    monkeypatch.setattr(sessions, "sees_gpu", lambda: True)
    monkeypatch.setattr(sessions.runtime, "available_cores", lambda: 2)
    with open_sessions(3, BenchConfig()) as (started, absent):
        assert list(started) == ["rearl_jax", "c", C_ALL, "highway_env", "libsumo", "highjax", GPU]
        assert started[GPU].keywords["on_cpu"] is False
        assert started[GPU].keywords["chunk"] == GPU_VEHICLES // 3
        assert all(session.is_open for session in started.values())
    assert not any(session.is_open for session in started.values())
    assert not absent
    with open_sessions(3, BenchConfig(peers=(Peer.libsumo,))) as (started, _):
        assert list(started) == ["rearl_jax", "libsumo"]
    with open_sessions(3, BenchConfig(peers=())) as (started, absent):
        assert list(started) == ["rearl_jax"]
        assert not absent


def test_only_a_gpu_counts_as_one(monkeypatch):
    for said, expected in (("cpu\n", False), ("a warning\ngpu\n", True), ("", False)):
        sessions.sees_gpu.cache_clear()
        answer = sessions.subprocess.CompletedProcess([], 0, stdout=said)
        monkeypatch.setattr(sessions.subprocess, "run", lambda *_, answer=answer, **__: answer)
        assert sessions.sees_gpu() is expected
    sessions.sees_gpu.cache_clear()


def test_a_worker_on_a_gpu_is_not_kept_to_the_cpu():
    assert sessions._worker_environment(on_cpu=True)["JAX_PLATFORMS"] == "cpu"
    assert sessions._worker_environment(on_cpu=False).get("JAX_PLATFORMS") == sessions.os.environ.get("JAX_PLATFORMS")
