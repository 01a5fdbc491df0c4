"""Questions as a study asks them: a closed loop that is triggered every second, whose questions nobody answers."""

from concurrent.futures import Future

import jax
import jax.numpy as jnp
import numpy as np

from rearl_jax.bench.measurement import TICKS_PER_SECOND
from rearl_jax.bench.synthetic_references import synthetic_references
from rearl_jax.config.detection import Cues
from rearl_jax.config.llm import PromptConfig
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.spawn import spawn
from rearl_jax.decision.execution import model_under_decisions
from rearl_jax.decision.lockstep import rollout_in_lockstep
from rearl_jax.decision.loop import LoopOptions
from rearl_jax.decision.situation import NO_ACTION, Situation
from rearl_jax.detection.detector import DetectionOptions, Thresholds
from rearl_jax.detection.table import tabulate
from rearl_jax.llm.prompts import Prompter
from rearl_jax.llm.records import Question

N_VEHICLES = 10
"""Vehicles per scenario, all of them asked about; REARL (Bi et al.)."""

N_SECONDS = 60
"""Length of the references [s]; REARL (Bi et al.)."""

N_REFERENCES = 15
"""Representative scenes; REARL (Bi et al.)."""


class _Collector:
    """A `HostPolicy` that keeps the questions and decides nothing."""

    def __init__(self, prompter: Prompter, thresholds: Thresholds) -> None:
        self._prompter, self._thresholds = prompter, thresholds
        self.questions: list[Question] = []

    def ask(self, situation: Situation) -> Future[np.ndarray]:
        """Everybody is left to IDM and MOBIL."""
        self.questions += self._prompter.questions(situation, self._thresholds)
        nothing: Future[np.ndarray] = Future()
        nothing.set_result(np.full(situation.detection.mask.shape, NO_ACTION, np.int32))
        return nothing


def make_questions(n_questions: int, seed: int) -> list[Question]:
    """So many different questions, in the order in which a study sends them, second by second.

    Args:
        n_questions: How many.
        seed: Of traffic and references.
    """
    # Two halves ask, one after the other; no more than 64 scenarios, so that there are bursts of successive seconds.
    n_scenarios = int(np.clip(-(-n_questions // (10 * N_VEHICLES)), 2, 64))
    n_seconds = 2 + -(-n_questions // (n_scenarios * N_VEHICLES))
    references = synthetic_references(seed, N_REFERENCES, max(N_SECONDS, n_seconds), N_VEHICLES)
    options = LoopOptions(DetectionOptions(cues=Cues.always))
    model = model_under_decisions(TrafficModel(ticks_per_second=TICKS_PER_SECOND), options.execution.longitudinal)
    keys = jax.random.split(jax.random.key(seed), n_scenarios)
    state, drivers = spawn(keys, model, n_vehicles=N_VEHICLES)
    table = tabulate(references, options.detection.hist, state.x.dtype)
    limits = Thresholds(*jnp.zeros((2, n_scenarios), state.x.dtype))
    half = -(-n_scenarios // 2)

    def collector(scenarios: slice) -> _Collector:
        own = Thresholds(limits.hellinger[scenarios], limits.mape[scenarios])
        return _Collector(Prompter(table, model, PromptConfig(), options.detection), own)

    collectors = (collector(slice(half)), collector(slice(half, None)))
    rollout_in_lockstep(state, drivers, keys, table, limits, collectors, model, options, n_seconds=n_seconds)
    # A question is its text: crashed vehicles that stand still can give the same one again.
    different = {question.messages[-1].text: question for found in collectors for question in found.questions}
    return list(different.values())[:n_questions]
