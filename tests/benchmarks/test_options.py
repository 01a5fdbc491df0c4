import pytest

from benchmarks.options import CoreOptions, DiscoverOptions, LoopOptions, LoopPolicy, Peer, ReadersOptions
from rearl_jax.problems import InvalidInputError


@pytest.mark.parametrize(
    "options",
    [CoreOptions(), CoreOptions(chunks=(), threads=(), against="there"), DiscoverOptions()]
    + [LoopOptions(), LoopOptions(steps_batches=()), LoopOptions(batches=()), ReadersOptions()],
)
def test_sound_options(options):
    options.check()


BAD = {
    CoreOptions: {
        "vehicles": [(), (30, 10), (0, 10)],
        "seconds": [0],
        "repetitions": [0],
        "density": [0.0],
        "repetition_cpu_s": [float("nan")],
        "memory_rollouts": [-1],
        "chunk": [0],
        "scenarios": [(1, 2), (1, 2, 3, 4, 0)],
        "peers": [(Peer.c, Peer.c)],
        "chunks": [(16, 16)],
        "threads": [(2, 1)],
        "varied_vehicles": [0],
        "margin": [1.0],
    },
    LoopOptions: {
        "vehicles": [(30, 10), (1, 10)],
        "batches": [(0, 1)],
        "steps": [0],
        "policies": [(), (LoopPolicy.idle, LoopPolicy.idle)],
        "repetition_cpu_s": [0.0],
        "rounds": [0],
        "reference_seconds": [59],
    },
    DiscoverOptions: {"drivers": [(8, 20), ()], "seconds": [(60, 60)], "replicates": [1]},
    ReadersOptions: {"layouts": [(), ("vissim", "vissim")], "megabytes": [0.0]},
}


@pytest.mark.parametrize(
    ("options", "key"),
    [(record(**{key: value}), key) for record, keys in BAD.items() for key, values in keys.items() for value in values]
    + [(CoreOptions(against="there", peers=(Peer.libsumo,)), "reference")]
    + [(LoopOptions(batches=(), steps_batches=()), "batches")],
)
def test_ranges(options, key):
    with pytest.raises(InvalidInputError) as caught:
        options.check()
    assert (caught.value.code, caught.value.problem.key) == ("out-of-range", key)
