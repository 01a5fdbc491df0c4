"""Result of each candidate of car following: added, or the test that it failed."""

from collections.abc import Mapping

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.search.decision import Trial, copies_leader, is_everywhere, is_too_short
from rearl_jax.discovery.search.outcome import Search
from rearl_jax.discovery.thresholds import THRESHOLDS

RESULTS: Mapping[str, str] = {
    "added": "added to the model",
    "not_distinguished": "explains the data as well as the added one",
    "predicts_no_better": "left out: other drivers are not predicted significantly better",
    "contradicted": "simulations of other drivers contradict it",
    "too_short": "a delay as short as the lag of vehicles, or within the time resolution",
    "copies_leader": "repeats the leader's acceleration at once: both positions may share an error",
    "everywhere": "a section without an end in the data: a property of the drivers",
    "worse_on_others": "other drivers are predicted worse",
    "too_little": "gains too little",
    "surpassed": "another candidate gains more",
    "within_chance": "evidence within chance",
    "not_fitted": "not fitted: weaker than those that were",
}
"""Meaning of the `result` of a candidate."""


def result_of(search: Search, term: Term) -> str:
    """Key of RESULTS for a candidate of car following; if it failed several tests, that of the last one."""
    if any(trial.candidate.term == term for trial in search.added):
        return "added"
    if any(trial.candidate.term == term for round_ in search.rounds for trial in round_.alternatives):
        return "not_distinguished"
    if term in search.unpredictive:
        return "predicts_no_better"
    contradicted = [*search.rejected, *(trial for round_ in search.rounds for trial in round_.contradicted)]
    if any(trial.candidate.term == term for trial in contradicted):
        return "contradicted"
    trials = [trial for round_ in search.rounds for trial in round_.trials if trial.candidate.term == term]
    if trials:
        return _failed_test(trials[0], is_exceeding=term in search.rounds[0].exceeding)
    return "not_fitted" if search.rounds[0].z_score[term] > THRESHOLDS.candidate_z_score else "within_chance"


def _failed_test(trial: Trial, *, is_exceeding: bool) -> str:
    if is_too_short(trial):
        return "too_short"
    if copies_leader(trial):
        return "copies_leader"
    if is_everywhere(trial):
        return "everywhere"
    if trial.check <= THRESHOLDS.worst_check:
        return "worse_on_others"
    if not trial.holds:
        return "too_little"
    if not is_exceeding and trial.total <= THRESHOLDS.total_below_z_score:
        return "within_chance"
    return "surpassed"
