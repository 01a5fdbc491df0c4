import pytest

from rearl_jax.config.bench import BenchConfig, Peer


def test_defaults_are_valid():
    BenchConfig().check()


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
        ({"scenarios": (1, 2)}, "scenarios must hold one positive number for each of the 5"),
        ({"scenarios": (1, 2, 3, 4, 0)}, "scenarios must hold one positive number"),
        ({"peers": (Peer.c, Peer.c)}, "peers names a program twice"),
    ],
)
def test_ranges(changed, message):
    with pytest.raises(ValueError, match=message):
        BenchConfig(**changed).check()
