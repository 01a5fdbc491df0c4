"""Configuration of the decisions: policy, admissible actions, execution.

Defaults marked "REARL" are stated in the paper (Bi et al.).
"""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._address import check_no_secret
from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_finite, check_least


class PolicyName(Enum):
    """Policy that decides."""

    matcher = "matcher"
    """Imitates the most similar vehicle of the reference."""
    idle = "idle"
    """Keeps lane and target speed."""
    random_admissible = "random_admissible"
    """Any admissible action, all equally likely."""
    matcher_random_ref = "matcher_random_ref"
    """The matcher, shown a reference drawn at random."""
    llm = "llm"
    """A language model; answers are stored."""
    replay = "replay"
    """The stored answers of a language model, without a server; vehicles without one keep IDM and MOBIL."""

    @property
    def is_outside(self) -> bool:
        """True if decisions are made outside the compiled program."""
        return self in (PolicyName.llm, PolicyName.replay)


class Longitudinal(Enum):
    """Longitudinal control of a vehicle under a decision."""

    idm_capped = "idm_capped"
    """Never faster than IDM allows behind the vehicle ahead."""
    mdp = "mdp"
    """As in highway-env's MDPVehicle, which ignores other vehicles."""


class LaneGate(Enum):
    """Condition of an admissible lane change, if the lane exists and no lane change is in progress."""

    gap = "gap"
    """Enough room ahead and behind on the target lane."""
    exists = "exists"
    """No further condition."""
    mobil_safe = "mobil_safe"
    """No vehicle has to brake harder than MOBIL's safe deceleration."""


class MatchSpace(Enum):
    """Quantities that the matcher compares."""

    rank = "rank"
    """Ranks of speed and spacing among the vehicles, and with a small weight the values."""
    raw = "raw"
    """Speed and spacing themselves."""


@dataclass(unsafe_hash=True)
class DecisionConfig:
    """Policy for the vehicles that need a decision"""

    policy: PolicyName = key(
        PolicyName.matcher, "matcher, llm or replay; controls: idle, random_admissible, matcher_random_ref"
    )
    server: str = key("local", "server of policy=llm: local = a small model on this machine, or http://HOST:PORT/v1")

    def check(self) -> None:
        """Raise InvalidInputError for an address with a password or a key."""
        check_no_secret(self.server, "server")


@dataclass(unsafe_hash=True)
class ExecConfig:
    """Execution of decisions"""

    longitudinal: Longitudinal = key(
        Longitudinal.idm_capped,
        "speed control; idm_capped: IDM limits the acceleration; mdp: as highway-env's MDPVehicle",
    )
    persist_target: bool = key(True, "keep the target speed as the driver's desired speed afterwards")
    hold: int = key(1, "duration of an action unless a newer one follows [s]; REARL: one step")

    def check(self) -> None:
        check_least(self, 1, "hold")


@dataclass(unsafe_hash=True)
class AdmissibleConfig:
    """Admissible actions"""

    lane: LaneGate = key(
        LaneGate.gap,
        "condition of a lane change: gap (min_gap, min_time_gap), exists (the lane exists), mobil_safe (MOBIL)",
    )
    min_gap: float = key(5.0, "smallest bumper-to-bumper gap for lane=gap [m]")
    min_time_gap: float = key(0.5, "smallest time gap of the rear vehicle of each pair for lane=gap [s]")
    longitudinal: bool = key(False, "make keep, faster and slower admissible only within the decelerations below")
    decel_faster: float = key(0.5, "largest IDM deceleration behind the leader at which faster is admissible [m/s^2]")
    decel_keep: float = key(1.5, "largest IDM deceleration behind the leader at which keep is admissible [m/s^2]")
    decel_slower: float = key(4.0, "largest IDM deceleration behind the leader at which slower is admissible [m/s^2]")

    def check(self) -> None:
        check_least(self, 0, "min_gap", "min_time_gap", "decel_faster", "decel_keep", "decel_slower")


@dataclass(unsafe_hash=True)
class MatcherConfig:
    """The policy that imitates the reference"""

    space: MatchSpace = key(MatchSpace.rank, "similarity by rank among the vehicles or by raw values (REARL)")
    value_weight: float = key(0.05, "weight of the values relative to the ranks for space=rank [-]")
    lane_changes: bool = key(True, "imitate lane changes")
    lane_change_pause: int = key(5, "shortest time between two lane changes of a vehicle [s]")
    spacing_rule: bool = key(
        False, "if the mean spacing deviates, go faster or slower to correct it instead of keeping the speed"
    )

    def check(self) -> None:
        check_least(self, 0, "value_weight", "lane_change_pause")
        check_finite(self, "value_weight")
