"""Measured arrays on the devices, for as long as they are evaluated.

A search evaluates the same drives thousands of times under other parameters, and on a CPU it takes longer to join,
convert and cut their arrays than to compute with them.
"""

import weakref
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import jax
import numpy as np

from rearl_jax.core.batch import Placed, ScenarioMap, padded_scenarios
from rearl_jax.discovery.observe.observer import Pieces

MOST_BYTES = 1 << 29
"""Largest size of all arrays that are kept on the devices: 240 drivers of 300 s at 10 Hz take a third of it."""


class Placements:
    """Arrays of drives on the devices, by the measured arrays they were made of.

    An array that was placed becomes read-only, because a later change of it would not be seen. It leaves the devices
    when a measured array it was made of is released, or when newer ones need the space.

    Attributes:
        nbytes: Size of all arrays that are kept [bytes].
    """

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self.nbytes = 0
        self._most_bytes = most_bytes
        self._kept: OrderedDict[tuple, tuple[Placed, tuple[weakref.ref, ...]]] = OrderedDict()

    def pieces(self, parts: Sequence[Pieces], program: ScenarioMap, width: int) -> Pieces:
        """Pieces of several states side by side, padded to `width` and cut into the chunks of a program.

        Returns:
            Pieces whose arrays are `Placed`.
        """
        known = max(part.known.shape[0] for part in parts)
        parts = [
            part
            if part.known.shape[0] == known
            else replace(part, known=np.broadcast_to(part.known, (known, part.known.shape[1])))
            for part in parts
        ]
        leaves, structure = jax.tree.flatten(parts[0])
        sources = list(zip(leaves, *map(jax.tree.leaves, parts[1:]), strict=True))
        return jax.tree.unflatten(structure, self._placed(sources, program, width))

    def _placed(self, arrays: list[tuple[np.ndarray, ...]], program: ScenarioMap, width: int) -> list[Placed]:
        """Arrays on the devices, each joined of those of several states."""
        rest = width, program.width(width), jax.config.read("jax_enable_x64")
        keys = [(*map(id, sources), *rest) for sources in arrays]
        missing = {key: sources for key, sources in zip(keys, arrays, strict=True) if key not in self._kept}
        joined = [one[0] if len(one) == 1 else np.concatenate(one, axis=-1) for one in missing.values()]
        new = program.place([padded_scenarios(values, width, values.shape[-1]) for values in joined]) if joined else []
        for (key, sources), placed in zip(missing.items(), new, strict=True):
            for source in sources:
                source.flags.writeable = False
            self._kept[key] = placed, tuple(weakref.ref(source, partial(self._release, key)) for source in sources)
            self.nbytes += placed.nbytes
        found = []
        for key in keys:
            self._kept.move_to_end(key)
            found.append(self._kept[key][0])
        while self.nbytes > self._most_bytes and len(self._kept) > len(set(keys)):
            self._release(next(iter(self._kept)))
        return found

    def _release(self, key: tuple, _: weakref.ref | None = None) -> None:
        if key in self._kept:
            self.nbytes -= self._kept.pop(key)[0].nbytes
