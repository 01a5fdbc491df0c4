import pytest

from rearl_jax.config.bench import BenchConfig, BenchLoopConfig, BenchStartupConfig, LoopPolicy, Peer
from rearl_jax.problems import InvalidInputError


def test_defaults_are_valid():
    BenchConfig().check()
    BenchConfig(chunks=(), threads=(), against="there").check()
    BenchStartupConfig().check()


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({"vehicles": ()}, "vehicles"),
        ({"vehicles": (30, 10)}, "vehicles"),
        ({"vehicles": (0, 10)}, "vehicles"),
        ({"seconds": 0}, "seconds"),
        ({"repetitions": 0}, "repetitions"),
        ({"density": 0.0}, "density"),
        ({"repetition_cpu_s": float("nan")}, "repetition_cpu_s"),
        ({"memory_rollouts": -1}, "memory_rollouts"),
        ({"chunk": 0}, "chunk"),
        ({"scenarios": (1, 2)}, "scenarios"),
        ({"scenarios": (1, 2, 3, 4, 0)}, "scenarios"),
        ({"peers": (Peer.c, Peer.c)}, "peers"),
        ({"chunks": (16, 16)}, "chunks"),
        ({"threads": (2, 1)}, "threads"),
        ({"varied_vehicles": 0}, "varied_vehicles"),
        ({"margin": 1.0}, "margin"),
        ({"against": "there", "peers": (Peer.libsumo,)}, "reference"),
    ],
)
def test_ranges(changed, key):
    with pytest.raises(InvalidInputError) as caught:
        BenchConfig(**changed).check()
    assert (caught.value.code, caught.value.problem.key) == ("out-of-range", key)


def test_defaults_of_the_loop_are_valid():
    BenchLoopConfig().check()
    BenchLoopConfig(steps_batches=()).check()
    BenchLoopConfig(batches=()).check()


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({"vehicles": (30, 10)}, "vehicles"),
        ({"vehicles": (1, 10)}, "vehicles"),
        ({"batches": (), "steps_batches": ()}, "batches"),
        ({"batches": (0, 1)}, "batches"),
        ({"steps_batches": (2, 2)}, "steps_batches"),
        ({"policies": ()}, "policies"),
        ({"policies": (LoopPolicy.idle, LoopPolicy.idle)}, "policies"),
        ({"steps": 0}, "steps"),
        ({"reference_vehicles": 1}, "reference_vehicles"),
        ({"repetition_cpu_s": 0.0}, "repetition_cpu_s"),
        ({"rounds": 0}, "rounds"),
        ({"seed": -1}, "seed"),
        ({"seconds": 61}, "reference_seconds"),
        ({"steps": 70}, "reference_seconds"),
    ],
)
def test_ranges_of_the_loop(changed, key):
    with pytest.raises(InvalidInputError) as caught:
        BenchLoopConfig(**changed).check()
    assert (caught.value.code, caught.value.problem.key) == ("out-of-range", key)
