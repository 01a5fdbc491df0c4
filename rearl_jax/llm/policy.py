"""The language model as a policy: converts a situation to questions, and answers to one array of actions."""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace

import numpy as np
from jaxtyping import Int

from rearl_jax.decision.situation import NO_ACTION, Situation
from rearl_jax.detection.detector import Thresholds
from rearl_jax.llm.client import Client
from rearl_jax.llm.prompts import Prompter
from rearl_jax.llm.records import Answer, Cause, Question


class LanguageModelPolicy:
    """A `HostPolicy` that queries a language model about vehicles that need a decision."""

    def __init__(
        self,
        client: Client,
        prompter: Prompter,
        thresholds: Thresholds,
        first_scenario: int = 0,
        watch: Callable[[int], None] = lambda second: None,
    ) -> None:
        """Creates the policy for one half of a batch and one rollout.

        `first_scenario` is the number of the first scenario of that half among all scenarios; `watch` is called with
        the number of every simulated second whose questions have been submitted.
        """
        self._client, self._prompter, self._thresholds = client, prompter, thresholds
        self._first_scenario, self._watch = first_scenario, watch

    def ask(self, situation: Situation) -> Future[np.ndarray]:
        """Future of the actions that the answers choose; NO_ACTION for vehicles without an admissible answer.

        Raises:
            InvalidInputError: From the future: too few questions have an answer, see `Client.check_usable`.
        """
        questions = self._prompter.questions(situation, self._thresholds)
        n_vehicles, n_scenarios = situation.detection.mask.shape
        numbered = [replace(question, scenario=question.scenario + self._first_scenario) for question in questions]
        answers = self._client.submit(numbered, second=int(situation.second))
        self._watch(int(situation.second))
        actions: Future[np.ndarray] = Future()

        def finish(done: Future[list[Answer]]) -> None:
            try:
                answered = done.result()
                self._client.check_usable(is_finished=False)
                actions.set_result(actions_of(questions, answered, (n_vehicles, n_scenarios)))
            except Exception as error:  # raised in the caller, who waits for the actions
                actions.set_exception(error)

        answers.add_done_callback(finish)
        return actions


def actions_of(
    questions: list[Question], answers: list[Answer], shape: tuple[int, int]
) -> Int[np.ndarray, "vehicles scenarios"]:
    """The answered actions by vehicle and scenario, NO_ACTION elsewhere."""
    actions = np.full(shape, NO_ACTION, np.int32)
    for question, answer in zip(questions, answers, strict=True):
        if answer.cause is Cause.answered:
            actions[question.vehicle, question.scenario] = answer.action
    return actions
