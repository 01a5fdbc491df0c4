"""The loop of proposals around a function that tries mixtures out, and a language model in it."""

import json

import pytest

from rearl_jax.baselines.critical.adaptation import Assessment, Proposal, Trial, adapt_by_rounds, best_of
from rearl_jax.baselines.critical.asking import LanguageModelProposer, Reply
from rearl_jax.baselines.critical.mixture import ALL_REGULAR, Mixture, grid


def assessing(calls):
    """The more trucks, the better; every call is noted."""

    def assess(candidates):
        calls.append(list(candidates))
        return [Assessment(0.5 - 0.1 * mix.truck, 0.4, 3, round(10 * mix.aggressive), 160) for mix in candidates]

    return assess


def test_the_best_point_of_a_grid_is_kept_in_one_call():
    calls = []
    found = best_of(grid(), assessing(calls), "search")
    assert [len(call) for call in calls] == [56]
    assert found.mixture == found.trials[found.selected].mixture == Mixture(0.0, 0.0, 1.0)
    assert found.n_rounds == 1
    assert found.trials[found.selected].assessment.crashed_share == pytest.approx(3 / 160)


def test_the_last_valid_proposal_is_kept_whatever_it_came_to():
    good, worse = Mixture(0.0, 0.0, 0.8), Mixture(0.3, 0.0, 0.1)
    proposals = {
        1: Proposal(None, 5, "unparsable"),
        2: Proposal(good, 1, "answered"),
        3: Proposal(good, 2, "answered"),
        4: Proposal(worse, 1, "answered"),
        5: Proposal(None, 1, "late"),
    }
    calls, seen = [], []

    def propose(number, trials):
        seen.append([trial.mixture for trial in trials])
        return proposals[number]

    found = adapt_by_rounds(propose, assessing(calls), 5, "llm")
    assert found.mixture == worse
    assert found.n_rounds == 5
    assert [trial.mixture for trial in found.trials] == [ALL_REGULAR, ALL_REGULAR, good, good, worse, worse]
    assert [trial.cause for trial in found.trials] == ["start", "unparsable", *["answered"] * 3, "late"]
    assert calls == [[ALL_REGULAR], [good], [worse]]  # what came again is not simulated again
    assert seen[3] == [ALL_REGULAR, ALL_REGULAR, good, good]


class Model:
    """Gives prepared answers and keeps what it was asked."""

    def __init__(self, *answers):
        self.answers, self.asked = list(answers), []

    def __call__(self, system, user, number, attempt):
        self.asked.append((system, user, number, attempt))
        answer = self.answers.pop(0)
        return answer if isinstance(answer, Reply) else Reply(answer, "answered")


def proposing(model, n_trials=1, **keys):
    propose = LanguageModelProposer(model, Mixture(0.125, 0.25, 0.19), **({"attempts": 5, "history": 5} | keys))
    trials = [
        Trial(number, Mixture(number / 100, 0.0, 0.0), Assessment(0.4321, 0.9, number, 77, 160), 1, "answered")
        for number in range(n_trials)
    ]
    return propose(n_trials, trials)


GOOD = '{"aggressive": 0.1, "defensive": 0.2, "truck": 0.3}'


def test_a_question_shows_schema_recordings_figures_and_history():
    model = Model(GOOD)
    proposal = proposing(model, 8)
    assert (proposal.mixture, proposal.attempts, proposal.cause) == ((0.1, 0.2, 0.3), 1, "answered")
    ((system, user, number, attempt),) = model.asked
    assert (number, attempt) == (8, 1)
    schema = json.loads(system[system.index('{"type"') :])
    assert schema["required"] == ["aggressive", "defensive", "truck"]
    assert "- aggressive: wants about 33.5 m/s" in system
    assert 'in the recordings: {"aggressive": 0.125, "defensive": 0.25, "truck": 0.19}' in user
    assert user.count("Tried before") == 5
    assert 'Now: {"aggressive": 0.07, "defensive": 0.0, "truck": 0.0} gives H=0.432 M=0.9, 7 of 160' in user
    assert "77 near misses (less than 1.5 s to a collision)" in user
    assert "Check the ranges" not in user


def test_history_can_be_left_out():
    model = Model(GOOD)
    proposing(model, 4, history=0)
    assert "Tried before" not in model.asked[0][1]


def test_a_refused_answer_is_asked_for_again_with_a_reminder():
    model = Model("no idea", '{"aggressive": 1, "defensive": 1, "truck": 0}', GOOD)
    proposal = proposing(model)
    assert (proposal.mixture, proposal.attempts) == ((0.1, 0.2, 0.3), 3)
    users = [user for _, user, _, _ in model.asked]
    assert len(set(users)) == 3
    assert "Answer 1 of 5 could not be used, because it holds no JSON object in braces: no idea" in users[1]
    assert "Answer 2 of 5 could not be used, because their sum is 2" in users[2]
    assert all("Check the ranges" in user for user in users[1:])
    assert len({system for system, _, _, _ in model.asked}) == 1


def test_after_so_many_attempts_the_shares_stay():
    model = Model(*[Reply("x" * 1000, "unparsable")] * 9)
    proposal = proposing(model, attempts=5)
    assert (proposal.mixture, proposal.attempts, proposal.cause) == (None, 5, "unparsable")
    assert len(model.asked) == 5
    assert len(model.asked[-1][1]) < 1500  # not everything is shown again


def test_where_nothing_came_back_nothing_is_asked_again():
    model = Model("garbage", Reply(None, "late"), GOOD)
    proposal = proposing(model)
    assert (proposal.mixture, proposal.attempts, proposal.cause) == (None, 2, "late")
