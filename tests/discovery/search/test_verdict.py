"""The verdict in one word."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.claims import Claim
from rearl_jax.discovery.observe.candidates import LENS, Candidate, Term
from rearl_jax.discovery.observe.clocks import CLOCK_OFFSET, MOST_LEADERS
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.report.verdict import is_on, unseen, verdict_of
from rearl_jax.discovery.search.clock_check import ClockCheck
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.search.screen import Score, evidences
from rearl_jax.discovery.thresholds import THRESHOLDS
from tests.discovery.search.searches import ADEQUATE, round_of, search_of


@pytest.mark.parametrize(("staleness", "expected"), [(0.0, "artefact"), (5.0, "unexplained")])
def test_clocks_that_leave_more_than_noise_do_not_explain_it(solver, calibrated, staleness, expected):
    left, data = replace(ADEQUATE, misjudgement=-1.0, staleness=staleness), calibrated[0].data
    check = ClockCheck(Fit(None, *calibrated), 40.0, 40.0, 0.2, data, data)
    found = search_of(solver, calibrated, round_of(calibrated), clocks=check)
    assert verdict_of(found, [], left, predicts_better=False) == expected
    alone = replace(found, clocks=None)
    assert verdict_of(alone, [], left, predicts_better=False) == ("nothing" if staleness == 0.0 else "unexplained")
    lag = Claim("speed_lag", "artefact", {}, (), 0.98, None)
    assert verdict_of(found, [lag], left, predicts_better=False) == "artefact"


def test_clocks_need_not_leave_smooth_innovations_but_no_old_decisions(solver, calibrated):
    data = calibrated[0].data
    check = ClockCheck(Fit(None, *calibrated), 9.0, 9.0, 0.2, data, data)
    found = search_of(solver, calibrated, round_of(calibrated), clocks=check)
    rough = replace(ADEQUATE, kurtosis=0.3, kurtosis_before=0.3)
    assert not rough.is_adequate
    assert verdict_of(found, [], rough, predicts_better=False) == "artefact"
    assert verdict_of(found, [], replace(rough, staleness=2.4), predicts_better=False) == "unexplained"
    assert verdict_of(found, [], replace(rough, autocorrelation=0.3), predicts_better=False) == "unexplained"


@pytest.mark.parametrize(("z_score", "expected"), [(2.0, "named"), (12.0, "unexplained")])
def test_what_leaves_shifts_between_pairs_is_not_named(trial, solver, calibrated, z_score, expected):
    holds = replace(trial("holds", [0.6] * 10, [0.3] * 10), candidate=solver.layout.candidates[Term("several_leaders")])
    first, ends = (
        round_of(calibrated, [holds], [holds], clock_z_score=12.0),
        round_of(calibrated, clock_z_score=z_score),
    )
    found = search_of(solver, calibrated, first, ends)
    stated = [Claim("several_leaders", "driver", {}, (), 0.98, 90.0)]
    assert verdict_of(found, stated, ADEQUATE, predicts_better=False) == expected
    # What may be off is not stated, and what is not stated is not named.
    assert verdict_of(found, [], ADEQUATE, predicts_better=False) == "unexplained"
    found.rounds = [ends]
    assert verdict_of(found, [], ADEQUATE, predicts_better=False) == {"named": "nothing"}.get(expected, expected)


@pytest.mark.parametrize(("predicts_better", "expected"), [(True, "improved"), (False, "unexplained")])
def test_a_curve_without_a_name_improves_a_model_if_the_error_is_surely_lower(
    trial, solver, calibrated, predicts_better, expected
):
    curve = trial("dependence", [0.6] * 10, [0.3] * 10, kind="generic", variable="gap")
    found = search_of(solver, calibrated, round_of(calibrated, [curve], [curve]), round_of(calibrated))
    stated = [Claim("dependence", "generic", {}, ("gap",), 0.98, 90.0)]
    assert verdict_of(found, stated, ADEQUATE, predicts_better=predicts_better) == expected
    assert verdict_of(found, [], ADEQUATE, predicts_better=predicts_better) == "unexplained"


def test_a_distortion_is_a_curve_that_no_single_value_switches_off(trial, solver, calibrated):
    lens = Candidate(LENS, "artefact", (0, 1, 2), (0, 1, 2), ("position",))
    bent = replace(trial("lens", [0.6] * 10, [0.3] * 10, kind="artefact"), candidate=lens)
    theta, covariance = calibrated[0].theta.copy(), np.diag(np.full(len(lens.free), 0.25))
    theta[list(lens.free)] = 0.9 * np.resize([1.0, -1.0], len(lens.free))
    assert is_on(bent, theta, covariance, solver.layout, 0.95)


@pytest.mark.parametrize(
    ("leftmost", "rightmost", "correlation", "expected"),
    [(0.1, -0.1, 0.999, True), (0.1, -0.1, 0.0, False), (0.1, 0.1, 0.999, False), (0.5, 0.0, 0.0, True)],
)
def test_strengths_that_only_together_differ_from_off_are_on(
    trial, solver, calibrated, leftmost, rightmost, correlation, expected
):
    """On two lanes the data tell the difference of the desired speeds from lane to lane, but not each of them."""
    candidate = solver.layout.candidates[Term("lane_desired_speed")]
    faster = replace(trial("lane_desired_speed", [0.6] * 10, [0.3] * 10), candidate=candidate)
    theta = calibrated[0].theta.copy()
    theta[list(candidate.free)] = leftmost, rightmost
    covariance = 0.1**2 * np.array([[1.0, correlation], [correlation, 1.0]])
    assert is_on(faster, theta, covariance, solver.layout, 0.9) is expected


def test_an_artefact_that_is_not_stated_is_no_verdict(trial, solver, calibrated):
    bent = trial("lens", [0.6] * 10, [0.3] * 10, kind="artefact")
    found = search_of(solver, calibrated, round_of(calibrated, [bent], [bent]), round_of(calibrated))
    stated = [Claim("lens", "artefact", {}, ("position",), 0.98, 90.0)]
    assert verdict_of(found, stated, ADEQUATE, predicts_better=True) == "artefact"
    assert verdict_of(found, [], ADEQUATE, predicts_better=True) == "unexplained"


@pytest.mark.parametrize(("known", "by_chance", "spread", "needed"), [
    (0.2, -1.0, 0.5, THRESHOLDS.least_total),
    (300.0, 2.0, 0.5, THRESHOLDS.least_total + 2.0),
    (0.2, 0.0, 4.5, 4.5 * THRESHOLDS.candidate_z_score),
    (300.0, 2.0, 9.0, THRESHOLDS.total_below_z_score + 2.0),
])  # fmt: skip
def test_the_weakest_effect_that_can_be_seen_gives_the_evidence_that_is_needed(
    solver, calibrated, known, by_chance, spread, needed
):
    state, layout, effect = calibrated[0], solver.layout, Term("approach_rate_gain")

    def score(n, strength=0.0):
        information = np.diag(np.full(n, known / layout.scale[layout.candidates[effect].free[0]] ** 2))
        nothing = np.zeros((state.data.n_drivers, n))
        return Score(strength * information[0], information, nothing, np.zeros((state.data.n_drivers, n, n)))

    scores = {term: score(len(candidate.directions)) for term, candidate in layout.candidates.items()}
    scores[CLOCK_OFFSET] = score(MOST_LEADERS)
    null = Null(dict.fromkeys(scores, by_chance), dict.fromkeys(scores, spread), 9)
    found = replace(search_of(solver, calibrated, round_of(calibrated)), null=null, first_scores=scores)
    rows = {row["name"]: row for row in unseen(found)}
    strong = scores | {effect: score(len(layout.candidates[effect].directions), rows[effect.effect]["strength"])}
    assert evidences(state, strong, layout)[effect] == pytest.approx(needed)
    assert rows["reaction_delay"]["strength"] >= THRESHOLDS.vehicle_lag  # a shorter one is no reaction time
    nothing = {term: replace(one, information=0.0 * one.information) for term, one in scores.items()}
    assert all(row["strength"] is None for row in unseen(replace(found, first_scores=nothing)))
