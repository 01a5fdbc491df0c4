"""Tests that the final model of a search fails; with the verdict `unexplained` at least one."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rearl_jax.discovery.claims import Claim
from rearl_jax.discovery.observe.candidates import NAMED_KINDS
from rearl_jax.discovery.search.adequacy import Adequacy
from rearl_jax.discovery.search.decision import Trial
from rearl_jax.discovery.search.outcome import Search, is_free
from rearl_jax.discovery.thresholds import THRESHOLDS
from rearl_jax.document.table import spoken

TESTS: Mapping[str, str] = {
    "not_stated": "{names} was added, but its strength may be zero, or another candidate is far more likely",
    "of_bounds": "{names} is not found if drivers' parameters may leave their bounds",
    "of_model": "{names} is not found with another car-following model that is about as likely",
    "surpassed": "another candidate that was not added predicts better than {names}",
    "after_curve": "{names} was added after a free curve and may only fit its remainder",
    "beside_curve": "{names} needs a free curve over one of its variables in addition, so it has another form",
    "denied": "{names} predicts the next time step better, but not the simulated drives of other drivers",
    "curve_not_better": "{names} was added, but other drivers are not surely predicted better",
    "heavy_tails": "large prediction errors are too frequent for noise: excess kurtosis {value:.2f}, limit {limit:.2f}",
    "correlated_errors": "successive prediction errors correlate by {value:+.2f} beyond noise alone, limit {limit:.2f}",
    "misjudged_gaps": "noise grows with the response to a misjudged gap, {value:.1f} σ, limit {limit:.1f} σ: drivers "
    "may misjudge gaps",
    "old_decisions": "noise grows with the error of a late decision, {value:.1f} σ, limit {limit:.1f} σ: drivers may "
    "decide at intervals",
    "time_shifts": "time shifts between vehicles remain, {value:.0f} σ, limit {limit:.0f} σ",
    "evidence_left": "the evidence for {names}, which fits no better, is {value:.0f} σ, limit {limit:.0f} σ",
}
"""Sentence on each failed test; σ are standard deviations of what noise alone gives."""


@dataclass(frozen=True)
class FailedTest:
    """A test that the final model fails.

    Attributes:
        test: Key of TESTS.
        names: The effects concerned.
        value: The value of the test; None for a test without a number.
        limit: Its limit.
    """

    test: str
    names: tuple[str, ...] = ()
    value: float | None = None
    limit: float | None = None

    def plain(self) -> dict[str, Any]:
        """The test as in verdict.json."""
        return asdict(self) | {"names": list(self.names)}


def failed_tests(search: Search, effects: Sequence[Claim], adequacy: Adequacy) -> list[FailedTest]:
    """All tests that the final model fails; `effects` are those that are stated."""
    return [*_of_effects(search, effects), *_of_noise(search, effects, adequacy), *_of_rest(search)]


def failed_test_words(failed: Mapping[str, Any]) -> str:
    """A failed test, as in verdict.json, in words."""
    names = " and ".join(spoken(name).replace(".", " on ") for name in failed["names"])
    return TESTS[failed["test"]].format(**{**failed, "names": names})


def _of_effects(search: Search, effects: Sequence[Claim]) -> Iterator[FailedTest]:
    """Tests of the added effects."""
    stated, kinds = {effect.name for effect in effects}, {trial.candidate.kind for trial in search.added}
    unstated = [trial for trial in search.added if trial.candidate.term.effect not in stated]
    if unstated:
        yield FailedTest("not_stated", _names(unstated))
    elif kinds == {"generic"}:
        yield FailedTest("curve_not_better", _names(search.added))
    if kinds & NAMED_KINDS:
        doubts = {id(trial): search.doubts(trial) for trial in search.added}
        for test in dict.fromkeys(doubt for of_trial in doubts.values() for doubt in of_trial if doubt != "denied"):
            yield FailedTest(test, _names([trial for trial in search.added if test in doubts[id(trial)]]))
    curves = [] if search.added else [trial for trial in search.rejected if is_free(trial)]
    if denied := curves + [trial for trial in search.denied if not is_free(trial)]:
        yield FailedTest("denied", _names(denied))


def _of_noise(search: Search, effects: Sequence[Claim], adequacy: Adequacy) -> Iterator[FailedTest]:
    """Tests whether the errors of the final model are noise. Without a named effect, corrected clocks must explain
    everything, see `Adequacy.is_of_clocks`.
    """
    kinds = {effect.kind for effect in effects} | {trial.candidate.kind for trial in search.added}
    is_of_clocks = search.clocks is not None and not kinds & NAMED_KINDS
    if not adequacy.is_normal and not (is_of_clocks and not search.added):
        limit = max(adequacy.tolerated_kurtosis, adequacy.enough_removed)
        yield FailedTest("heavy_tails", (), adequacy.kurtosis, limit)
    if not adequacy.is_white:
        yield FailedTest("correlated_errors", (), adequacy.excess_autocorrelation, THRESHOLDS.most_autocorrelation)
    most = THRESHOLDS.growth_beside_clocks if is_of_clocks else adequacy.most_growth
    for test, value in (("misjudged_gaps", adequacy.misjudgement), ("old_decisions", adequacy.staleness)):
        if value > most:
            yield FailedTest(test, (), value, most)


def _of_rest(search: Search) -> Iterator[FailedTest]:
    """Tests whether the evidence for candidates or for time shifts still exceeds chance."""
    last, limit = search.rounds[-1], THRESHOLDS.unexplained_z_score
    if search.leaves_shifts:
        yield FailedTest("time_shifts", (), last.clock_z_score, limit)
    if not search.added and search.leaves_more:
        strongest = max(last.z_score, key=lambda term: last.z_score[term])
        yield FailedTest("evidence_left", (str(strongest),), last.z_score[strongest], limit)


def _names(trials: Sequence[Trial]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(str(trial.candidate.term) for trial in trials))
