"""Configuration of the decisions: which policy, which actions are admissible, how they are executed.

Defaults marked "REARL" are stated in the paper (Bi et al.); "own choice" resolves something it leaves open.
"""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.problems import out_of_range


class PolicyName(Enum):
    """Who decides."""

    matcher = "matcher"
    """Imitates the vehicle of the reference whose role is most alike."""
    idle = "idle"
    """Keeps lane and target speed."""
    random_admissible = "random_admissible"
    """Any admissible action, all equally likely."""
    matcher_random_ref = "matcher_random_ref"
    """The matcher, shown a reference drawn at random."""
    llm = "llm"
    """A language model; answers are kept."""
    replay = "replay"
    """The kept answers of a language model, without a server; who has none is left to IDM and MOBIL."""

    @property
    def is_outside(self) -> bool:
        """Whether the decisions are made outside the compiled program."""
        return self in (PolicyName.llm, PolicyName.replay)


class Longitudinal(Enum):
    """How a vehicle under a decision follows its target speed."""

    idm_capped = "idm_capped"
    """Never faster than IDM allows behind the vehicle ahead."""
    mdp = "mdp"
    """As highway-env's MDPVehicle: blind to others."""


class LaneGate(Enum):
    """When a lane change is admissible; the lane must exist and no change be in progress in any case."""

    gap = "gap"
    """Enough room ahead and behind on the target lane."""
    exists = "exists"
    """Always."""
    mobil_safe = "mobil_safe"
    """Nobody has to brake harder than MOBIL's safe deceleration."""


class MatchSpace(Enum):
    """What the matcher compares."""

    rank = "rank"
    """Order of speed and spacing among the vehicles, values only a little."""
    raw = "raw"
    """Speed and spacing themselves."""


@dataclass(unsafe_hash=True)
class DecisionConfig:
    """Who decides for the vehicles that need it"""

    policy: PolicyName = key(
        PolicyName.matcher,
        "matcher (own choice), llm, replay; controls: idle, random_admissible, matcher_random_ref",
    )
    server: str = key("local", "of the policy llm: local = a small model on this machine, or http://HOST:PORT/v1")


@dataclass(unsafe_hash=True)
class ExecConfig:
    """Execution of decisions"""

    longitudinal: Longitudinal = key(
        Longitudinal.idm_capped,
        "idm_capped: IDM bounds the acceleration (own choice); mdp: as highway-env's MDPVehicle",
    )
    persist_target: bool = key(True, "the target speed stays as the driver's desired speed afterwards; own choice")
    hold: int = key(1, "time an action is followed unless there is a newer one [s]; REARL: one step")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        if self.hold < 1:
            raise out_of_range("hold", "must be at least 1 s", self.hold)


@dataclass(unsafe_hash=True)
class AdmissibleConfig:
    """Admissible actions"""

    lane: LaneGate = key(LaneGate.gap, "lane changes: gap, exists (the lane does), mobil_safe; own choice")
    min_gap: float = key(5.0, "least bumper-to-bumper gap for lane=gap [m]; own choice")
    min_time_gap: float = key(0.5, "the same in time, of the rear vehicle of each pair [s]; own choice")
    longitudinal: bool = key(False, "whether keep, faster and slower need room to the vehicle ahead; own choice")
    decel_faster: float = key(0.5, "strongest IDM interaction at which faster is admissible [m/s^2]; own choice")
    decel_keep: float = key(1.5, "the same for keep [m/s^2]; own choice")
    decel_slower: float = key(4.0, "the same for slower [m/s^2]; own choice")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        for name in ("min_gap", "min_time_gap", "decel_faster", "decel_keep", "decel_slower"):
            if not getattr(self, name) >= 0:
                raise out_of_range(name, "must be >= 0", getattr(self, name))


@dataclass(unsafe_hash=True)
class MatcherConfig:
    """The policy that imitates the reference"""

    space: MatchSpace = key(MatchSpace.rank, "rank: by order among the vehicles (own choice); raw: by value (REARL)")
    value_weight: float = key(0.05, "weight of the values beside the ranks in space=rank [-]; own choice")
    lane_changes: bool = key(True, "imitate lane changes")
    lane_change_pause: int = key(5, "least time since the last lane change before another one [s]; own choice")
    spacing_rule: bool = key(False, "where the spacing is off, spread or contract instead of keeping; own choice")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        if self.value_weight < 0:
            raise out_of_range("value_weight", "must be >= 0", self.value_weight)
        if self.lane_change_pause < 0:
            raise out_of_range("lane_change_pause", "must be >= 0 s", self.lane_change_pause)
