import hashlib
import sys
import threading

import numpy as np
import pytest

from rearl_jax.timing.measurement import Measurement, Stopwatch, peak_memory_bytes


def test_speeds():
    run = Measurement(n_scenarios=2, seconds=60, n_substeps=18_000, cpu_s=3.0, wall_s=1.5, mean_speed=20.0)
    assert run.substeps_per_cpu_s == 6_000
    assert run.substeps_per_s == 12_000


def test_stopwatch_counts_every_thread_and_only_inside_its_blocks():
    def work():
        hashlib.sha256(bytes(30_000_000)).digest()  # releases the interpreter lock

    watch = Stopwatch()
    with watch:
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    inside = watch.cpu_s
    assert inside > 0
    work()
    assert watch.cpu_s == inside
    with watch:
        work()
    assert watch.cpu_s > inside
    assert watch.wall_s > 0


@pytest.mark.skipif(sys.platform == "win32", reason="the system does not tell")
@pytest.mark.slow
def test_peak_memory_grows_and_stays():
    before = peak_memory_bytes()
    assert before is not None
    array = np.ones(before // 8 + 8_000_000)
    high = peak_memory_bytes()
    assert high is not None
    assert high > before + array.nbytes // 4
    del array
    after = peak_memory_bytes()
    assert after is not None
    assert after > high - 2**22  # the system counts in portions
