import pytest

from benchmarks.options import CoreOptions, DiscoverOptions, LoopOptions, LoopPolicy, Peer


def test_defaults_are_valid():
    CoreOptions().check()
    CoreOptions(chunks=(), threads=(), against="there").check()
    DiscoverOptions().check()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"vehicles": ()}, "vehicles must be positive, rising numbers"),
        ({"vehicles": (30, 10)}, "vehicles must be positive, rising numbers"),
        ({"vehicles": (0, 10)}, "vehicles must be positive, rising numbers"),
        ({"seconds": 0}, "seconds must be at least 1"),
        ({"repetitions": 0}, "repetitions must be at least 1"),
        ({"density": 0.0}, "density must be > 0"),
        ({"repetition_cpu_s": float("nan")}, "repetition_cpu_s must be > 0"),
        ({"memory_rollouts": -1}, "memory_rollouts must be at least 0"),
        ({"chunk": 0}, "chunk must be at least 1 or null"),
        ({"scenarios": (1, 2)}, "scenarios must hold one positive number for each of the 6"),
        ({"scenarios": (1, 2, 3, 4, 0)}, "scenarios must hold one positive number"),
        ({"peers": (Peer.c, Peer.c)}, "peers names a program twice"),
        ({"chunks": (16, 16)}, "chunks must be positive, rising numbers"),
        ({"threads": (2, 1)}, "threads must be positive, rising numbers"),
        ({"varied_vehicles": 0}, "varied_vehicles must be at least 1"),
        ({"margin": 1.0}, "margin must be between 0 and 1, got 1"),
        ({"against": "there", "peers": (Peer.libsumo,)}, "reference = c is not measured: add it to peers"),
    ],
)
def test_ranges(changed, message):
    with pytest.raises(ValueError, match=message):
        CoreOptions(**changed).check()


def test_defaults_of_the_loop_are_valid():
    LoopOptions().check()
    LoopOptions(steps_batches=()).check()
    LoopOptions(batches=()).check()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"vehicles": (30, 10)}, "vehicles must be positive, rising numbers"),
        ({"vehicles": (1, 10)}, "vehicles must be at least 2 each"),
        ({"batches": (), "steps_batches": ()}, "batches and steps_batches are both empty"),
        ({"batches": (0, 1)}, "batches must be positive, rising numbers"),
        ({"steps": 0}, "steps must be at least 1"),
        ({"policies": ()}, "policies must name each policy once"),
        ({"policies": (LoopPolicy.idle, LoopPolicy.idle)}, "policies must name each policy once"),
        ({"repetition_cpu_s": 0.0}, "repetition_cpu_s must be > 0"),
        ({"rounds": 0}, "rounds must be at least 1 or null"),
        ({"seconds": 61}, r"reference_seconds must be at least seconds \(61\), got 60"),
    ],
)
def test_ranges_of_the_loop(changed, message):
    with pytest.raises(ValueError, match=message):
        LoopOptions(**changed).check()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"drivers": (8, 20)}, "drivers must be at least 9 each"),
        ({"drivers": ()}, "drivers must be positive, rising numbers"),
        ({"seconds": (60, 60)}, "seconds must be positive, rising numbers"),
        ({"replicates": 1}, "replicates must be at least 2"),
    ],
)
def test_ranges_of_discover(changed, message):
    with pytest.raises(ValueError, match=message):
        DiscoverOptions(**changed).check()
