"""Candidates that are easily taken for one another: where one fires, all are fitted and compete.

Source: share of a candidate's detectable signal that another can imitate, from the projected Fisher information.
"""

FAMILIES = (
    ("grade", "speed_limit", "lens", "dependence.position"),
    ("weather", "dependence.time"),
    ("reaction_delay", "leader_acceleration", "several_leaders"),
    ("speed_dependent_time_gap", "resignation"),
    ("relaxation", "dependence.time_since_change", "time_gap_dependence.time_since_change"),
    (
        "lane_friction",
        "no_undertaking",
        "dependence.speed_beside",
        "dependence.vehicles_beside",
        "time_gap_dependence.vehicles_beside",
    ),
    ("rear_pressure", "dependence.follower_gap", "time_gap_dependence.follower_gap"),
    ("leader_class", "dependence.leader_length", "time_gap_dependence.leader_length", "clock_offset"),
    ("dependence.lateral_offset", "time_gap_dependence.lateral_offset"),
    ("lane_desired_speed", "dependence.lane"),
    ("asymmetry", "dependence.approach_rate"),
)

KINSHIPS = (
    *FAMILIES,
    ("several_leaders", "variance_driven_time_gap", "dependence.second_gap", "dependence.leader_acceleration"),
    (
        "reaction_delay",
        "leader_acceleration",
        "dependence.leader_acceleration",
        "asymmetry",
        "dependence.approach_rate",
    ),
    ("speed_dependent_time_gap", "resignation", "dependence.speed", "dependence.gap"),
    ("speed_limit", "grade", "weather", "dependence.time", "dependence.position", "lens", "dependence.speed"),
    ("relaxation", "dependence.gap", "dependence.second_gap"),
)
"""Candidates of which one may be no more than what another, of a slightly other form, has left."""


def with_families(names: set[str], known: set[str]) -> set[str]:
    """The candidates and all members of their families that there are."""
    related = {member for family in FAMILIES if names & set(family) for member in family}
    return names | (related & known)


def are_kin(one: str, other: str) -> bool:
    """Whether one may be a remainder of the other."""
    return any(one in kinship and other in kinship for kinship in KINSHIPS)


APART = {
    ("bend", "speed_limit"): "a map, or signs: both cap the speed of everybody on a stretch",
    (
        "grade",
        "speed_limit",
    ): "free vehicles with different desired speeds on the stretch: a limit stops the fast ones, a slope slows all",
    ("lens", "grade"): "a second camera, or vehicles that pass at very different speeds: a distortion shifts all alike",
    ("reaction_delay", "leader_acceleration"): "faster changes of the leader's speed, above 0.2 Hz",
    ("several_leaders", "leader_acceleration"): "a second leader that does something else than the first",
    ("speed_dependent_time_gap", "resignation"): "the same speed reached from above and from below, minutes apart",
    ("leader_class", "leader_length"): "trucks of different lengths, and long cars",
    ("weather", "time"): "a longer record, or a second one in other weather",
}
"""What data would tell candidates apart; a free curve goes by the name of its variable."""


def told_apart_by(name: str, chosen: list[str]) -> str:
    """What data would tell a candidate from those that were chosen."""
    for other in chosen:
        for pair, words in APART.items():
            if {one.rpartition(".")[2] for one in (name, other)} == set(pair):
                return words
    return "more drivers, or a wider range of what they depend on"
