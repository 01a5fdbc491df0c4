"""The compiled programs behind the Gymnasium environments: scenarios in lockstep, each with random keys of its own.

A scenario's episodes depend on its own seed alone, so that scenario i of a batch seeded with s is the single
environment seeded with s + i.
"""

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, Key

from rearl_jax.environments import highway
from rearl_jax.environments.highway import HighwayOptions, HighwayState, Outcome, Starts
from rearl_jax.environments.surroundings import Surroundings
from rearl_jax.runtime import check_platform


class Scenarios(eqx.Module):
    """State of the environments from call to call.

    Attributes:
        keys: Random keys of the episodes to come.
        state: The present episodes.
    """

    keys: Key[Array, " scenarios"]
    state: HighwayState


class FirstObservation(NamedTuple):
    """Observation at the beginning of an episode, before any decision.

    Attributes:
        observation: As in `highway.Outcome`.
        speed: Speed of the controlled vehicle [m/s].
    """

    observation: Float[Array, "rows columns scenarios"]
    speed: Float[Array, " scenarios"]


def keys_of(seeds: Sequence[int]) -> Key[Array, " scenarios"]:
    """A random key for each seed, made from the last 32 bits of the seed."""
    return jax.vmap(jax.random.key)(jnp.asarray(np.array([seed % 2**32 for seed in seeds], np.uint32)))


@cache
def start_program(options: HighwayOptions) -> Callable[..., tuple[Scenarios, FirstObservation]]:
    """Function from keys and measured starts to the first episodes; compiled once for all environments of a process.

    Raises:
        InvalidInputError: The environment variables name a platform that this JAX does not have.
    """
    check_platform()
    return jax.jit(partial(_start, options=options))


@cache
def restart_program(options: HighwayOptions) -> Callable[..., tuple[Scenarios, FirstObservation]]:
    """Function from scenarios, starts and a mask of restarting scenarios to the scenarios with new episodes."""
    return jax.jit(partial(_restart, options=options))


@cache
def step_program(options: HighwayOptions) -> Callable[..., tuple[Scenarios, Outcome]]:
    """Function from scenarios, their surroundings and actions to the scenarios a second later and their outcome."""
    return jax.jit(partial(_step, options=options))


def _start(
    keys: Key[Array, " scenarios"], starts: Starts | None, options: HighwayOptions
) -> tuple[Scenarios, FirstObservation]:
    next_keys, case_keys, traffic_keys = jax.vmap(partial(jax.random.split, num=3), out_axes=1)(keys)
    measured = None
    if starts is not None:
        draw = partial(jax.random.randint, shape=(), minval=0, maxval=starts.n_cases)
        measured = starts.start(jax.vmap(draw)(case_keys))
    scenarios = Scenarios(next_keys, highway.begin(traffic_keys, options, measured))
    return scenarios, _first_observation(scenarios, options)


def _restart(
    scenarios: Scenarios, starts: Starts | None, begins: Bool[Array, " scenarios"], options: HighwayOptions
) -> tuple[Scenarios, FirstObservation]:
    new = _start(scenarios.keys, starts, options)[0]
    keys = jnp.where(begins, new.keys, scenarios.keys)
    scenarios = Scenarios(keys, highway.select(begins, new.state, scenarios.state))
    return scenarios, _first_observation(scenarios, options)


def _step(
    scenarios: Scenarios, around: Surroundings | None, actions: Int[Array, " scenarios"], options: HighwayOptions
) -> tuple[Scenarios, Outcome]:
    boundary_second = highway.surroundings_now(scenarios.state, around)
    state = highway.advance(scenarios.state, actions, options, boundary_second)
    return Scenarios(scenarios.keys, state), highway.outcome_of(state, options, options.duration)


def _first_observation(scenarios: Scenarios, options: HighwayOptions) -> FirstObservation:
    speed = scenarios.state.traffic.speed[highway.EGO].astype(jnp.float32)
    return FirstObservation(highway.observe(scenarios.state, options), speed)
