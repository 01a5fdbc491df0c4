"""The questions of one second, one per vehicle that needs a decision, from the traffic and its references.

Shared text comes first in a question, so that a server with a prefix cache processes only the rest: the system message
(same for the whole study), ROAD, REFERENCE (same for all scenarios with this reference), SCENE (one scenario), then the
vehicle. Shared parts are rendered once; questions with equal beginnings follow each other.
"""

from collections import deque
from collections.abc import Mapping
from typing import TypeAlias

import jax
import numpy as np

from rearl_jax.config.llm import PromptConfig
from rearl_jax.core.model import TrafficModel
from rearl_jax.decision.situation import ACTION_NAMES, Situation
from rearl_jax.detection.detector import DetectionOptions, Thresholds
from rearl_jax.detection.table import ReferenceTable
from rearl_jax.llm.records import Message, Question
from rearl_jax.llm.surroundings import look_around
from rearl_jax.llm.template import PromptTemplate, Rendered, load_template, rendered
from rearl_jax.llm.variables import Asked, Bins, Road, cars_of, neighbours_of, reference_at, scene_of
from rearl_jax.metrics.histograms import speed_counts

_Shared: TypeAlias = tuple[Mapping[str, object], Mapping[str, Rendered]]
"""Variables that questions share, and the blocks that have been rendered with them."""

_count_speeds = jax.jit(speed_counts, static_argnames="hist")


class Prompter:
    """Generator of questions about the vehicles of one batch of scenarios; it stores the speeds of the last seconds.

    Args:
        table: References.
        model: Traffic model; only its road is used.
        options: Content of the questions.
        detection: Choices of the detection, whose speed bins the questions show.
        template: The template; None for that of `options`. Load it once for several batches.
        vehicle_length: Length [m], or lengths that broadcast to `[n_vehicles, n_scenarios]`; highway-env's by default.

    Raises:
        MissingInputError: There is no template of that name.
        InvalidInputError: The template cannot be used.
    """

    def __init__(
        self,
        table: ReferenceTable,
        model: TrafficModel,
        options: PromptConfig,
        detection: DetectionOptions,
        template: PromptTemplate | None = None,
        *,
        vehicle_length: np.ndarray | float = 5.0,
    ) -> None:
        hist = detection.hist
        self._table = jax.tree.map(np.asarray, table)
        self._model = model
        self._hist = hist
        self._template = load_template(options.template) if template is None else template
        self._length = vehicle_length
        self._constants = {
            "options": options,
            "actions": ACTION_NAMES,
            "levels": model.speed_levels,
            "bins": Bins(hist.low, hist.high, hist.n_bins, hist.window),
        }
        self._system = Message("system", self._template.render("system", self._constants).strip())
        self._counts: deque[np.ndarray] = deque(maxlen=hist.window)
        self._next_second = 0

    def questions(self, situation: Situation, thresholds: Thresholds) -> list[Question]:
        """A question for every vehicle that needs a decision, sorted by (reference, scenario, vehicle).

        Call it once for every simulated second, even if there are no questions. There is no question about a vehicle
        without admissible actions, because no answer could be followed. It is controlled by IDM and MOBIL like a
        vehicle without a valid answer, and `decision.execution.accept` counts it among those (`n_invalid`). The
        number of such vehicles is that in `situation.detection.mask` less the number of questions.

        Raises:
            ValueError: A second was left out, or the template fails.
        """
        situation, thresholds = jax.tree.map(np.asarray, (situation, thresholds))
        second = int(situation.second)
        if second != self._next_second:
            raise ValueError(
                f"questions() was called for second {second} instead of {self._next_second}: call it for every second "
                "of a batch, in order, and make a Prompter for every batch"
            )
        self._next_second += 1
        self._counts.append(np.asarray(_count_speeds(situation.frame.speed, hist=self._hist)))

        asked = _asked(situation)
        if not len(asked.vehicle):
            return []
        shared = self._shared(situation, thresholds, asked)
        around = look_around(situation.frame, self._length, asked.vehicle, asked.scenario, self._model)
        cars, neighbours = cars_of(situation, asked, self._model), neighbours_of(around)
        questions = []
        for scenario, car, around_car in zip(asked.scenario.tolist(), cars, neighbours, strict=True):
            variables, ready = shared[scenario]
            choices = tuple(np.flatnonzero(situation.admissible[:, car.vehicle, scenario]).tolist())
            variables = {**variables, "car": car, "neighbours": around_car, "choices": choices}
            text = self._template.render("user", variables, ready).strip()
            questions.append(Question(scenario, car.vehicle, (self._system, Message("user", text)), choices))
        return questions

    def _shared(self, situation: Situation, thresholds: Thresholds, asked: Asked) -> dict[int, _Shared]:
        """Shared variables of the questions of each scenario."""
        second, table = int(situation.second), self._table
        model = self._model
        road = Road(model.n_lanes, model.lane_width, model.speed_limit, len(situation.frame.speed))
        of_road = self._with_block("road", {**self._constants, "road": road}, {})
        simulated = np.sum(self._counts, axis=0)
        of_references: dict[int, _Shared] = {}
        shared: dict[int, _Shared] = {}
        for scenario in np.unique(asked.scenario).tolist():
            number = int(situation.detection.reference[scenario])
            if number not in of_references:
                variables, ready = of_road
                variables = {**variables, "reference": reference_at(table, second, number)}
                of_references[number] = self._with_block("reference", variables, ready)
            variables, ready = of_references[number]
            recorded = table.window_counts[second, :, number]
            scene = scene_of(situation, thresholds, simulated[:, scenario], recorded, scenario)
            shared[scenario] = self._with_block("scene", {**variables, "scene": scene}, ready)
        return shared

    def _with_block(self, block: str, variables: Mapping[str, object], ready: Mapping[str, Rendered]) -> _Shared:
        """The variables, and the rendered blocks with one more, if the template has it."""
        if not self._template.has(block):
            return variables, ready
        return variables, {**ready, block: rendered(self._template.render(block, variables, ready))}


def _asked(situation: Situation) -> Asked:
    """Vehicles with a question, in the order of the questions."""
    is_asked = np.asarray(situation.detection.mask & situation.admissible.any(axis=0))
    vehicle, scenario = np.nonzero(is_asked)
    order = np.lexsort((vehicle, scenario, np.asarray(situation.detection.reference)[scenario]))
    return Asked(vehicle[order], scenario[order])
