"""Calibration, screen and decision."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.discovery.observe import clocks
from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.drivers import IDM_PRIOR
from rearl_jax.discovery.observe.fit import Fit, joint_fit
from rearl_jax.discovery.observe.fit_state import replaced
from rearl_jax.discovery.observe.kalman import Noise
from rearl_jax.discovery.observe.noise import calibrate
from rearl_jax.discovery.observe.uncertainty import complexity_penalty, interval
from rearl_jax.discovery.report.verdict import candidate_rows
from rearl_jax.discovery.search import decision, families
from rearl_jax.discovery.search.null import Null, summarise
from rearl_jax.discovery.search.outcome import Round
from rearl_jax.discovery.search.refit import nested, starts
from rearl_jax.discovery.search.screen import Score, evidences, scores
from rearl_jax.discovery.search.simulated_drives import simulate_again
from rearl_jax.discovery.search.simulation import is_contradicted, simulated_gains
from rearl_jax.discovery.thresholds import THRESHOLDS
from tests.discovery.search.searches import fitted_at, round_of, search_of


def test_standard_parameters_are_usual_drivers():
    params = IDM_PRIOR.drivers(np.zeros((IDM_PRIOR.size, 2)), np.array([0.0, 1.0]))
    assert params.desired_speed.tolist() == pytest.approx([32.0, 25.0])
    one = IDM_PRIOR.drivers(np.eye(IDM_PRIOR.size)[:, :1], np.zeros(1))
    assert float(one.desired_speed[0]) == pytest.approx(IDM_PRIOR.usual_car[0] * np.exp(IDM_PRIOR.spread[0]))


def test_drivers_are_found_again(solver, calibrated):
    """Drives simulated from known drivers, seen through noise: the calibration finds them where the data can tell."""
    state, noise = calibrated
    again = simulate_again(solver, state, noise, np.random.default_rng(3))
    truth = state.z.copy()
    solver.solve([again], iterations=25)
    deviations = np.sqrt(again.own_variance)
    told = deviations < 0.5
    assert told.sum() > 10
    errors = (again.z - truth)[told] / deviations[told]
    assert np.abs(again.z - truth)[told].max() > 1e-3, "nothing was searched"
    assert np.sqrt(np.mean(errors**2)) < 2.0
    assert np.mean(np.abs(errors) < 1.645) > 0.7


@pytest.mark.slow
def test_what_is_planted_in_the_model_is_what_the_screen_sees(solver, calibrated):
    """Drives simulated with leader acceleration, screened without it."""
    state, _ = calibrated
    layout, term = solver.layout, Term("leader_acceleration")
    theta = layout.with_values(layout.reference, {"leader_acceleration.gain": 0.5})
    planted = replace(state, theta=theta, active=(term,))
    again = simulate_again(solver, planted, Noise(0.1, 1.5, 0.1), np.random.default_rng(0))
    again = replace(again, active=(), theta=layout.reference.copy(), z=state.z.copy(), mean=state.mean.copy())
    solver.solve([again], iterations=12)
    (found,) = scores(solver, [again])
    evidence = evidences(again, found, layout)
    best = max(evidence, key=lambda key: evidence[key])
    assert best in (term, Term("dependence", "leader_acceleration"))
    assert evidence[term] > 10
    place = layout.candidates[term].directions.index(layout.places["leader_acceleration.gain"][0])
    assert found[term].fitted()[place] == pytest.approx(0.5, abs=0.25)
    solver.sums([planted])
    assert complexity_penalty(solver, planted, layout.candidates[term].free) > 0


@pytest.mark.slow
def test_candidates_on_top_of_what_was_added_are_scored_without_it(solver, calibrated):
    """The direction of an effect that is in the model already has a score near zero."""
    state, _ = calibrated
    term = Term("speed_dependent_time_gap")
    added = replaced(state, active=(term,))
    solver.solve([added], iterations=15)
    (found,) = scores(solver, [added])
    assert abs(found[term].score[0]) < 1e-2 * np.sqrt(found[Term("asymmetry")].information[0, 0]) + 1.0
    assert (
        found[term].information[0, 0] < 1 / solver.layout.scale[list(solver.layout.candidates[term].directions)][0] ** 2
    )


def test_the_screen_sees_with_everybody_what_the_fitted_alone_hardly_show(solver, calibrated):
    """A small effect in drives of all, one half of whom is fitted."""
    state, noise = calibrated
    layout, term = solver.layout, Term("leader_acceleration")
    theta = layout.with_values(layout.reference, {"leader_acceleration.gain": 0.3})
    planted = simulate_again(solver, replace(state, theta=theta, active=(term,)), noise, np.random.default_rng(1))
    data = replace(state.data, y=planted.pieces.y)
    halves = [data.select(np.flatnonzero(data.driver % 2 == half)) for half in (0, 1)]
    alone = Fit(None, *calibrate(solver, halves[0]))
    both = joint_fit(solver, alone, halves[1])
    assert both.state.data.n_drivers == len(both.state.z) == data.n_drivers
    twice = [alone.state] * 2  # as many pieces as both have: one program for all
    seen = scores(solver, twice)[0], scores(solver, [both.state])[0]
    evidence = [evidences(fit.state, score, layout)[term] for fit, score in zip((alone, both), seen, strict=True)]
    assert evidence[1] > 1.5 * evidence[0] > 0


def test_null_counts_nats_above_what_nothing_gives():
    a, b = Term("a"), Term("b")
    null = summarise([{a: -1.0, b: 4.0}, {a: 1.0, b: 8.0}])
    assert null.mean == {a: 0.0, b: 6.0}
    assert null.replicates == 2
    assert null.excess({a: 5.0, b: 5.0}) == {a: 5.0, b: -1.0}
    z_score = null.z_scores({a: 5.0, b: 12.0})
    assert z_score[a] == pytest.approx(5.0 / np.sqrt(2))
    # A mean far below zero and a tiny spread must not make the threshold sharp.
    sharp = Null({a: -50.0}, {a: 1e-3}, 30)
    assert sharp.z_scores({a: 0.0}) == {a: 3.0}
    assert sharp.threshold(4.5) == {a: 1.5}


def test_one_driver_counts_no_more_than_what_was_seen_of_it(calibrated):
    data = calibrated[0].data
    loud = np.zeros(data.n_drivers)
    loud[0] = 500.0
    assert data.driver_minutes.max() < 1
    assert decision.bounded_gains(loud, data)[0] == THRESHOLDS.most_from_one_driver
    slow = replace(data, dt=10 * data.dt)  # the same steps, ten times as long
    expected = THRESHOLDS.most_from_one_driver * slow.driver_minutes[0]
    assert decision.bounded_gains(loud, slow)[0] == pytest.approx(expected)
    assert expected > 3 * THRESHOLDS.most_from_one_driver


def test_others_must_agree(trial):
    broad = trial("b", [2.0] * 10, [2.0] * 10)
    assert broad.holds
    assert not trial("c", [2.0] * 10, [-1.0] * 10).holds
    assert not trial("d", [0.3] * 10, [5.0] * 10).holds
    assert not trial("little in all", [1.0] * 10, [0.7] * 10).holds
    assert trial("a little more", [1.0] * 10, [0.9] * 10).holds
    close = trial("e", [1.9] * 10, [2.0] * 10)
    best = decision.believed([trial("f", [0.1] * 10, [0.1] * 10), close, broad])
    assert [one.candidate.term.effect for one in best] == ["b", "e"]
    assert [one.candidate.term.effect for one in decision.indistinguishable(best)] == ["b", "e"]


def test_what_is_to_be_had_where_nothing_is_missing_does_not_count(trial):
    sound, lucky = (
        trial(name, [1.5] * 10, [1.0] * 10, null_mean=null_mean) for name, null_mean in (("a", 0.0), ("b", 8.0))
    )
    assert (sound.gain, sound.check) == (lucky.gain, lucky.check)
    assert sound.total - lucky.total == 8.0
    assert sound.holds
    assert not lucky.holds
    null = Null({Term("a"): 8.0, Term("b"): -1.0}, {}, 30)
    assert (null.null_mean(Term("a")), null.null_mean(Term("b"))) == (8.0, 0.0)


def test_what_convinces_others_far_more_is_believed_before_what_holds(trial):
    holds, hardly = trial("holds", [0.7] * 10, [1.5] * 10), trial("hardly", [0.3] * 10, [4.0] * 10)
    loses, close = trial("loses", [0.1] * 10, [4.0] * 10), trial("close", [0.3] * 10, [2.0] * 10)
    assert [one.holds for one in (holds, hardly, loses, close)] == [True, False, False, False]
    assert [one.candidate.term.effect for one in decision.believed([holds, hardly, loses, close])] == [
        "hardly",
        "holds",
    ]
    assert decision.believed([hardly, loses]) == []


@pytest.mark.parametrize(("fires", "doubtful"), [(True, True), (False, False)])
def test_what_is_beaten_by_something_not_believed_is_doubtful(trial, solver, calibrated, fires, doubtful):
    holds, loses = trial("holds", [0.6] * 10, [1.3] * 10), trial("loses", [0.1] * 10, [2.5] * 10)
    assert decision.believed([holds, loses]) == [holds]
    turn = round_of(calibrated, [holds, loses], [holds], exceeding=["holds", "loses"] if fires else ["holds"])
    assert search_of(solver, calibrated, turn).is_doubtful(holds) == doubtful


@pytest.mark.parametrize(("seconds", "counts"), [(0.05, False), (-0.05, False), (0.28, False), (0.32, True)])
def test_a_delay_as_short_as_the_lag_of_vehicles_is_no_reaction_time(trial, calibrated, seconds, counts):
    holds, delay = trial("holds", [0.6] * 10, [1.3] * 10), trial("reaction_delay", [0.1] * 10, [2.5] * 10)
    delay = fitted_at(delay, seconds)
    turn = round_of(calibrated, [holds, delay], [holds], exceeding=["holds", "reaction_delay"])
    assert turn.is_beaten == counts
    assert (delay in turn.possible) == counts  # otherwise it would take all confidence from what was found


@pytest.mark.parametrize(("seconds", "gain", "imitates"), [(0.1, 2.5, True), (0.4, 2.5, False), (0.1, 0.7, False)])
def test_a_fast_response_that_a_short_delay_explains_better_is_no_effect(trial, calibrated, seconds, gain, imitates):
    fast, slow = (trial(name, [0.6] * 10, [1.3] * 10) for name in ("leader_acceleration", "resignation"))
    delay = fitted_at(trial("reaction_delay", [2.5] * 10, [gain] * 10), seconds)
    if gain < 1:
        delay = replace(delay, fitted=np.full(10, 0.4))
    assert decision.imitating([fast, slow, delay]) == ({Term("leader_acceleration")} if imitates else set())


@pytest.mark.parametrize(("share", "gain", "imitates"), [(1.1, 2.5, True), (0.8, 2.5, False), (1.1, 9.0, False)])
def test_a_curve_over_the_leaders_acceleration_is_no_effect_if_drivers_copy_it(trial, share, gain, imitates):
    copy = fitted_at(trial("leader_acceleration", [2.5] * 10, [2.5] * 10), share)
    curve = trial("dependence", [2.5] * 10, [gain] * 10, kind="generic", variable="leader_acceleration")
    as_curve = {"term": Term("dependence", "leader_acceleration"), "variables": copy.candidate.variables}
    curve = replace(curve, candidate=replace(curve.candidate, **as_curve))
    other = trial("dependence", [2.5] * 10, [2.5] * 10, kind="generic", variable="lane")
    expected = {Term("dependence", "leader_acceleration")} if imitates else set()
    assert decision.imitating([copy, curve, other]) == expected


@pytest.mark.parametrize(("kinds", "doubtful"), [(("driver", "generic"), False), (("generic", "driver"), True)])
def test_a_name_after_a_free_curve_is_doubtful(trial, solver, calibrated, kinds, doubtful):
    """The remainder after a curve may belong to the effect that the curve stands for."""
    added = {kind: trial(kind, [0.6] * 10, [0.3] * 10, kind=kind, variable=kind) for kind in kinds}
    turns = [round_of(calibrated, [one], [one], exceeding=[kind]) for kind, one in added.items()]
    search = search_of(solver, calibrated, *turns)
    assert search.is_doubtful(added["driver"]) == doubtful
    assert not search.is_doubtful(added["generic"])


@pytest.mark.parametrize(
    ("kind", "variable", "doubtful"), [("generic", "speed", True), ("generic", "gap", False), ("driver", "gap", True)]
)
def test_a_curve_that_was_taken_back_leaves_its_dependence_and_an_effect_a_contradiction(
    trial, solver, calibrated, kind, variable, doubtful
):
    named = trial("named", [0.6] * 10, [0.3] * 10, variable="speed")
    back = trial("back", [0.6] * 10, [0.3] * 10, kind=kind, variable=variable)
    turn = round_of(calibrated, [named], [named], exceeding=["named"])
    assert search_of(solver, calibrated, turn, rejected=[back]).is_doubtful(named) == doubtful


def test_a_model_is_never_worse_than_the_one_it_contains(solver, calibrated):
    state, noise = calibrated
    candidate = solver.layout.candidates[Term("leader_acceleration")]
    base = Fit(None, replaced(state), noise)
    solver.solve([base.state], iterations=3)
    theta = state.theta.copy()
    theta[list(candidate.free)] = 1.5
    stuck = replaced(base.state, theta=theta, active=(candidate.term,))
    stuck.objective = base.state.objective + 190.0
    (fit,) = nested(solver, base, {candidate.term: Fit(candidate, stuck, noise)}).values()
    assert fit.state.objective <= base.state.objective + 0.1


def test_a_section_that_is_fitted_again_stays_on_its_part_of_the_road(solver, calibrated):
    state, noise = calibrated
    candidate, middle = solver.layout.candidates[Term("grade")], float(np.median(state.data.y))
    section = {"grade.start": middle - 100.0, "grade.end": middle + 100.0}
    theta = solver.layout.with_values(state.theta, {"grade.push": 1.5} | section)
    stuck = replaced(state, theta=theta, active=(candidate.term,), objective=state.objective + 190.0)
    (fit,) = nested(solver, Fit(None, state, noise), {candidate.term: Fit(candidate, stuck, noise)}).values()
    assert fit.state.objective <= state.objective + 0.1
    values = solver.layout.by_name(jnp.asarray(fit.state.theta))
    assert abs(values["grade.push"][0]) < 1.0
    assert values["grade.start"][0] > middle - 1000.0
    assert values["grade.end"][0] < middle + 1000.0


def test_simulations_are_asked_for_as_much_as_they_show(calibrated):
    data = calibrated[0].data
    before = np.full(data.n_drivers, 2.0)
    gains = simulated_gains(before, before / 2, data)
    assert gains.min() > 0
    np.testing.assert_allclose(simulated_gains(before, before, data), 0.0)
    lost = np.where(np.arange(len(before)) == 0, 100.0 * before, 0.9 * before)
    borne = simulated_gains(before, 1.01 * before, data)
    assert not is_contradicted(simulated_gains(before, lost, data), borne)
    assert is_contradicted(simulated_gains(before, 1.1 * before, data), borne)
    # A difference far below the error of the positions says nothing.
    assert np.abs(simulated_gains(before * 1e-3, before * 1e-4, data)).max() < 1e-2


def test_confusable_candidates_compete_together():
    grade, limit, leader_class = Term("grade"), Term("speed_limit"), Term("leader_class")
    assert families.with_families({grade}, {grade, limit, Term("asymmetry")}) == {grade, limit}
    assert families.confounded(Term("reaction_delay"), Term("leader_acceleration"))
    assert not families.confounded(leader_class, grade)
    assert "map" in families.distinguishing_data(Term("bend"), [limit])
    by_length = Term("time_gap_dependence", "leader_length")
    assert families.distinguishing_data(by_length, [leader_class]).startswith("trucks")
    assert families.distinguishing_data(Term("dependence", "follower_gap"), [leader_class]).startswith("more drivers")


def test_every_member_of_a_family_is_something_that_is_looked_for(solver):
    known = {*solver.layout.candidates, clocks.CLOCK_OFFSET}
    never_changes = {Term("dependence", "lateral_offset"), Term("time_gap_dependence", "lateral_offset")}
    members = {member for family in families.CONFOUNDED for member in family}
    assert len(members) > 25
    assert {member for member in members - known if member.variable is None} == set()
    assert {Term.read(str(member)) for member in members} == members
    assert never_changes <= members


def test_a_twin_stands_behind_the_candidate_that_it_looks_like(solver, calibrated):
    delay, limit, asymmetry = (Term(name) for name in ("reaction_delay", "speed_limit", "asymmetry"))
    fit, evidence = Fit(None, *calibrated), dict(zip((delay, limit, asymmetry), (50.0, 40.0, 1.0), strict=True))
    first, second = (
        decision.Trial(solver.layout.candidates[term], fit, np.full(10, gain), np.full(10, gain), fit.state, 0.0)
        for term, gain in ((delay, 5.0), (limit, 4.0))
    )
    rounds = [
        Round(fit, evidence, evidence, evidence, frozenset(evidence), [first, second], accepted)
        for accepted in ([first], [second], [])
    ]
    rows = candidate_rows(search_of(solver, calibrated, *rounds))
    assert [row["name"] for row in rows] == ["reaction_delay", "speed_limit", "bend", "asymmetry"]
    assert [row["ambiguous"] for row in rows] == [False, False, True, False]
    assert "map" in rows[2]["told_apart_by"]


def test_clocks_are_told_from_shifts_that_are_no_clocks(measured_of):
    """Scores made from known offsets are explained by offsets; scores of unrelated shifts are not."""
    data = measured_of()
    leaders = clocks.main_leaders(data)
    own = data.driver_values(data.vehicle)
    rng = np.random.default_rng(0)
    offset = dict(zip(np.unique(np.r_[own, leaders.ravel()]), rng.normal(0, 0.2, 99), strict=False))
    information = np.zeros((data.n_drivers, clocks.MOST_LEADERS, clocks.MOST_LEADERS))
    truth = np.zeros((data.n_drivers, clocks.MOST_LEADERS))
    for driver, names in enumerate(leaders):
        for k, name in enumerate(names):
            if name >= 0:
                information[driver, k, k] = 400.0
                truth[driver, k] = offset[name] - offset[own[driver]]
    score = information.diagonal(axis1=1, axis2=2) * truth
    by_clock, by_pair = clocks.Clocks(data), clocks.Pairs(data)
    assert by_clock.evidence(score, information) > max(by_pair.evidence(score, information), 10.0)
    found = by_clock.estimate(by_clock.values, score, information).values
    away = dict(zip(by_clock.vehicle.tolist(), found[0], strict=True))
    pairs = [(own[driver], name) for driver, names in enumerate(leaders) for name in names if name >= 0]
    expected, seen = ([known[name] - known[driver] for driver, name in pairs] for known in (offset, away))
    np.testing.assert_allclose(seen, expected, atol=0.1)
    shuffled = rng.permutation(truth.ravel()).reshape(truth.shape) * (information.diagonal(axis1=1, axis2=2) > 0)
    score = information.diagonal(axis1=1, axis2=2) * shuffled
    assert by_clock.evidence(score, information) < by_pair.evidence(score, information)
    # Putting the data right moves leaders by what their clocks were ahead.
    moved = by_clock.corrected(found)
    step, piece = np.argwhere(data.leader >= 0)[0]
    shift = away[int(data.leader[step, piece])] - away[int(data.vehicle[piece])]
    change = moved.surroundings.leader_rear[step, piece] - data.surroundings.leader_rear[step, piece]
    assert change == pytest.approx(shift * data.surroundings.leader_speed[step, piece])
    assert abs(change) > 0


def test_intervals_are_those_of_a_gaussian():
    low, high = interval(1.0, 0.5, 0.9)
    assert (low + high) / 2 == pytest.approx(1.0)
    assert high - low == pytest.approx(2 * 1.6449 * 0.5, rel=1e-3)


@pytest.mark.parametrize("name", ["grade", "speed_limit"])
def test_a_search_has_a_start_even_where_nothing_is_seen_of_a_candidate(solver, calibrated, name):
    # As of a speed limit where drivers follow so closely that their desired speed does not matter.
    state, candidate = calibrated[0], solver.layout.candidates[Term(name)]
    n, n_drivers = len(candidate.directions), state.data.n_drivers
    unseen = Score(np.zeros(n), np.zeros((n, n)), np.zeros((n_drivers, n)), np.zeros((n_drivers, n, n)))
    (start,) = starts(candidate, unseen, state, solver.layout)
    np.testing.assert_array_equal(start, state.theta)
