"""The language model of a study: opened before the rollouts, asked during them, accounted for afterwards."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import numpy as np
import pandas as pd
from rich.progress import Progress, TaskID

from rearl_jax.config import EvaluateTask
from rearl_jax.config.decision import PolicyName
from rearl_jax.config.llm import LlmConfig
from rearl_jax.evaluation.extras import Extra
from rearl_jax.evaluation.host_policy import Block
from rearl_jax.llm.client import Client, Read
from rearl_jax.llm.local_server import server_at
from rearl_jax.llm.parsing import understand
from rearl_jax.llm.policy import LanguageModelPolicy
from rearl_jax.llm.prompts import Prompter
from rearl_jax.llm.records import TOKEN_COUNTS, Cause
from rearl_jax.llm.template import load_template


class LanguageModel:
    """A language model that is ready to be asked."""

    def __init__(self, config: EvaluateTask, client: Client, bar: Progress) -> None:
        self._config, self._client, self._bar = config, client, bar
        self._template = load_template(config.prompt.template)
        self._line: TaskID = bar.add_task("decisions", total=None)
        self._begin = time.perf_counter()

    def make_policy(self, block: Block) -> LanguageModelPolicy:
        """The policy of a block of scenarios; see `host_policy.MakePolicy`."""
        prompter = Prompter(
            block.table,
            block.model,
            self._config.prompt,
            block.options.detection,
            self._template,
            vehicle_length=block.length,
        )
        return LanguageModelPolicy(
            self._client,
            prompter,
            block.thresholds,
            block.first_scenario,
            lambda second: self._show(second, block.table.n_seconds),
        )

    def requests(self) -> pd.DataFrame:
        """One row per question and vote."""
        return self._client.requests_frame()

    def extra(self) -> Extra:
        """Table, note and figures of the questions asked.

        Raises:
            InvalidInputError: None of them has a usable answer.
        """
        self._client.check_usable(is_finished=True)
        requests = self.requests()
        return Extra({"requests": requests}, (request_note(requests),), request_figures(requests))

    def _show(self, second: int, n_seconds: int) -> None:
        """Shows the number of questions answered so far on the bar, from the server or stored."""
        counts, elapsed = self._client.counts, time.perf_counter() - self._begin
        answered = counts.causes.get(Cause.answered, 0)
        left = elapsed * (n_seconds - 1 - second) / max(second, 1)
        text = (
            f"second {second} of {n_seconds}: {counts.answers} decisions, {counts.answers / elapsed:.1f}/s, "
            f"{counts.kept} kept, {counts.answers - answered} left to IDM and MOBIL, {left:.0f} s left"
        )
        self._bar.update(self._line, description=text)


@contextmanager
def language_model(config: EvaluateTask, bar: Progress) -> Iterator[LanguageModel | None]:
    """The language model of the configured policy as long as it is needed; None for policies inside the program.

    Raises:
        ImportError: decision.server=local, and the server or its model is not installed.
        OSError: There is no server, or it does not become ready.
        ValueError: The server does not have the model or refuses access, or the answers kept cannot be read.
    """
    if not (config.method.needs_references and config.decision.policy.is_outside):
        yield None
        return
    with open_client(config, config.llm) as client:
        yield LanguageModel(config, client, bar)


@contextmanager
def open_client(config: EvaluateTask, llm: LlmConfig, read: Read = understand) -> Iterator[Client]:
    """A client of `decision.server`, or of the kept answers with `decision.policy=replay`; `read` parses its answers.

    Raises:
        As in `language_model`.
    """
    server = config.decision.server
    if config.decision.policy is PolicyName.replay:
        with Client(llm, server, replay=True, read=read) as client:
            yield client
        return
    with server_at(server) as address, Client(llm, address, read=read) as client:
        yield client


def request_figures(requests: pd.DataFrame) -> dict[str, int | float | None]:
    """Figures of the questions asked, None if there is none.

    `questions`; `requests` (sent to the server); `kept` (answers from the cache); `left_out` (vehicles left to IDM and
    MOBIL) and `cause_...` for every cause; of what was sent `latency_median` and `latency_p95` [s], `prompt_tokens`,
    `cached_tokens`, `answer_tokens`.
    """
    from_cache, was_sent = (requests[name].to_numpy(bool) for name in ("from_cache", "was_sent"))
    is_sent = was_sent & ~from_cache & (requests["tries"].to_numpy() > 0)
    causes = requests["cause"].to_numpy(str)
    figures: dict[str, int | float | None] = {
        "questions": len(requests),
        "requests": int(is_sent.sum()),
        "kept": int(from_cache.sum()),
        "left_out": int((causes != Cause.answered.name).sum()),
    }
    figures |= {f"cause_{cause.name}": int((causes == cause.name).sum()) for cause in Cause}
    latency = requests["latency"].to_numpy()[is_sent]
    for name, percentile in (("latency_median", 50), ("latency_p95", 95)):
        figures[name] = float(np.percentile(latency, percentile)) if len(latency) else None
    for name in TOKEN_COUNTS:
        tokens = requests[name].to_numpy(np.float64, na_value=np.nan)[is_sent]
        figures[name] = int(np.nansum(tokens)) if np.isfinite(tokens).any() else None
    return figures


def request_counts(figures: Mapping[str, int | float | None]) -> str:
    """The numbers of questions, requests and stored answers in words."""
    return (
        f"language model: {figures['questions']} questions, {figures['requests']} requests sent, {figures['kept']} "
        "answers stored before"
    )


def request_note(requests: pd.DataFrame) -> str:
    """One sentence about the questions."""
    figures = request_figures(requests)
    causes = [f"{cause.name} {figures[f'cause_{cause.name}']}" for cause in Cause if cause is not Cause.answered]
    left = ", ".join(text for text in causes if not text.endswith(" 0")) or "none"
    note = f"{request_counts(figures)}; vehicles left to IDM and MOBIL: {left}"
    prompt, cached = figures["prompt_tokens"], figures["cached_tokens"]
    if prompt and cached is not None:
        note += f"; {100 * cached / prompt:.0f} % of {prompt} prompt tokens from the server's prefix cache"
    return note
