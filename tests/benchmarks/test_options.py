import pytest

from benchmarks.options import CoreOptions, DiscoverOptions, LoopOptions, LoopPolicy, Peer
from rearl_jax.problems import InvalidInputError


def test_defaults_are_valid():
    CoreOptions().check()
    CoreOptions(chunks=(), threads=(), against="there").check()
    DiscoverOptions().check()


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
        CoreOptions(**changed).check()
    assert (caught.value.code, caught.value.problem.key) == ("out-of-range", key)


def test_defaults_of_the_loop_are_valid():
    LoopOptions().check()
    LoopOptions(steps_batches=()).check()
    LoopOptions(batches=()).check()


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({"vehicles": (30, 10)}, "vehicles"),
        ({"vehicles": (1, 10)}, "vehicles"),
        ({"batches": (), "steps_batches": ()}, "batches"),
        ({"batches": (0, 1)}, "batches"),
        ({"steps": 0}, "steps"),
        ({"policies": ()}, "policies"),
        ({"policies": (LoopPolicy.idle, LoopPolicy.idle)}, "policies"),
        ({"repetition_cpu_s": 0.0}, "repetition_cpu_s"),
        ({"rounds": 0}, "rounds"),
        ({"seconds": 61}, "reference_seconds"),
    ],
)
def test_ranges_of_the_loop(changed, key):
    with pytest.raises(InvalidInputError) as caught:
        LoopOptions(**changed).check()
    assert (caught.value.code, caught.value.problem.key) == ("out-of-range", key)


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({"drivers": (8, 20)}, "drivers"),
        ({"drivers": ()}, "drivers"),
        ({"seconds": (60, 60)}, "seconds"),
        ({"replicates": 1}, "replicates"),
    ],
)
def test_ranges_of_discover(changed, key):
    with pytest.raises(InvalidInputError) as caught:
        DiscoverOptions(**changed).check()
    assert (caught.value.code, caught.value.problem.key) == ("out-of-range", key)
