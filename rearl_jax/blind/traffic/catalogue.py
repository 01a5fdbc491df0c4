"""All effects that the generator can hide in drivers and road, by their name in a scenario."""

from rearl_jax.blind.traffic import following, headways, lane_choice, places, unlisted
from rearl_jax.blind.traffic.effect import HiddenEffect

LISTED: dict[str, type[HiddenEffect]] = {
    "reaction_delay": following.SlowReaction,
    "several_leaders": following.Foresight,
    "leader_acceleration": following.BrakeLights,
    "asymmetry": following.HardBraking,
    "lane_friction": following.SlowNeighbours,
    "no_undertaking": following.StayingBehind,
    "speed_dependent_time_gap": headways.SpeedyDistance,
    "variance_driven_time_gap": headways.UneasyTraffic,
    "resignation": headways.Frustration,
    "relaxation": headways.PatienceAfterCutIn,
    "leader_class": headways.TruckAhead,
    "rear_pressure": headways.Tailgated,
    "grade": places.Slope,
    "speed_limit": places.LimitedSection,
    "bend": places.Curve,
    "lane_desired_speed": places.LaneHabits,
    "weather": places.Fog,
}
"""Effects of the library, those with an established name; their kind is `listed`."""

UNLISTED: dict[str, type[HiddenEffect]] = {
    "lateral_offset": unlisted.OffCentre,
    "leader_length": unlisted.LongLeader,
    "vehicles_beside": unlisted.Company,
    "rain": unlisted.Rain,
    "roadworks": unlisted.Roadworks,
    "action_points": unlisted.ActionPoints,
    "perception_noise": unlisted.Misjudgement,
    "dead_zone": unlisted.BlindToSlowApproach,
    "distraction": unlisted.Distraction,
    "smooth_distraction": unlisted.SmoothDistraction,
}
"""Effects outside the library, those without an established name."""

COUNTERPARTS: dict[str, type[HiddenEffect]] = {"anticipation": following.Anticipation}
"""Effects that are only used to mask others."""

HIDDEN = LISTED | UNLISTED | COUNTERPARTS
"""All effects on car following."""

LANE_CHOICE: dict[str, type[HiddenEffect]] = {
    "politeness": lane_choice.GoodManners,
    "keep_right": lane_choice.BackToTheRight,
    "no_passing_on_the_right": lane_choice.NoUndertaking,
    "moving_over": lane_choice.GivingWay,
    "truck_aversion": lane_choice.AwayFromTrucks,
}
"""Effects on lane choice; they act only in free (discretionary) lane changes, see `scenario.FREE_CHANGES`."""
