"""The programs `rearl bench loop` measures, by name."""

from rearl_jax.config.bench import LoopPolicy
from rearl_jax.core.effects import EFFECTS

BASE = "base"
"""IDM and MOBIL alone."""

NEVER = "never"
"""The closed loop that is never triggered: detection.cues=never, so nothing but the detection is left of it."""

PPO = "ppo"
"""All vehicles driven by the trained policy that comes with the package."""

LOOP, DETECTION, DECISION = "loop", "detection", "decision"
"""Decision steps: whole ones; on recorded traffic the detection alone, and all that follows from it alone."""

PARTS = (BASE, PPO, LOOP, DETECTION, DECISION)
"""Programs of the decision steps."""

STEPS_POLICY = LoopPolicy.rank
"""Who decides in them."""

FOLLOWING = "following"
"""The Intelligent Driver Model on gaps between bumpers, on which effects act, without any."""

TWO_EFFECTS = "two_effects"
"""The same with the effects `TWO`."""

LOOP_WITH_TWO = "rank_two_effects"
"""The closed loop of the matcher by rank, triggered every second, on that traffic."""

TWO = ("reaction_delay", "several_leaders")
"""Two effects of drivers that are often found; own choice."""

_QUIET = "_quiet"


def quiet(policy: LoopPolicy) -> str:
    """The closed loop with thresholds that nothing passes: all is computed, nobody is asked, the traffic is Base's."""
    return policy.name + _QUIET


def always(policy: LoopPolicy) -> str:
    """The closed loop that is triggered every second, with cues=always."""
    return policy.name


def policy_of(program: str) -> LoopPolicy:
    """The policy of a `quiet` or `always` program.

    Raises:
        ValueError: There is no such program.
    """
    name = program.removesuffix(_QUIET)
    if name not in LoopPolicy.__members__:
        raise ValueError(f"there is no program {program!r} to measure")
    return LoopPolicy[name]


def programs_of(policies: tuple[LoopPolicy, ...]) -> tuple[str, ...]:
    """All programs measured in turn."""
    return (BASE, NEVER, *(quiet(policy) for policy in policies), *(always(policy) for policy in policies))


def effect_programs(chosen: tuple[str, ...] | None) -> tuple[str, ...]:
    """Programs that are measured beside Base one at a time: no effect, each of those chosen, two together, the loop.

    Args:
        chosen: Names of effects; None for all there are, empty for no program at all.

    Raises:
        ValueError: There is no such effect.
    """
    if chosen is not None and (unknown := [name for name in chosen if name not in EFFECTS]):
        raise ValueError(f"loop.effects: there is no effect {unknown[0]!r}; those there are: {', '.join(EFFECTS)}")
    names = tuple(EFFECTS) if chosen is None else chosen
    return (FOLLOWING, *names, TWO_EFFECTS, LOOP_WITH_TWO) if names else ()


def effects_in(program: str) -> tuple[str, ...]:
    """Effects that are on in one of these programs.

    Raises:
        ValueError: There is no such program.
    """
    known = {FOLLOWING: (), TWO_EFFECTS: TWO, LOOP_WITH_TWO: TWO} | {name: (name,) for name in EFFECTS}
    if program not in known:
        raise ValueError(f"there is no program {program!r} to measure")
    return known[program]


def policy_in(program: str) -> LoopPolicy | None:
    """Who decides in one of these programs; None where nobody does."""
    return LoopPolicy.rank if program == LOOP_WITH_TWO else None
