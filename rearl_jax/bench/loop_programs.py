"""The programs `rearl bench loop` measures, by name."""

from rearl_jax.config.bench import LoopPolicy

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
