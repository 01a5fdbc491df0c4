import dataclasses
import os
from concurrent.futures import Future

import numpy as np
import pytest
from numpy._core._multiarray_umath import __cpu_dispatch__

from rearl_jax.validation import reference, workers
from rearl_jax.validation.workers import DISABLING_VARIABLE, Job, Variant, vector_features


def test_workers_run_what_highway_env_runs(jobs, recorded):
    assert set(recorded) == {job for part in jobs.values() for job in part}
    job = jobs["stress10"][1]
    here = reference.simulate(job.scenario)
    assert (here.tracks.lane[1:] != here.tracks.lane[:-1]).any()
    np.testing.assert_allclose(recorded[job].tracks.x, here.tracks.x, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(recorded[job].start.x, here.start.x)


def test_a_failure_names_the_scene(jobs):
    job = jobs["stress10"][2]
    broken = Job(dataclasses.replace(job.scenario, injection=None), Variant.nudged)
    with pytest.raises(RuntimeError, match=r"scene 2 of stress10 \(nudged\)"):
        list(workers.run([broken], 1))
    assert DISABLING_VARIABLE not in os.environ


def test_no_jobs_start_no_worker(monkeypatch):
    monkeypatch.setattr(workers, "ProcessPoolExecutor", None)
    assert list(workers.run([], 4)) == []


def test_two_arithmetics_do_not_share_a_process(jobs):
    plain = jobs["stress10"][0]
    with pytest.raises(ValueError, match="share"):
        list(workers.run([plain, dataclasses.replace(plain, variant=Variant.vectorised)], 1))


@pytest.mark.parametrize(("variant", "switched"), [("plain", "X86_V4"), ("nudged", "X86_V4"), ("vectorised", None)])
def test_only_the_control_keeps_the_vector_functions(monkeypatch, jobs, recorded, variant, switched):
    """The processes are replaced by one that notes the environment it would be started in."""
    seen = []

    class Executor:
        def __init__(self, n_workers, mp_context):
            assert mp_context.get_start_method() == "spawn"

        def submit(self, function, job):
            seen.append(os.environ.get(DISABLING_VARIABLE))
            future = Future()
            future.set_result(recorded[jobs["stress10"][0]])
            return future

        def shutdown(self, cancel_futures):
            assert cancel_futures

    monkeypatch.delenv(DISABLING_VARIABLE, raising=False)
    monkeypatch.setattr(workers, "vector_features", lambda: ("X86_V4",))
    monkeypatch.setattr(workers, "ProcessPoolExecutor", Executor)
    asked = [dataclasses.replace(job, variant=Variant(variant)) for job in jobs["stress10"]]
    assert {job for job, _ in workers.run(asked, 2)} == set(asked)
    assert seen == [switched] * 3
    assert DISABLING_VARIABLE not in os.environ


def test_a_nudged_job_is_run_nudged(jobs):
    scenario = dataclasses.replace(jobs["stress10"][0].scenario, actions=((),))
    plain, nudged = (workers._simulate(Job(scenario, variant)) for variant in (Variant.plain, Variant.nudged))
    np.testing.assert_array_equal(nudged.start.x, np.nextafter(plain.start.x, np.inf))
    np.testing.assert_array_equal(nudged.start.y, plain.start.y)
    assert 0 < np.abs(nudged.tracks.x - plain.tracks.x).max() < 1e-9


@pytest.mark.parametrize("before", [None, "AVX2, FMA3"])
def test_the_switch_is_set_for_new_processes_and_restored(monkeypatch, before):
    monkeypatch.setattr(workers, "vector_features", lambda: ("X86_V4", "AVX512_ICL"))
    monkeypatch.delenv(DISABLING_VARIABLE, raising=False)
    if before is not None:
        monkeypatch.setenv(DISABLING_VARIABLE, before)
    with workers._environment(vectorised=False):
        assert os.environ[DISABLING_VARIABLE].split() == ["AVX2", "FMA3", "X86_V4", "AVX512_ICL"][0 if before else 2 :]
    assert os.environ.get(DISABLING_VARIABLE) == before
    with workers._environment(vectorised=True):
        assert DISABLING_VARIABLE not in os.environ
    assert os.environ.get(DISABLING_VARIABLE) == before


def test_vector_features_are_names_that_numpy_knows():
    assert set(vector_features()) <= set(__cpu_dispatch__)
    assert not set(vector_features()) & {"AVX2", "FMA3", "X86_V3"}
