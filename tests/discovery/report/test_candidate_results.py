"""Results of candidates: the test that each one failed."""

from dataclasses import replace

import numpy as np
import pytest

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.report.candidate_results import RESULTS, result_of
from rearl_jax.discovery.search.decision import Trial
from rearl_jax.discovery.search.outcome import is_significant
from rearl_jax.discovery.thresholds import THRESHOLDS
from tests.discovery.search.searches import fitted_at, search_that_added

DELAY, GRADE, GAIN = Term("reaction_delay"), Term("grade"), Term("approach_rate_gain")
LIMIT = Term("speed_limit")


@pytest.fixture
def found(solver, calibrated):
    """A search that added an approach rate gain."""
    outcome = search_that_added(solver, calibrated, ("approach_rate_gain", [0.5]))
    z_score = dict.fromkeys((DELAY, GRADE, GAIN), 0.0) | {LIMIT: 2 * THRESHOLDS.candidate_z_score}
    first = replace(outcome.rounds[0], z_score=z_score, exceeding=frozenset({GAIN, GRADE}))
    return replace(outcome, rounds=[first, *outcome.rounds[1:]])


def on_section(layout, trial: Trial, share: float) -> Trial:
    """The trial of a grade on the last share of the measured road."""
    state = trial.fit.state
    first, last = state.data.y.min(), state.data.y.max()
    section = {"grade.start": last - share * (last - first), "grade.end": last + 100.0}
    return fitted_at(trial, layout.with_values(state.theta, section)[list(trial.candidate.free)])


def with_trial(found, term: Term, gain: float, check: float, exceeding: bool = True):
    """The search after a trial of a candidate was not accepted in the first round."""
    first, state = found.rounds[0], found.first.state
    n = len(state.z)
    fitted, checked = np.full(n, gain / n), np.full(n, check / n)
    trial = Trial(found.layout.candidates[term], first.base, fitted, checked, state, 0.0)
    if term == DELAY:
        trial = fitted_at(trial, 1.0)
    elif term == GRADE:
        trial = on_section(found.layout, trial, 0.5)
    terms = first.exceeding | {term} if exceeding else first.exceeding - {term}
    changed = replace(first, trials=[*first.trials, trial], exceeding=frozenset(terms))
    return replace(found, rounds=[changed, *found.rounds[1:]]), trial


def test_added_removed_and_contradicted(found):
    assert result_of(found, GAIN) == "added"
    searched, trial = with_trial(found, GRADE, 30.0, 30.0)
    removed = replace(searched, rejected=[trial])
    assert result_of(removed, GRADE) == "contradicted"
    assert result_of(replace(removed, unpredictive=frozenset({GRADE})), GRADE) == "predicts_no_better"
    denied = replace(searched.rounds[0], contradicted=[trial])
    assert result_of(replace(searched, rounds=[denied, *searched.rounds[1:]]), GRADE) == "contradicted"


def test_a_candidate_that_explains_the_data_as_well(found):
    best = found.rounds[0].accepted[0]
    searched, trial = with_trial(found, GRADE, best.gain, best.check)
    assert result_of(searched, GRADE) == "surpassed"
    equal = replace(searched.rounds[0], accepted=[best, trial])
    assert result_of(replace(searched, rounds=[equal, *searched.rounds[1:]]), GRADE) == "not_distinguished"


@pytest.mark.parametrize(
    ("gain", "check", "exceeding", "said"),
    [
        (30.0, -4.0, True, "worse_on_others"),
        (2.0, 30.0, True, "too_little"),
        (5.0, 5.0, True, "too_little"),
        (10.0, 10.0, False, "within_chance"),
        (10.0, 10.0, True, "surpassed"),
        (100.0, 100.0, False, "surpassed"),
    ],
)
def test_the_test_that_a_fitted_candidate_failed(found, gain, check, exceeding, said):
    searched, _ = with_trial(found, GRADE, gain, check, exceeding)
    assert result_of(searched, GRADE) == said


def test_a_delay_within_the_lag_of_vehicles_is_too_short(found):
    searched, trial = with_trial(found, DELAY, 30.0, 30.0)
    assert result_of(searched, DELAY) == "surpassed"
    first = replace(searched.rounds[0], trials=[fitted_at(trial, 0.01)])
    assert result_of(replace(searched, rounds=[first]), DELAY) == "too_short"


@pytest.mark.parametrize(("share", "said"), [(0.9, "surpassed"), (1.1, "everywhere")])
def test_a_section_without_an_end_in_the_data_is_a_property_of_the_drivers(found, share, said):
    searched, trial = with_trial(found, GRADE, 30.0, 30.0)
    trial = on_section(found.layout, trial, share)
    assert is_significant(trial, {GRADE}) == (said == "surpassed")
    first = replace(searched.rounds[0], trials=[trial])
    assert result_of(replace(searched, rounds=[first]), GRADE) == said


@pytest.mark.parametrize(("gain", "said"), [(0.5, "surpassed"), (1.1, "copies_leader")])
def test_who_accelerates_at_once_as_hard_as_the_leader_shares_its_error(found, gain, said):
    term = Term("leader_acceleration")
    searched, trial = with_trial(found, term, 30.0, 30.0)
    first = replace(searched.rounds[0], trials=[fitted_at(trial, gain)])
    assert result_of(replace(searched, rounds=[first]), term) == said


def test_candidates_that_were_not_fitted(found):
    assert result_of(found, LIMIT) == "not_fitted"
    assert result_of(found, GRADE) == "within_chance"


def test_every_result_has_words():
    assert all(words and words[0].islower() for words in RESULTS.values())
