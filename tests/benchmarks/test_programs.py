from dataclasses import replace

from benchmarks import native, programs
from benchmarks.highway import HighwayRoads
from benchmarks.options import CoreOptions, Peer
from benchmarks.programs import C_ALL, GPU, GPU_VEHICLES, TITLES, open_programs
from rearl_jax.timing.process import ProcessSession


class Idle:
    """A session that only remembers whether it was closed."""

    facts = {"unit": 1}

    def __init__(self, *arguments, **keywords):
        self.is_open, self.keywords = True, keywords

    def measure(self, n_scenarios, seed):
        raise AssertionError("nothing is measured here")

    def close(self):
        self.is_open = False


def test_a_peer_in_a_process_of_its_own_measures_what_it_measures_here():
    scene = {"n_vehicles": 3, "seconds": 2, "density": 2.0, "cpu_s": 1000.0}
    session = ProcessSession("benchmarks.highway:HighwayRoads", **scene)
    try:
        apart = session.measure(2, 7)
    finally:
        session.close()
    here = HighwayRoads(**scene).measure(2, 7)
    assert replace(apart, cpu_s=0.0, wall_s=0.0) == replace(here, cpu_s=0.0, wall_s=0.0)
    assert apart.cpu_s > 0


def test_absent_programs_are_named_with_a_remedy(monkeypatch):
    monkeypatch.setattr(programs, "ProcessSession", Idle)
    monkeypatch.setattr(programs, "find_spec", lambda name: None)
    monkeypatch.setattr(programs, "sees_gpu", lambda: False)
    monkeypatch.setattr(native, "COMPILER", "no-such-compiler")
    with open_programs(3, CoreOptions()) as (started, absent):
        assert list(started) == ["rearl_jax"]
    assert {item.program for item in absent} == {"c", "highway_env", "libsumo", "highjax", "gpu"}
    assert all("install" in item.remedy for item in absent)
    assert not started["rearl_jax"].is_open


def test_programs_are_started_as_asked_and_ended(monkeypatch, tmp_path):
    monkeypatch.setattr(programs, "ProcessSession", Idle)
    monkeypatch.setattr(programs, "NativeProgram", Idle)
    monkeypatch.setattr(programs, "compile_limit", lambda n_vehicles, folder: folder / "limit")
    monkeypatch.setattr(programs, "find_spec", lambda name: object())
    monkeypatch.setattr(programs, "sees_gpu", lambda: True)
    monkeypatch.setattr(programs.runtime, "available_cores", lambda: 2)
    with open_programs(3, CoreOptions()) as (started, absent):
        assert list(started) == ["rearl_jax", "c", C_ALL, "highway_env", "libsumo", "highjax", GPU]
        assert set(started) == set(TITLES)
        assert started[GPU].keywords["on_cpu"] is False
        assert started[GPU].keywords["chunk"] == GPU_VEHICLES // 3
        assert all(session.is_open for session in started.values())
    assert not any(session.is_open for session in started.values())
    assert not absent
    with open_programs(3, CoreOptions(peers=(Peer.libsumo,))) as (started, _):
        assert list(started) == ["rearl_jax", "libsumo"]
    with open_programs(3, CoreOptions(peers=())) as (started, absent):
        assert list(started) == ["rearl_jax"]
        assert not absent


def test_only_a_gpu_counts_as_one(monkeypatch):
    for said, expected in (("cpu\n", False), ("a warning\ngpu\n", True), ("", False)):
        programs.sees_gpu.cache_clear()
        answer = programs.subprocess.CompletedProcess([], 0, stdout=said)
        monkeypatch.setattr(programs.subprocess, "run", lambda *_, answer=answer, **__: answer)
        assert programs.sees_gpu() is expected
    programs.sees_gpu.cache_clear()
