"""The tests that the final model fails, and the verdict."""

from dataclasses import replace
from itertools import product

import pytest

from rearl_jax.discovery.claims import Claim
from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.report.failed_tests import failed_test_words, failed_tests
from rearl_jax.discovery.report.verdict import verdict_of
from rearl_jax.discovery.search.clock_check import ClockCheck
from tests.discovery.search.searches import ADEQUATE, round_of, search_of

LEFT = {
    "noise": ADEQUATE,
    "heavy_tails": replace(ADEQUATE, kurtosis=0.6, kurtosis_before=0.5),
    "correlated_errors": replace(ADEQUATE, autocorrelation=0.3),
    "misjudged_gaps": replace(ADEQUATE, misjudgement=5.0),
    "old_decisions": replace(ADEQUATE, staleness=5.0),
}
GRADE = Term("grade")


@pytest.fixture
def made(trial, solver, calibrated):
    """Makes a search that added a named effect, a curve or an artefact and rejected or denied others, and what it
    states.
    """

    def make(added="", rejected=False, denied=False, clocks=False, states=True, **last):
        kinds = {"several_leaders": "driver", "dependence": "generic", "lens": "artefact"}
        rounds = []
        if added:
            one = trial(added, [0.6] * 10, [0.3] * 10, kind=kinds[added])
            rounds.append(replace(round_of(calibrated, [one], [one]), z_score={GRADE: 20.0}))
        other = trial("asymmetry", [0.6] * 10, [0.3] * 10, variable="gap")
        ends = replace(round_of(calibrated, contradicted=[other] if denied else []), **last)
        data = calibrated[0].data
        check = ClockCheck(Fit(None, *calibrated), 9.0, 9.0, 0.2, data, data) if clocks else None
        found = search_of(solver, calibrated, *rounds, ends, clocks=check, rejected=[other] if rejected else [])
        return found, [Claim(added, kinds[added], {}, (), 0.98, 90.0)] if added and states else []

    return make


def test_a_model_is_unexplained_only_if_it_fails_a_test(made):
    words = set()
    choices = product(
        ("", "several_leaders", "dependence", "lens"), LEFT.values(), *[(False, True)] * 5, (0.0, 12.0), (0.0, 12.0)
    )
    for added, left, rejected, denied, clocks, states, better, clock, remaining in choices:
        found, stated = made(added, rejected, denied, clocks, states, clock_z_score=clock, z_score={GRADE: remaining})
        failed = failed_tests(found, stated, left)
        word = verdict_of(found, stated, left, predicts_better=better)
        words.add(word)
        assert failed or word != "unexplained"
        assert not failed or word != "named"
        assert {one.test for one in failed} <= {"denied"} or word != "nothing"
        assert all(failed_test_words(one.plain()) for one in failed)
    assert words == {"named", "improved", "unexplained", "artefact", "nothing"}


@pytest.mark.parametrize("test", [name for name in LEFT if name != "noise"])
def test_each_test_of_the_noise_states_what_exceeds_its_limit(test, made):
    (failed,) = failed_tests(*made("several_leaders"), LEFT[test])
    assert failed.test == test
    assert failed.value > failed.limit > 0


@pytest.mark.parametrize(
    ("search", "test", "names"),
    [
        ({"added": "several_leaders", "states": False}, "not_stated", ("several_leaders",)),
        ({"added": "several_leaders", "rejected": True}, "denied", ("asymmetry",)),
        ({"denied": True}, "denied", ("asymmetry",)),
        ({"added": "dependence"}, "curve_not_better", ("dependence",)),
        ({"clock_z_score": 12.0}, "time_shifts", ()),
        ({"z_score": {GRADE: 12.0}}, "evidence_left", ("grade",)),
    ],
)
def test_each_test_of_the_effects_names_them(search, test, names, made):
    (failed,) = failed_tests(*made(**search), ADEQUATE)
    assert (failed.test, failed.names) == (test, names)


def test_a_name_in_doubt_is_a_failed_test_for_each_doubt(made):
    found, stated = made("several_leaders")
    term = frozenset({Term("several_leaders")})
    failed = failed_tests(replace(found, of_bounds=term, of_model=term), stated, ADEQUATE)
    assert [(one.test, one.names) for one in failed] == [
        ("of_bounds", ("several_leaders",)),
        ("of_model", ("several_leaders",)),
    ]


def test_corrected_clocks_must_leave_less_growth_than_effects(made):
    grows = replace(ADEQUATE, staleness=2.4)
    assert not failed_tests(*made("several_leaders", clocks=True), grows)
    (failed,) = failed_tests(*made(clocks=True), grows)
    assert (failed.test, failed.limit) == ("old_decisions", 1.75)
