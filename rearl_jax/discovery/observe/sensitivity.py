"""Derivatives of the innovations along many directions at once.

For every direction, only the derivatives of the observer's state (position, speed, acceleration residual, last
acceleration) are propagated; the derivatives of the model's acceleration come from one reverse pass per time step. This
is exact as long as no effect with memory is active. After such an effect was added, `normal_equations.Programs.sums`
also propagates the derivatives of its memory.
"""

from collections.abc import Sequence
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Int

from rearl_jax.core.compaction import if_any
from rearl_jax.core.effects.effect import Effect
from rearl_jax.core.following import begin_effects, follow
from rearl_jax.discovery.observe.candidates import LENS, Knots, Layout, Term, effects_at, lens_at
from rearl_jax.discovery.observe.kalman import State, correct, halfway, predict
from rearl_jax.discovery.observe.lens import Lens
from rearl_jax.discovery.observe.observer import Pieces, stimulus, straightened, straightened_start, synchronised
from rearl_jax.discovery.observe.robust import kept_share, robust_square
from rearl_jax.discovery.read.measured import Surroundings

LARGEST = 1e4
"""Bound of the derivatives of position [m] and speed [m/s] by one unit of a direction, far above those of drivers who
follow stably.
"""


def sensitivity_sums(
    z: Float[Array, "own pieces"],
    theta: Float[Array, "parameters pieces"],
    pieces: Pieces,
    layout: Layout,
    knots: Knots,
    places: Sequence[int],
    groups: Sequence[Sequence[int]],
    added: Int[Array, " added"] | None,
    following: Float[Array, "leaders steps pieces"],
    dt: float,
    active: tuple[Term, ...] | None = None,
) -> dict[str, Float[Array, "*any pieces"]]:
    """Sums over time for drivers' own parameters and for single elements of theta.

    Args:
        z: Standardised parameters of the drivers.
        theta: Parameters of the added candidates.
        pieces: The measured pieces of drives.
        layout: Layout of theta.
        knots: Knots of the curves.
        places: Indices of theta whose directions are propagated.
        groups: Indices of one candidate each, as positions in `places`.
        added: Indices of the candidates already added, as positions in `places`; None for all of `places`.
        following: 1 if a driver follows its k-th main leader, whose clock may be ahead.
        dt: Time step [s].
        active: Terms that are computed; None for all.

    Returns:
        `square` and `count` (robust squares of innovations, weights), `gradient` (innovation times derivative, own
        directions first), `nuisance` (derivatives along own and already added directions, times all), `block_k`
        (derivatives of group k times each other; the last group is the leaders' clocks, whose directions come last).
    """
    pieces, prior = jax.tree.map(jnp.asarray, pieces), layout.prior
    n_own, n = z.shape
    numbers = layout.by_name(theta)
    is_actuated = any(type(effect).actuate is not Effect.actuate for effect in effects_at(numbers, knots, active))
    bends = active is None or LENS in active
    lens = lens_at(numbers, knots) if bends else None
    n_clocks = following.shape[0]
    size = n_own + len(places) + n_clocks
    n_nuisance = n_own + len(places if added is None else added)
    nuisance = slice(n_nuisance) if added is None else jnp.concatenate([jnp.arange(n_own), n_own + added])
    before = next((k for k, place in enumerate(places) if place in layout.places["lens"]), len(places))
    n_knots = sum(place in layout.places["lens"] for place in places)  # all of them or none, in order

    def at_lens(by_values: Array) -> Array:
        """Derivatives by all directions, of which those by the values of the lens are given and all others are 0."""
        return jnp.pad(by_values[:n_knots], ((n_own + before, size - n_own - before - n_knots), (0, 0)))

    def wanted(point: tuple, memory: tuple, now: Surroundings) -> tuple[Array, tuple]:
        x, v, own, added, shift, last = point
        surroundings = now if lens is None else straightened(now, lens_at(added, knots))
        surroundings = synchronised(surroundings, shift) if n_clocks else surroundings
        seen = stimulus(x, v, pieces.length, pieces.is_truck, surroundings)
        effects = effects_at(added, knots, active)
        acceleration, memory = follow(seen, prior.drivers(own, pieces.is_truck), effects, memory, last, dt)
        return jnp.sum(acceleration), (acceleration, memory)

    answer = jax.grad(wanted, has_aux=True)

    def step(carry: tuple, now: tuple) -> tuple[tuple, None]:
        (state, last, memory), (d, d_last), sums = carry
        x, w = state.x, state.w
        y, weight, is_corrected, surroundings, extra, follows = now
        if lens is None:
            innovation, slope = y - x - w, -d.x - d.w
        else:
            innovation, slope = y - x - lens.bend(x) - w, -(1 + lens.slope(x))[None] * d.x - d.w
            slope = slope - at_lens(lens.weights(x))
        weighted = (weight * kept_share(innovation, pieces.deviation))[None] * slope
        sums = {
            "square": sums["square"] + weight * robust_square(innovation, pieces.deviation),
            "count": sums["count"] + weight,
            "gradient": sums["gradient"] + weighted * innovation[None],
            "nuisance": sums["nuisance"] + weighted[nuisance][:, None] * slope[None],
            "products": sums["products"] + weighted[rows] * slope[columns],
        }
        gain, along = pieces.gain, jax.tree.map(lambda values: values[None], pieces.gain)
        state, d = correct(state, is_corrected * innovation, gain), correct(d, is_corrected[None] * slope, along)
        (middle_x, middle_v), (d_middle_x, d_middle_v) = halfway(state, last, dt), halfway(d, d_last, dt)
        middle = (middle_x, jnp.maximum(middle_v, 0.0))
        by, (acceleration, memory) = answer((*middle, z, numbers, jnp.zeros_like(x), last), memory, surroundings)
        # Chain rule: change of the acceleration through position and speed, plus the direct derivative (`forcing`).
        # In a branch, because XLA would otherwise recompute it for every direction.
        is_vehicle, nothing = pieces.length > 0, jnp.zeros_like(x)
        by_x, by_v = if_any(is_vehicle, lambda: (by[0], jnp.where(middle_v > 0, by[1], 0.0)), (nothing, nothing))
        forcing = jnp.concatenate([by[2], *layout.at(by[3], places), by[4][None] * follows])
        d_wanted = by_x[None] * d_middle_x + by_v[None] * d_middle_v + forcing
        if is_actuated:
            d_wanted = d_wanted + by[5][None] * d_last
        acceleration, d_acceleration = acceleration + state.o + extra, d_wanted + d.o
        free = state.v + acceleration * dt
        speed, d_speed = jnp.maximum(free, 0.0), jnp.where((free > 0)[None], d.v + d_acceleration * dt, 0.0)
        state, d = predict(state, speed, gain, dt), predict(d, d_speed, along, dt)
        # Bounded, because the derivatives of an unstable driver grow without end while the driver does not.
        d = d._replace(x=jnp.clip(d.x, -LARGEST, LARGEST), v=jnp.clip(d.v, -LARGEST, LARGEST))
        return ((state, acceleration, memory), (d, d_acceleration), sums), None

    groups = [*groups, range(len(places), len(places) + n_clocks)]
    # One array for the blocks of all groups: a smaller program.
    pairs = [(n_own + k, n_own + m) for group in groups for k in group for m in group]
    rows, columns = np.array(pairs, int).reshape(-1, 2).T
    nothing = jnp.zeros((size, n))
    total = {
        "square": nothing[0],
        "count": nothing[0],
        "gradient": nothing,
        "nuisance": jnp.zeros((n_nuisance, size, n)),
        "products": jnp.zeros((len(pairs), n)),
    }
    (x, v), d_x, d_v = pieces.start, nothing, nothing
    if lens is not None:
        (x, v), by_lens = _straightened_start_along(pieces.start, lens)
        d_x, d_v = map(at_lens, by_lens)
    first = jax.tree.map(lambda values: values[0], pieces.seen)
    seen = stimulus(x, v, pieces.length, pieces.is_truck, first)
    effects = effects_at(numbers, knots, active)
    memory = begin_effects(effects, seen, prior.drivers(z, pieces.is_truck), dt)
    zero = jnp.zeros_like(x)
    tangents = State(d_x, d_v, o=nothing, w=nothing, u=nothing), nothing
    carry = ((State(x, v, o=zero, w=zero, u=zero), zero, memory), tangents, total)
    extra = jnp.broadcast_to(pieces.known, pieces.y.shape)
    (_, _, total), _ = lax.scan(
        step, carry, (pieces.y, pieces.weight, pieces.is_corrected, pieces.seen, extra, jnp.moveaxis(following, 1, 0))
    )
    products = jnp.split(total.pop("products"), np.cumsum([len(group) ** 2 for group in groups])[:-1])
    blocks = zip(groups, products, strict=True)
    return total | {f"block_{k}": block.reshape(len(group), len(group), n) for k, (group, block) in enumerate(blocks)}


def _straightened_start_along(
    start: Float[Array, "two pieces"], lens: Lens
) -> tuple[Float[Array, "two pieces"], Float[Array, "two knots pieces"]]:
    """Position [m] and speed [m/s] in the first time step, and their derivatives by the values of the lens."""
    values = jnp.broadcast_to(lens.values, (len(lens.values), start.shape[1]))

    def begin(values: Array) -> Array:
        return jnp.stack(straightened_start(start, replace(lens, values=values)))

    unit = jnp.broadcast_to(jnp.eye(len(values))[:, :, None], (len(values), *values.shape))
    return jax.vmap(lambda tangent: jax.jvp(begin, (values,), (tangent,)), out_axes=(None, 1))(unit)
