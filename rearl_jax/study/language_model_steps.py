"""Time of consecutive decision steps with a language model as policy: real questions to a real server.

Traffic, references and a decision for every vehicle every second are those of `timing.decision_steps.LOOP`; only the
policy differs. Stored answers would cost no time, so none are used.
"""

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import jax

from rearl_jax.config.llm import LlmConfig, PromptConfig
from rearl_jax.config.study import StepsConfig
from rearl_jax.decision.lockstep import rollout_in_lockstep
from rearl_jax.llm.client import Client
from rearl_jax.llm.local_server import server_at
from rearl_jax.llm.policy import LanguageModelPolicy
from rearl_jax.llm.prompts import Prompter
from rearl_jax.llm.records import Cause
from rearl_jax.llm.template import load_template
from rearl_jax.timing.decision_steps import (
    LOOP_MODEL,
    TRIGGER_ALWAYS,
    Batch,
    Scenes,
    program_arguments,
    synthetic_table,
)


@dataclass(frozen=True)
class ModelSteps:
    """One measurement.

    Attributes:
        batch: Scenarios simulated at a time.
        repetition: Number of the measurement, from 0.
        wall_s: Elapsed time of all steps, simulation included [s].
        n_steps: Decision steps.
        n_questions: Number of questions, one per vehicle that has not crashed.
        n_sent: Questions sent to the server; equal ones are sent once.
        n_answered: Questions that got an admissible answer.
    """

    batch: int
    repetition: int
    wall_s: float
    n_steps: int
    n_questions: int
    n_sent: int
    n_answered: int


@contextmanager
def fresh_client(llm: LlmConfig, server: str) -> Iterator[Client]:
    """A client of a server (its address, or `local`) without stored answers; the file of answers of `llm` is not used.

    Raises:
        ImportError: server=local, and the server or its model is not installed.
        OSError: There is no server, or it does not become ready.
        ValueError: The server does not have the model or refuses access.
    """
    with tempfile.TemporaryDirectory() as folder, server_at(server) as address:
        with Client(replace(llm, cache=str(Path(folder) / "answers.sqlite")), address) as client:
            yield client


def measure_model_steps(
    client: Client, prompt: PromptConfig, loop: StepsConfig, batch: int, repetitions: int
) -> list[ModelSteps]:
    """Measurements after a warm-up of one step, each with different traffic."""
    arguments = program_arguments(loop, loop.steps_vehicles, loop.steps, batch)
    scenes = Scenes(loop.steps_vehicles, loop.density, synthetic_table(arguments["references"]))
    prepare = jax.jit(lambda keys: replace(scenes.draw_recorded(keys, loop.steps), recorded=None))
    measurements = []
    for number in range(-1, repetitions):  # -1: the warm-up
        keys = jax.random.split(jax.random.key(loop.seed + 1 + number), batch)
        n_steps = 1 if number < 0 else loop.steps
        measured = _measure(client, prompt, jax.block_until_ready(prepare(keys)), number, n_steps)
        if number >= 0:
            measurements.append(measured)
    return measurements


def _measure(client: Client, prompt: PromptConfig, batch: Batch, repetition: int, n_steps: int) -> ModelSteps:
    """One measurement; the two halves of the scenarios have a policy each, as `rollout_in_lockstep` requires."""
    size = batch.state.x.shape[-1]
    half = -(-size // 2)  # rounded up
    template = load_template(prompt.template)

    def policy_of(part: slice) -> LanguageModelPolicy:
        prompter = Prompter(batch.table, LOOP_MODEL, prompt, TRIGGER_ALWAYS.detection, template)
        limits = jax.tree.map(lambda leaf: leaf[part], batch.thresholds)
        return LanguageModelPolicy(client, prompter, limits, part.start)

    n_before = len(client.requests_frame())
    begin = time.perf_counter()
    # No decision follows the last second, so the last decisions are made one second earlier.
    rollout_in_lockstep(
        batch.state,
        batch.drivers,
        batch.keys,
        batch.table,
        batch.thresholds,
        (policy_of(slice(0, half)), policy_of(slice(half, size))),
        LOOP_MODEL,
        TRIGGER_ALWAYS,
        n_seconds=n_steps + 1,
    )
    wall_s = time.perf_counter() - begin
    client.check_usable(is_finished=True)
    asked = client.requests_frame().iloc[n_before:]
    n_answered = int((asked["cause"] == Cause.answered.name).sum())
    return ModelSteps(size, repetition, wall_s, n_steps, len(asked), int(asked["was_sent"].sum()), n_answered)
