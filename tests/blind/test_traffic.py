"""The generator: nobody crashes, the plain model is the plain model, and every hidden effect is really there."""

import numpy as np
import pytest

from rearl_jax.blind.traffic import Planted, Scenario
from rearl_jax.blind.traffic.catalogue import COUNTERPARTS, HIDDEN, LISTED, UNLISTED
from rearl_jax.blind.traffic.dataset import hidden_truth
from rearl_jax.blind.traffic.fleet import draw_fleet
from rearl_jax.blind.traffic.population import CARS
from rearl_jax.blind.traffic.simulation import simulate
from rearl_jax.core.effects import EFFECTS
from tests.blind.driving_facts import facts
from tests.refusal import refused

ORDINARY = Scenario(8, n_recordings=2)


@pytest.fixture(scope="module")
def ordinary():
    return simulate(ORDINARY)


def test_drivers_have_the_parameters_asked_for():
    fleet = draw_fleet(Scenario(1, n_vehicles=1500), np.random.default_rng(1))
    cars = ~fleet.is_truck & (fleet.rank > 0)
    for name, (median, sd) in CARS.items():
        values = np.log(getattr(fleet, name)[cars])
        assert np.exp(np.median(values)) == pytest.approx(median, rel=0.03)
        assert np.std(values) == pytest.approx(sd, rel=0.08)
    assert fleet.is_truck[fleet.rank > 0].mean() == pytest.approx(0.15, abs=0.02)
    assert np.median(fleet.desired_speed[fleet.is_truck]) == pytest.approx(25.0, rel=0.02)


def test_drivers_see_transients_cut_ins_and_a_range_of_speeds(ordinary):
    recorded = (ordinary.time >= 0) & (ordinary.time <= 60)
    speed = ordinary.speed[recorded]
    assert np.percentile(speed, 2) < 8.0
    assert np.percentile(speed, 98) > 26.0
    assert np.median(np.ptp(speed, axis=0)) > 8.0
    assert np.count_nonzero(np.diff(ordinary.lane[recorded], axis=0)) == 2 * ORDINARY.lane_changes
    led = ordinary.leader[recorded][0] < ordinary.position.shape[1]
    assert led.sum() == 2 * 36


def test_forced_changes_are_cut_ins(ordinary):
    gap, n_lost = facts(ordinary).gap, 0
    for step, vehicle in zip(*np.nonzero(np.diff(ordinary.lane, axis=0)), strict=True):
        behind = np.flatnonzero((ordinary.leader[step + 1] == vehicle) & (ordinary.leader[step] != vehicle))
        n_lost += sum(gap[step + 1, other] < gap[step, other] for other in behind)
        assert gap[step + 1, vehicle] > 3.0
    assert n_lost >= 10


@pytest.mark.parametrize("name", [None, *HIDDEN])
@pytest.mark.parametrize("strength", [1.0, 2.0])
def test_nobody_crashes(simulated, name, strength):
    events = simulated(name, strength)
    found = facts(events)
    assert np.nanmin(np.where(events.leader < events.position.shape[1], found.gap, np.nan)) > 0.2
    assert events.speed.min() >= 0.0
    assert np.abs(events.acceleration).max() < 9.0


@pytest.mark.parametrize("changes", [{"pace": 0.55, "spacing": 0.9}, {"pace": 1.1, "spacing": 1.5}, {"spread": 1.5}])
def test_nobody_crashes_in_other_traffic(simulated, changes):
    events = simulated(None, driver_noise=0.3, **changes)
    gap = facts(events).gap[events.leader < events.position.shape[1]]
    assert gap.min() > 0.5
    assert events.n_emergencies == 0


def test_without_a_hidden_effect_drivers_follow_the_model_to_the_last_digit(simulated):
    events = simulated()
    found = facts(events)
    assert events.n_emergencies == 0
    assert np.abs(found.remainder[found.follows]).max() < 1e-9
    assert np.nanmax(np.abs(found.time_gap_ratio - 1)) < 1e-6
    assert np.ptp(found.plain[found.follows]) > 3.0  # there was something to follow


def test_drivers_are_noisy_as_asked(ordinary):
    found = facts(ordinary)
    left = found.remainder[found.follows]
    assert left.std() == pytest.approx(0.15, rel=0.05)
    one = found.remainder[:, 5][found.follows[:, 5]]
    lag = 75  # 1.5 s
    assert np.corrcoef(one[:-lag], one[lag:])[0, 1] == pytest.approx(np.exp(-1), abs=0.25)


@pytest.mark.parametrize("name", HIDDEN)
def test_every_hidden_effect_changes_what_drivers_do_and_more_so_the_stronger_it_is(simulated, name):
    sizes = []
    for strength in (1.0, 2.0):
        found = facts(simulated(name, strength))
        sizes.append(np.sqrt(np.mean(found.remainder[found.follows] ** 2)))
    assert sizes[0] > 0.02
    assert sizes[1] > 1.15 * sizes[0]


def slope(x, y):
    """Of the straight line through points, and their correlation."""
    return np.polyfit(x, y, 1)[0], np.corrcoef(x, y)[0, 1]


def test_slow_reaction_is_the_model_of_the_past(simulated):
    events = simulated("reaction_delay")
    found, late = facts(events), 35
    same = found.follows[late:] & found.follows[:-late]
    past, now = found.plain[:-late][same], events.acceleration[late:][same]
    assert np.corrcoef(past, now)[0, 1] > 0.999
    assert np.corrcoef(found.plain[late:][same], now)[0, 1] < 0.9


def test_slope_pushes_inside_its_section_only(simulated):
    events = simulated("grade")
    found, (start, end) = facts(events), events.section
    inside = found.follows & (events.position > start + 25) & (events.position < end - 25)
    outside = found.follows & ((events.position < start - 25) | (events.position > end + 25))
    assert inside.sum() > 1000
    np.testing.assert_allclose(found.remainder[inside], -0.35, atol=1e-9)
    np.testing.assert_allclose(found.remainder[outside], 0.0, atol=1e-9)


def test_limit_holds_those_who_want_to_drive_faster(simulated):
    events = simulated("speed_limit")
    found, (start, end) = facts(events), events.section
    inside = found.follows & (events.position > start + 25) & (events.position < end - 25)
    fleet = events.fleet
    extra = fleet.max_accel * ((events.speed / fleet.desired_speed) ** 4 - (events.speed / 23.0) ** 4)
    expected = np.where(fleet.desired_speed > 23.0, extra, 0.0)
    np.testing.assert_allclose(found.remainder[inside], expected[inside], atol=1e-9)
    assert found.remainder[inside].min() < -0.3


def test_rain_comes_at_its_time(simulated):
    events = simulated("rain")
    found = facts(events)
    wet = found.follows & (events.time > 28.0)[:, None]
    dry = found.follows & (events.time < 25.0)[:, None]
    np.testing.assert_allclose(found.remainder[wet], -0.45, atol=1e-9)
    np.testing.assert_allclose(found.remainder[dry], 0.0, atol=1e-9)


def test_time_gap_is_longer_behind_a_truck(simulated):
    events = simulated("leader_class", duration=90.0)
    found = facts(events)
    n = events.position.shape[1]
    behind_truck = np.append(events.fleet.is_truck, False)[np.minimum(events.leader, n)]
    known = np.isfinite(found.time_gap_ratio)
    assert (known & behind_truck).sum() > 500
    np.testing.assert_allclose(found.time_gap_ratio[known & behind_truck], 1.405, rtol=1e-6)
    np.testing.assert_allclose(found.time_gap_ratio[known & ~behind_truck], 1.0, rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "variable", "expected"),
    [
        ("speed_dependent_time_gap", lambda events: events.speed, 0.35 / 20),
        ("lateral_offset", lambda events: np.minimum(np.abs(events.wander), 0.6), -1.1),
    ],
)
def test_time_gap_follows_its_variable(simulated, name, variable, expected):
    events = simulated(name)
    ratio = facts(events).time_gap_ratio
    known = np.isfinite(ratio)
    found, correlation = slope(variable(events)[known], ratio[known])
    assert found == pytest.approx(expected, rel=0.03)
    assert abs(correlation) > 0.99


def test_leader_length_counts_among_cars(simulated):
    events = simulated("leader_length")
    ratio, n = facts(events).time_gap_ratio, events.position.shape[1]
    length = np.append(events.fleet.length, np.nan)[np.minimum(events.leader, n)]
    cars = np.isfinite(ratio) & (length < 5.5) & (length > 3.7)
    found, correlation = slope(length[cars], ratio[cars])
    assert found == pytest.approx(0.4, rel=0.02)
    assert correlation > 0.99


def test_uneven_traffic_and_lost_time_lengthen_the_time_gap_and_pressure_shortens_it(simulated):
    for name, sign in (("variance_driven_time_gap", 1), ("resignation", 1), ("rear_pressure", -1), ("relaxation", -1)):
        ratio = facts(simulated(name)).time_gap_ratio
        away = sign * (ratio[np.isfinite(ratio)] - 1)
        assert away.min() > -1e-6
        assert np.percentile(away, 99) > 0.15


def test_relaxation_ends(simulated):
    events = simulated("relaxation", duration=60.0, lane_changes=6)
    ratio = facts(events).time_gap_ratio
    changed = np.diff(events.leader, axis=0, prepend=events.leader[:1]) != 0
    last = np.maximum.accumulate(np.where(changed, events.time[:, None], -np.inf), axis=0)
    since = events.time[:, None] - last
    known = np.isfinite(ratio)
    np.testing.assert_allclose(ratio[known & (since > 20.1)], 1.0, rtol=1e-6)
    assert ratio[known & (since < 5.0)].min() < 0.9


def test_braking_is_harder_than_the_model_says(simulated):
    found = facts(simulated("asymmetry"))
    near = found.follows & (found.gap < 150)
    np.testing.assert_allclose(found.remainder[near], -0.22 * np.clip(found.dv[near], 0, 6), atol=1e-9)


def test_slower_neighbours_hold_back_and_never_push(simulated):
    found = facts(simulated("lane_friction"))
    left = found.remainder[found.follows]
    assert left.max() < 1e-9
    assert left.min() == pytest.approx(-0.6, abs=1e-6)
    assert 0.05 < np.mean(left < -0.05) < 0.8


def test_who_is_faster_than_the_left_lane_is_held_back_and_nobody_on_it(simulated):
    events = simulated("no_undertaking")
    found = facts(events)
    left = found.remainder[found.follows]
    assert left.max() < 1e-9
    assert 0.01 < np.mean(left < -0.05) < 0.5
    np.testing.assert_allclose(found.remainder[found.follows & (events.lane == 0)], 0.0, atol=1e-9)
    assert events.speed[found.follows & (found.remainder < -1e-6)].min() > 16.0
    # Half of the rule: braking is between what the model wants and -2 m/s^2.
    assert left.min() >= 0.5 * (-2.0 - found.plain[found.follows].max())


def test_company_costs_acceleration_by_the_vehicle(simulated):
    found = facts(simulated("vehicles_beside"))
    counted = found.remainder[found.follows] / -0.18
    np.testing.assert_allclose(counted, np.rint(counted), atol=1e-6)
    assert {0, 1, 2} <= set(np.rint(counted).astype(int))


def test_roadworks_are_on_one_lane_of_one_section(simulated):
    events = simulated("roadworks")
    found = facts(events)
    felt = found.follows & (found.remainder < -0.1)
    assert felt.sum() > 300
    assert set(events.lane[felt]) == {2}
    assert events.position[felt].min() > events.section[0] - 16
    assert events.position[felt].max() < events.section[1] + 16


def test_brake_lights_follow_the_leaders_acceleration(simulated):
    events = simulated("leader_acceleration")
    found, n = facts(events), events.position.shape[1]
    theirs = np.take_along_axis(events.acceleration, np.minimum(events.leader, n - 1), axis=1)
    near = found.follows & (found.gap < 40)
    gain, correlation = slope(theirs[near], found.remainder[near])
    assert correlation > 0.9
    assert 0.3 < gain < 0.5


def test_action_points_keep_the_acceleration(simulated):
    events = simulated("action_points")
    found = facts(events)
    kept = np.diff(events.acceleration, axis=0)[:, events.fleet.rank > 0] == 0.0
    assert 0.9 < kept.mean() < 1.0
    assert np.isfinite(found.remainder).all()


def test_two_effects_add_up_and_share_the_section(simulated):
    scenario = Scenario(4, (Planted("grade"), Planted("speed_limit")), n_recordings=1)
    first, second = hidden_truth(scenario, simulate(scenario))["planted"]
    assert first["parameters"]["start"] == second["parameters"]["start"]
    assert first["truths"] == ["grade"]
    assert second["truths"] == ["speed_limit", "bend"]


def test_a_seed_is_a_data_set():
    same, other = (simulate(Scenario(seed, n_recordings=1, duration=5.0)) for seed in (3, 4))
    again = simulate(Scenario(3, n_recordings=1, duration=5.0))
    np.testing.assert_array_equal(same.position, again.position)
    assert not np.array_equal(same.position, other.position)


def test_recordings_share_no_driver(ordinary):
    first, second = (ordinary.fleet.time_gap[ordinary.fleet.recording == number] for number in (0, 1))
    assert not set(first) & set(second)


def test_names_are_unique():
    assert not set(LISTED) & set(UNLISTED)
    assert set(COUNTERPARTS) == {"anticipation"}


def test_listed_effects_are_those_of_the_library():
    for effect in LISTED.values():
        assert set(effect.truths) <= set(EFFECTS)


@pytest.mark.parametrize(("changes", "key"), [({"n_vehicles": 40}, "n_vehicles"), ({"frame_rate": 30.0}, "frame_rate")])
def test_impossible_scenarios_are_refused(changes, key):
    with refused("out-of-range", key=key):
        Scenario(1, **changes)
