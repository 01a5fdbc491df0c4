"""Sums over time of squared innovations and of products of their derivatives, for every piece.

Least squares, the screen and the evidence need only these sums, so the products are summed while they are computed and
the derivatives are never stored.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from rearl_jax.core.batch import NO_OPTIONS, QUICKLY_COMPILED, SOON_COMPILED, ScenarioMap, padded_scenarios
from rearl_jax.core.effects.effect import Effect
from rearl_jax.discovery.observe.candidates import CANDIDATE_EFFECTS, LENS, Knots, Layout, Term, effects_at, lens_at
from rearl_jax.discovery.observe.observer import Pieces, innovations
from rearl_jax.discovery.observe.placement import Placements
from rearl_jax.discovery.observe.robust import kept_share, robust_square
from rearl_jax.discovery.observe.sensitivity import sensitivity_sums

_MADE: dict[tuple, dict[tuple, ScenarioMap]] = {}
"""Compiled programs by configuration: time step, elements of theta, car-following model."""

_PLACED = Placements()
"""Measured drives on the devices."""

_SHAPES: set[tuple] = set()
"""Shapes compiled so far: configuration, program, number of steps."""

FEW_BATCHES = 8
"""Number of batches that a program for the screen may evaluate without optimisation: about an eighth of the number at
which its slower run takes as much time as it saves, because the program may run again.
"""

MOST_SHAPES = 120
"""Largest number of compiled shapes that is kept: each needs about two hundred memory maps, and Linux allows a process
65,530 (vm.max_map_count).
"""


Program = Callable[[Sequence[Pieces], dict], Any]
"""A compiled program: a function of the pieces of one or several states, side by side, and of what differs between
evaluations: `z`, `theta`, `deviation` [m] of the innovations and, for sensitivities, `following`, each with one entry
per piece in its last axis, and `added`, whose last axis has length 1.
"""


class Programs:
    """Compiled programs of one data configuration: time step, elements of theta, pieces per batch.

    A program contains the active terms only, because with one effect it takes a twentieth of the time of all effects.
    Data sets of the same configuration share programs, so a process that analyses many data sets compiles once.
    """

    def __init__(self, layout: Layout, dt: float, n_pieces: int) -> None:
        """Prepares the programs for time steps `dt` [s]; nothing is compiled before the first call. `n_pieces` is the
        typical number of pieces that a call evaluates, from which the size of a batch follows.
        """
        if len(_SHAPES) > MOST_SHAPES:
            _MADE.clear()
            _SHAPES.clear()
            jax.clear_caches()
        self.layout, self.dt = layout, dt
        self._batch = batch_for(n_pieces)
        self._configuration = (dt, tuple(layout.places.items()), layout.blocks, layout.prior, self._batch)
        self._made = _MADE.setdefault(self._configuration, {})

    def free(self, active: tuple[Term, ...]) -> tuple[int, ...]:
        """Indices of theta that belong to active candidates, in order."""
        return tuple(place for term in active for place in self.layout.candidates[term].free)

    def innovations(self, active: tuple[Term, ...]) -> Program:
        """Measured minus predicted positions [m] with these candidates."""

        def run(a: dict) -> Array:
            return self._innovations(a["z"], a["theta"], a, active)

        return self._program(("innovations", active), run, self._batch)

    def sums(self, active: tuple[Term, ...]) -> Program:
        """Sums with the derivatives by the drivers' own parameters and by those of the active candidates."""
        effects = [CANDIDATE_EFFECTS[term.effect] for term in active if term.is_effect]
        if all(effect.remember is Effect.remember for effect in effects):  # none has memory
            return self._sums_from_one_pass(active)
        places = jnp.asarray(self.free(active), int)

        def run(a: dict) -> dict:
            n_own = len(a["z"])

            def innovation(point: Array) -> Array:
                return self._innovations(point[:n_own], a["theta"].at[places].set(point[n_own:]), a, active)

            return _sums(innovation, jnp.concatenate([a["z"], a["theta"][places]]), a["pieces"])

        return self._program(("sums", active), run, self._batch if len(places) < 8 else self._batch // 2)

    def _sums_from_one_pass(self, active: tuple[Term, ...]) -> Program:
        """Sums as in `sums` if no effect has memory: one reverse pass per time step serves all directions."""
        places = self.free(active)

        def run(a: dict) -> dict:
            no_driver, knots = jnp.zeros((0, *a["pieces"].y.shape)), _squeezed(a["knots"])
            sums = sensitivity_sums(
                a["z"], a["theta"], a["pieces"], self.layout, knots, places, (), None, no_driver, self.dt, active
            )
            return {name: sums[name] for name in ("square", "count", "gradient")} | {"gram": sums["nuisance"]}

        return self._program(("sums", active), run, self._batch)

    def sensitivities(self, n_pieces: int) -> Program:
        """`sensitivity.sensitivity_sums` along all directions of theta; its blocks are those of `Layout.blocks`. The
        program is compiled quickly if it is to evaluate few pieces and there is no optimised one yet.
        """
        layout, batch, key, options = self.layout, self._batch // 2, ("sensitivities",), NO_OPTIONS
        if key not in self._made and n_pieces <= FEW_BATCHES * batch:
            key, options = (*key, "quick"), QUICKLY_COMPILED

        def run(a: dict) -> dict:
            knots, places, added = _squeezed(a["knots"]), range(layout.size), a["added"][:, 0]
            return sensitivity_sums(
                a["z"], a["theta"], a["pieces"], layout, knots, places, layout.blocks, added, a["following"], self.dt
            )

        # Slopes of delayed stimuli are scattered over the past, which a kernel cannot contain.
        return self._program(key, run, batch, options, loops_as_kernels=False)

    def _innovations(self, z: Array, theta: Array, a: dict, active: tuple[Term, ...]) -> Float[Array, "steps pieces"]:
        knots, pieces, numbers = _squeezed(a["knots"]), a["pieces"], self.layout.by_name(theta)
        effects = effects_at(numbers, knots, active)
        lens = lens_at(numbers, knots) if LENS in active else None
        return innovations(pieces, self.layout.prior.drivers(z, pieces.is_truck), effects, lens, self.dt)

    def _program(
        self,
        key: tuple,
        run: Callable[[dict], object],
        batch: int,
        options: Mapping[str, Any] = SOON_COMPILED,
        *,
        loops_as_kernels: bool = True,
    ) -> Program:
        def with_deviation(a: dict) -> object:
            return run(a | {"pieces": replace(a["pieces"], deviation=a["deviation"])})

        if key not in self._made:
            self._made[key] = ScenarioMap(
                with_deviation, chunk=batch, options=options, loops_as_kernels=loops_as_kernels
            )
        program = self._made[key]

        def call(parts: Sequence[Pieces], own: dict) -> Any:
            n = own["z"].shape[-1]
            width = max(n, batch * len(jax.local_devices()))  # at least one batch, so that one program serves all
            _SHAPES.add((self._configuration, key, len(parts[0].y)))
            knots = jax.tree.map(lambda values: np.asarray(values)[:, None], self.layout.knots)
            pieces = _PLACED.pieces(parts, program, width)
            result = program(padded_scenarios(own, width, n) | {"knots": knots, "pieces": pieces})
            return jax.tree.map(lambda values: values[..., :n], result)

        return call


BATCHES = 32, 64, 128
"""Sizes of a batch: pieces that one core evaluates at a time. A time step of a batch calls about fifty compiled
kernels, so a piece takes 0.7 of the time in a batch of 64, and 0.6 of it in one of 128.
"""


def batch_for(n_pieces: int) -> int:
    """Pieces per batch on one core for a data set: the smallest size that holds its pieces, at most the largest.

    A data set has one size for all numbers of pieces, because to compile a program for another size takes one to seven
    seconds, longer than the runs that it would save.
    """
    wanted = n_pieces / len(jax.local_devices())
    return next((size for size in BATCHES if wanted <= size), BATCHES[-1])


def _squeezed(knots: Knots) -> Knots:
    """Knots without their last axis, of length one, which they need as an argument of a `ScenarioMap`."""
    return jax.tree.map(lambda values: values[:, 0], knots)


def _sums(innovation: Callable[[Array], Array], point: Array, pieces: Pieces) -> dict[str, Array]:
    """Sums over time of squared innovations and of products of their derivatives along every direction of `point`."""
    p, n = point.shape

    def along(tangent: Array) -> tuple[Array, Array]:
        return jax.jvp(innovation, (point,), (tangent,))

    unit = jnp.broadcast_to(jnp.eye(p)[:, :, None], (p, p, n))
    value, slopes = jax.vmap(along, out_axes=(None, 0))(unit)  # slopes: [directions, steps, pieces]
    weight = jnp.asarray(pieces.weight)
    deviation = jnp.asarray(pieces.deviation)[None]
    weighted = slopes * (weight * kept_share(value, deviation))[None]
    return {
        "square": jnp.sum(weight * robust_square(value, deviation), axis=0),
        "count": jnp.sum(weight, axis=0),
        "gradient": jnp.einsum("dtn,tn->dn", weighted, value),
        "gram": jnp.einsum("dtn,etn->den", weighted, slopes),
    }
