import os

import pytest

from rearl_jax.timing.measurement import Measurement
from rearl_jax.timing.process import ProcessSession, fresh_environment

ADDRESS = f"{__name__}:Fixed"


class Fixed:
    """A program of constant speed, which fails where the seed is negative."""

    def __init__(self, unit):
        self.facts = {"unit": unit}

    def measure(self, n_scenarios, seed):
        print("greetings from a library")
        if seed < 0:
            raise KeyError("no seed is negative")
        return Measurement(n_scenarios, 2, 100 * n_scenarios, 0.5, 0.25, float(seed))


def test_a_program_answers_from_a_process_of_its_own():
    session = ProcessSession(ADDRESS, unit=3)
    try:
        assert session.facts == {"unit": 3}
        assert session.measure(4, 7) == Measurement(4, 2, 400, 0.5, 0.25, 7.0)
    finally:
        session.close()
    assert session._process.poll() == 0


def test_a_program_that_cannot_start_says_why():
    with pytest.raises(RuntimeError, match="(?s)rearl_jax.timing:nothing ended with code 1.*AttributeError"):
        ProcessSession("rearl_jax.timing:nothing")


def test_a_program_that_fails_later_says_why_and_what_to_do():
    session = ProcessSession(ADDRESS, remedy="do without it", unit=1)
    with pytest.raises(RuntimeError, match=r"(?s)ended with code 1; do without it.*no seed is negative"):
        session.measure(1, -7)
    session.close()


def test_a_process_has_no_compiled_programs_and_sees_a_gpu_only_where_asked():
    assert fresh_environment()["JAX_ENABLE_COMPILATION_CACHE"] == "false"
    assert fresh_environment()["JAX_PLATFORMS"] == "cpu"
    assert fresh_environment(on_cpu=False).get("JAX_PLATFORMS") == os.environ.get("JAX_PLATFORMS")
