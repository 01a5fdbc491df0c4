"""Shares of the driver classes (aggressive, defensive, truck) of method=critical, adapted before the evaluation.

They are adapted on the threshold scenes, a split of the recorded scenes that the evaluation does not use.
"""

import logging
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import pandas as pd
from rich.progress import Progress

from rearl_jax._typing import SceneIndices
from rearl_jax.baselines.critical.adaptation import GIVEN, Adaptation, Assess, adapt_by_rounds, best_of
from rearl_jax.baselines.critical.answers import BadAnswerError, read_mixture
from rearl_jax.baselines.critical.asking import LanguageModelProposer, Reply
from rearl_jax.baselines.critical.mixture import Mixture, grid
from rearl_jax.config import EvaluateTask
from rearl_jax.config.critical import Proposer
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.evaluation.critical_results import adaptation_extra, answer_extra
from rearl_jax.evaluation.extras import Extra
from rearl_jax.evaluation.language_model import open_client
from rearl_jax.evaluation.mixture_trials import assess
from rearl_jax.evaluation.recorded_driving import recorded_shares
from rearl_jax.llm.client import Client
from rearl_jax.llm.records import NO_DECISION, Cause, Message, Question
from rearl_jax.progress import shown

log = logging.getLogger(__name__)


def adapt(config: EvaluateTask, scenes: SceneSet, subset: SceneIndices, bar: Progress) -> tuple[Mixture, list[Extra]]:
    """Shares of the driver classes to evaluate, found on the threshold scenes of a subset, and their extra results.

    Raises:
        ImportError, OSError, ValueError: The language model cannot be reached; see `language_model.language_model`.
        ValueError: The recordings hold too few cars, or the language model has not answered at all.
    """
    adaptation, requests = _search(config, scenes, subset, bar)
    log.info("shares of the driver classes: %s", adaptation.mixture.written())
    extras = [adaptation_extra(config, adaptation, len(subset), generated=scenes.generated)]
    if requests is not None:
        extras.append(answer_extra(adaptation, requests))
    return adaptation.mixture, extras


def _search(
    config: EvaluateTask, scenes: SceneSet, subset: SceneIndices, bar: Progress
) -> tuple[Adaptation, pd.DataFrame | None]:
    """The search for the shares, and the requests to a language model."""
    if config.critical.ratios is not None:
        return Adaptation(GIVEN, Mixture(*config.critical.ratios)), None
    try_out = partial(assess, config, scenes, subset)
    match config.critical.proposer:
        case Proposer.stats:
            recorded = recorded_shares(config, scenes, subset, bar)
            return best_of([recorded], try_out, Proposer.stats.name), None
        case Proposer.search:
            return best_of(grid(), partial(try_out, progress=shown(bar, "mixtures")), Proposer.search.name), None
        case Proposer.llm:
            return _search_with_language_model(config, scenes, subset, try_out, bar)


def _search_with_language_model(
    config: EvaluateTask, scenes: SceneSet, subset: SceneIndices, try_out: Assess, bar: Progress
) -> tuple[Adaptation, pd.DataFrame]:
    """The search with proposals of a language model, and the requests to it."""
    critical = config.critical
    # One answer that is not an identifier: no votes, no constraint to identifiers, and room for the object.
    llm = replace(config.llm, votes=1, constrained=False, max_tokens=max(config.llm.max_tokens, critical.max_tokens))
    with open_client(config, llm, understand_mixture) as client:
        recorded = recorded_shares(config, scenes, subset, bar)
        propose = LanguageModelProposer(
            _question_function(client), recorded, attempts=critical.attempts, history=critical.history
        )
        adaptation = adapt_by_rounds(
            propose, try_out, critical.rounds, Proposer.llm.name, progress=shown(bar, "rounds of proposals")
        )
        # Answers that are no mixture are the method's own outcome, which its row reports.
        client.check_usable(is_finished=True, any_text=True)
        return adaptation, client.requests_frame()


def _question_function(client: Client) -> Callable[[str, str, int, int], Reply]:
    """The client as the proposer calls it; the table of requests has the round under `scenario`, the attempt under
    `vehicle`.
    """

    def ask(system: str, user: str, number: int, attempt: int) -> Reply:
        messages = (Message("system", system), Message("user", user))
        (answer,) = client.submit([Question(number, attempt, messages, ())]).result()
        return Reply(answer.replies[0].text, answer.cause.name)

    return ask


def understand_mixture(text: str, choices: tuple[int, ...], finish: str = "") -> tuple[int, Cause]:
    """NO_DECISION, and the cause: answered if the text is a mixture; see `llm.client.Read`."""
    try:
        read_mixture(text)
    except BadAnswerError as error:
        return NO_DECISION, Cause.truncated if finish == "length" else Cause[error.fault.name]
    return NO_DECISION, Cause.answered
