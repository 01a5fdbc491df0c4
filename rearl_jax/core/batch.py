"""Many scenarios on all cores: chunks that fit the cache, one host device per core, one compiled program."""

import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any, Generic, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import jaxpr_as_fun
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from rearl_jax.core.loops import NOT_POSSIBLE, with_loops_as_kernels

_CACHE_LINE = 16
"""Numbers of float32 in a cache line of 64 bytes."""

QUICKLY_COMPILED = {"xla_backend_optimization_level": 0, "xla_cpu_use_fusion_emitters": False}
"""Compiler options for a program that runs a few times: measured on the largest programs of `discovery`, it is compiled
in a quarter of the time and takes five times as long to run.
"""

SOON_COMPILED = {"xla_backend_optimization_level": 1, "xla_cpu_use_fusion_emitters": False}
"""Compiler options for a program whose loops are kernels: measured on those of `discovery`, it is compiled in half of
the time and runs as fast, with the same results. Large traffic would be simulated at half the speed.
"""

NO_OPTIONS: Mapping[str, Any] = MappingProxyType({})
"""No options of the compiler."""

Arguments = TypeVar("Arguments")
Result = TypeVar("Result")
Values = TypeVar("Values")


def chunk_for(n_vehicles: int) -> int:
    """Scenarios per core and pass: many, so that starting a pass costs little, but few enough for the cache.

    A row has an odd number of cache lines, because rows whose distance is a power of two are mapped to the same few
    places of the cache and evict each other. Measured on a core with 1 MiB of second-level cache: at 10 vehicles 1,200
    scenarios take half the time per vehicle that 1,024 or 2,048 take. In small traffic a chunk holds about 12,000
    vehicles. With more vehicles per scenario, chunks of nine cache lines (144 scenarios) are faster than smaller ones,
    up to 32,000 vehicles.
    """
    n_scenarios = max(12_000 / n_vehicles, min(9.0 * _CACHE_LINE, 32_000 / n_vehicles))
    n_lines = 2 * round((n_scenarios / _CACHE_LINE - 1) / 2) + 1
    return _CACHE_LINE * min(max(n_lines, 1), 255)


SMALL_WIDTHS = 16, 64
"""Numbers of scenarios per core that smaller numbers are filled up to. A program is compiled for one number of
scenarios, which takes up to half a minute, and so few scenarios take about the same time whatever their number.
"""


def width_per_device(n_scenarios: int, chunk: int) -> int:
    """Scenarios that a device takes at a time: its part, filled up to one of `SMALL_WIDTHS`, at most `chunk`."""
    part = math.ceil(n_scenarios / len(jax.local_devices()))
    return min(chunk, next((width for width in SMALL_WIDTHS if part <= width), part))


@dataclass(frozen=True, eq=False)
class Placed:
    """An argument of a `ScenarioMap` that is on the devices already, cut into chunks.

    Attributes:
        chunks: The chunks, the last one padded.
        shape: Shape of the argument before it was cut.
        width: Scenarios per chunk.
        nbytes: Size on the devices [bytes].
    """

    chunks: tuple[jax.Array, ...]
    shape: tuple[int, ...]
    width: int
    nbytes: int


class ScenarioMap(Generic[Arguments, Result]):
    """A function of many scenarios, compiled once and run chunk by chunk over all local devices.

    Every array leaf of the function's argument and result has the scenario axis last; an argument whose axis has
    length 1 is the same for all. Scenarios must not depend on each other: each device runs its own part without waiting
    for the rest.
    """

    def __init__(
        self,
        function: Callable[[Arguments], Result],
        *,
        chunk: int,
        options: Mapping[str, Any] = NO_OPTIONS,
        loops_as_kernels: bool = False,
    ) -> None:
        """Prepares the map; nothing is compiled before the first call.

        Args:
            function: Function from a pytree of arrays `[..., n_scenarios]` to another one.
            chunk: Scenarios a device takes at a time, see `chunk_for`.
            options: Options of the compiler, such as `QUICKLY_COMPILED`; those that it does not know are left out.
            loops_as_kernels: Whether a CPU runs each loop as one kernel, see `core.loops`; without effect for a program
                that the compiler cannot translate in this way.
        """
        if chunk < 1:
            raise ValueError(f"chunk = {chunk}: a device must take at least one scenario at a time")
        self._devices = jax.local_devices()
        self._chunk = chunk
        self._mesh = Mesh(np.array(self._devices), ("scenarios",))
        self._function = function
        self._options = {option: value for option, value in options.items() if _is_known(option, value)}
        self._loops_as_kernels = loops_as_kernels and self._devices[0].platform == "cpu"
        self._run = self._compiled(self._loops_as_kernels)

    def _compiled(self, loops_as_kernels: bool) -> Callable[[Arguments], Result]:
        """The program of a chunk."""

        def run(arguments: Arguments) -> Result:
            # Traced once, because the ranks of the results must be known to partition their last axes.
            part = jax.tree.map(self._part_of, arguments)
            traced, results = jax.make_jaxpr(self._function, return_shape=True)(part)
            flat = with_loops_as_kernels(traced) if loops_as_kernels else jaxpr_as_fun(traced)
            structure = jax.tree.structure(results)
            return jax.shard_map(
                lambda arguments: jax.tree.unflatten(structure, flat(*jax.tree.leaves(arguments))),
                mesh=self._mesh,
                in_specs=(jax.tree.map(lambda leaf: _last_axis(leaf, divided=leaf.shape[-1] > 1), arguments),),
                out_specs=jax.tree.map(lambda leaf: _last_axis(leaf, divided=True), results),
                check_vma=False,
            )(arguments)

        return jax.jit(run, compiler_options=self._options)

    def _part_of(self, leaf: jax.Array) -> jax.ShapeDtypeStruct:
        """Shape of the part of an argument that a device gets."""
        *other_axes, n_scenarios = leaf.shape
        width = n_scenarios if n_scenarios == 1 else n_scenarios // len(self._devices)
        return jax.ShapeDtypeStruct((*other_axes, width), leaf.dtype)

    def _computed(self, chunk: Arguments) -> Result:
        """Results of a chunk, with loops as kernels if the compiler can."""
        try:
            return self._run(chunk)
        except jax.errors.JaxRuntimeError as error:
            if not (self._loops_as_kernels and any(part in str(error) for part in NOT_POSSIBLE)):
                raise
        self._loops_as_kernels, self._run = False, self._compiled(False)
        return self._run(chunk)

    def width(self, n_scenarios: int) -> int:
        """Scenarios per chunk, on all devices together."""
        return len(self._devices) * width_per_device(n_scenarios, self._chunk)

    def place(self, arguments: Sequence[np.ndarray]) -> list[Placed]:
        """Arrays with one entry per scenario, copied to the devices for several calls."""
        cut = []
        for argument in arguments:
            n_scenarios = argument.shape[-1]
            width = self.width(n_scenarios)
            # Copied, because a device may use the memory of the host array itself, which could then not be released.
            cut.append([np.array(_cut(argument, k, width, n_scenarios)) for k in range(0, n_scenarios, width)])
        shardings = jax.tree.map(lambda part: NamedSharding(self._mesh, _last_axis(part, divided=True)), cut)
        placed = jax.device_put(cut, shardings)  # one call, because every call takes as long as several arrays
        return [
            Placed(tuple(chunks), argument.shape, chunks[0].shape[-1], sum(chunk.nbytes for chunk in chunks))
            for argument, chunks in zip(arguments, placed, strict=True)
        ]

    def chunks(self, arguments: Arguments) -> Iterator[Result]:
        """Results chunk by chunk, in order, as NumPy arrays; the next chunk is computed meanwhile.

        Arguments may be `Placed`.

        Raises:
            ValueError: If the leaves disagree about the number of scenarios, or there is none.
        """
        leaves = jax.tree.leaves(arguments)
        counts = {np.shape(leaf)[-1] for leaf in leaves}
        n_scenarios = max(counts, default=0)
        if n_scenarios == 0 or counts - {1, n_scenarios}:
            raise ValueError(
                "every argument needs the same number of scenarios in its last axis, or 1 for all,"
                f" got {sorted(counts)}"
            )
        width = self.width(n_scenarios)

        def compute(start: int) -> Result:
            return self._computed(jax.tree.map(lambda leaf: _cut(leaf, start, width, n_scenarios), arguments))

        pending = compute(0)
        for start in range(0, n_scenarios, width):
            # The next chunk starts before this one is waited for, so that no core idles while arguments are cut.
            result, stop = pending, start + width
            if stop < n_scenarios:
                pending = compute(stop)
            without_padding = operator.itemgetter((..., slice(min(width, n_scenarios - start))))
            yield jax.tree.map(without_padding, jax.tree.map(np.asarray, result))

    def __call__(self, arguments: Arguments) -> Result:
        """All results, joined along the scenario axis."""
        return join_scenarios(list(self.chunks(arguments)))


def select_scenarios(values: Values, columns: np.ndarray, n_scenarios: int, *, least_ndim: int = 1) -> Values:
    """Values of the selected scenarios; arrays with a last axis of length 1, which apply to all scenarios, are
    unchanged.

    Args:
        values: Arrays with the scenarios last.
        columns: Scenarios to take; one may be taken several times.
        n_scenarios: Number of scenarios.
        least_ndim: Least number of axes of an array that has a scenario axis: 2 for traffic, whose axes are vehicles
            and scenarios. Arrays with fewer axes are unchanged.
    """

    def select(leaf: Any) -> Any:
        has_scenarios = leaf.ndim >= least_ndim and leaf.shape[-1] == n_scenarios
        return leaf[..., columns] if has_scenarios else leaf

    return jax.tree.map(select, values)


def join_scenarios(parts: Sequence[Values]) -> Values:
    """Records of several parts of the scenarios in one record."""
    return jax.tree.map(lambda *leaves: np.concatenate(leaves, axis=-1), *parts)


def padded_scenarios(values: Values, width: int, n_scenarios: int) -> Values:
    """Values with copies of the last scenario appended, so that one compiled program serves several numbers of them.

    Args:
        values: Arrays with the scenarios last; a last axis of length 1 applies to all scenarios.
        width: Number of scenarios after padding.
        n_scenarios: Number of scenarios.
    """
    return jax.tree.map(lambda leaf: _cut(leaf, 0, width, n_scenarios), values)


def _cut(leaf: Any, start: int, width: int, n_scenarios: int) -> Any:
    """The values of `width` scenarios from `start`; the last scenario is repeated where there are fewer."""
    if isinstance(leaf, Placed):
        if leaf.width != width:
            raise ValueError(f"an argument is placed in chunks of {leaf.width} scenarios, the others of {width}")
        return leaf.chunks[start // width]
    if leaf.shape[-1] != n_scenarios:
        return leaf
    part = leaf[..., start : start + width]
    missing = width - part.shape[-1]
    if not missing:
        return part
    # Joined, because a look-up of repeated indices takes longer than the computation with the values.
    join = jnp.concatenate if isinstance(part, jax.Array) else np.concatenate  # NumPy cannot join random keys
    return join([part, *[part[..., -1:]] * missing], axis=-1)


@cache
def _is_known(option: str, value: Any) -> bool:
    """Whether the installed compiler knows an option, which is no part of its public interface."""
    try:
        jax.jit(lambda x: x, compiler_options={option: value}).lower(jnp.zeros(1)).compile()
    except jax.errors.JaxRuntimeError:
        return False
    return True


def _last_axis(leaf: jax.Array | jax.ShapeDtypeStruct | np.ndarray, *, divided: bool) -> PartitionSpec:
    """Partition along the last axis or, for a value common to all scenarios, a copy on every device."""
    return PartitionSpec(*(None,) * (leaf.ndim - 1), "scenarios" if divided else None)
