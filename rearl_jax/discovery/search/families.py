"""Families of easily confused candidates: if the evidence for one exceeds chance, all members are fitted and compete.

Members were chosen by the share of one candidate's detectable signal that another can imitate (projected Fisher
information).
"""

from collections.abc import Sequence

from rearl_jax.discovery.observe.candidates import Term


def _family(*effects: str, on: Sequence[str] = (), time_gap_on: Sequence[str] = ()) -> tuple[Term, ...]:
    """A family: effects, curves of the acceleration over the variables `on`, and of the time gap over `time_gap_on`."""
    return (
        *(Term(effect) for effect in effects),
        *(Term("dependence", variable) for variable in on),
        *(Term("time_gap_dependence", variable) for variable in time_gap_on),
    )


FAMILIES = (
    _family("grade", "speed_limit", "lens", on=("position",)),
    _family("weather", on=("time",)),
    _family("reaction_delay", "leader_acceleration", "several_leaders"),
    _family("speed_dependent_time_gap", "resignation"),
    _family("relaxation", "gap_relaxation", on=("time_since_change",), time_gap_on=("time_since_change",)),
    _family(
        "lane_friction", "no_undertaking", on=("speed_beside", "vehicles_beside"), time_gap_on=("vehicles_beside",)
    ),
    _family("rear_pressure", on=("follower_gap",), time_gap_on=("follower_gap",)),
    _family("leader_class", "clock_offset", on=("leader_length",), time_gap_on=("leader_length",)),
    _family(on=("lateral_offset",), time_gap_on=("lateral_offset",)),
    _family("lane_desired_speed", on=("lane",)),
    _family("asymmetry", "approach_rate_gain", on=("approach_rate",)),
)
"""Families whose members are fitted together."""

CONFOUNDED = (
    *FAMILIES,
    _family("several_leaders", "variance_driven_time_gap", on=("second_gap", "leader_acceleration")),
    _family(
        "reaction_delay",
        "leader_acceleration",
        "asymmetry",
        "approach_rate_gain",
        on=("leader_acceleration", "approach_rate"),
    ),
    _family("speed_dependent_time_gap", "resignation", on=("speed", "gap")),
    _family("speed_limit", "grade", "weather", "lens", on=("time", "position", "speed")),
    _family("relaxation", "gap_relaxation", on=("gap", "second_gap")),
)
"""Families in which one candidate may only fit the remainder of another with a slightly different form."""


def with_families(terms: set[Term], known: set[Term]) -> set[Term]:
    """The candidates together with those members of their families that are among the `known` candidates."""
    related = {member for family in FAMILIES if terms & set(family) for member in family}
    return terms | (related & known)


def confounded(first: Term, other: Term) -> bool:
    """True if one of the two may only fit a remainder of the other."""
    return any(first in family and other in family for family in CONFOUNDED)


DISTINGUISHING_DATA = {
    ("bend", "speed_limit"): "a map, or signs: both limit the speed of all vehicles on a section",
    ("grade", "speed_limit"): (
        "free vehicles with different desired speeds on the section: a limit slows only fast ones, a slope all"
    ),
    ("lens", "grade"): "a second camera, or vehicles that pass at very different speeds: a distortion shifts all alike",
    ("reaction_delay", "leader_acceleration"): "faster changes of the leader's speed, above 0.2 Hz",
    ("several_leaders", "leader_acceleration"): "a second leader whose speed changes differently from the first's",
    ("speed_dependent_time_gap", "resignation"): "the same speed reached from above and from below, minutes apart",
    ("leader_class", "leader_length"): "trucks of different lengths, and long cars",
    ("weather", "time"): "a longer record, or a second one in other weather",
}
"""Data that would distinguish two candidates; a free curve is listed under the name of its variable."""


def distinguishing_data(term: Term, chosen: Sequence[Term]) -> str:
    """Data that would distinguish a candidate from the chosen ones."""
    for other in chosen:
        for pair, data in DISTINGUISHING_DATA.items():
            if {member.variable or member.effect for member in (term, other)} == set(pair):
                return data
    return "more drivers, or a wider range of the variables that both depend on"
