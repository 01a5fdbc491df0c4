"""The task `rearl study budget`: shares of traffic components in the error of simulated scenes.

Components are added to Base one at a time, in a stated order and in every other possible order, up to the row with all
of them, whose errors are compared with real against real, other recorded scenes in place of simulated ones. Writes
`errors/part-*.parquet` (a line per row of the budget and scene), `steps.parquet` (a line per row of the stated order
and figure), `budget.parquet` (a row per error and component), `waterfall.png`, `page.html`, `config.json` and, last of
all, `summary.json`; `model.yaml` and `model.txt` if drivers are calibrated here. An interrupted study continues.
"""

import logging
from collections.abc import Mapping
from dataclasses import replace

from rich.progress import Progress

from rearl_jax.config.budget import BOUNDARY, CALIBRATED, NEEDS, REARL, START, StudyBudgetTask
from rearl_jax.config.evaluation import Method
from rearl_jax.config.scenes import BoundarySource
from rearl_jax.data.recordings import is_generated
from rearl_jax.data.scenes.initial_states import recorded_road
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.data.scenes.scene_windows import UNKNOWN_LANE
from rearl_jax.document.document import data_sources
from rearl_jax.document.publishing import publish_document
from rearl_jax.evaluation import task as evaluation
from rearl_jax.evaluation.inputs import Inputs, read_inputs
from rearl_jax.evaluation.percentiles import thresholds_of
from rearl_jax.evaluation.remarks import Remarks, data_summary
from rearl_jax.evaluation.simulators import NEVER_EXCEEDED
from rearl_jax.evaluation.traffic import inputs_id
from rearl_jax.problems import InvalidInputError, out_of_range
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study
from rearl_jax.runtime import set_precision
from rearl_jax.study.budget.calibrating import Drivers, calibrated_drivers
from rearl_jax.study.budget.components import TITLES, orders
from rearl_jax.study.budget.document import definitions_of, document_of, findings_of
from rearl_jax.study.budget.drivers import components_of
from rearl_jax.study.budget.figures import budgets
from rearl_jax.study.budget.simulating import Setting, simulated_rows, without_replay
from rearl_jax.study.budget.tables import budget_table, step_table, summary_of

log = logging.getLogger(__name__)


def run(config: StudyBudgetTask) -> dict:
    """The summary, as in summary.json.

    Raises:
        FileNotFoundError, ValueError: There are no recordings, a recording is invalid, no scene can be cut from them,
            or two keys contradict each other.
    """
    evaluation.check(without_replay(config))
    set_precision(config.core.dtype)
    generated = is_generated(config.data)
    study = Study(config.results.root, config.study, config, "study budget", inputs_id(config), generated=generated)
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return stored
    with progress_bar() as bar:
        setting, absent, origin = prepared(config, study, bar)
        scenes = setting.inputs.scenes
        metadata = {"seeds": config.seeds, "scenes_id": scenes.data_id}
        rows = simulated_rows(setting, study, bar, metadata)
    divided = budgets(rows, setting.components)
    table, steps = budget_table(divided, config.eval), step_table(rows, setting.components, config.eval)
    summary = summary_of(table, setting.components, len(setting.held_out), len(orders(setting.components)))
    remarks = Remarks(
        data_summary(config, scenes, f"{len(setting.held_out)} of them scored"),
        (*findings_of(table, config.mape.column, setting.components), *origin, *absent),
        definitions_of(setting.config, scenes, setting.held_out),
        data_sources(scenes.infos),
    )
    study.write_table("steps", steps, **metadata)
    study.write_table("budget", table, **metadata, remarks=remarks.to_json())
    document = document_of(table, steps, remarks, generated=generated)

    def draw() -> dict[str, bytes]:
        from rearl_jax.study.budget.waterfall import draw_waterfall

        return {"waterfall": draw_waterfall(table, config.mape.column, generated=generated)}

    publish_document(study, document, config, summary, draw, data_id=scenes.data_id)
    return summary


def prepared(config: StudyBudgetTask, study: Study, bar: Progress) -> tuple[Setting, tuple[str, ...], tuple[str, ...]]:
    """Setting of all rows, a note on every absent component, and a note on the calibrated drivers."""
    absent: dict[str, str] = {}
    inputs = _inputs(config, study, bar, absent)
    scenes, held_out = inputs.scenes, inputs.held_out(config.eval)
    if config.scenes.boundary is BoundarySource.free:
        absent[BOUNDARY] = "scenes.boundary is free"
    if (scenes.lane == UNKNOWN_LANE).any():
        absent |= dict.fromkeys((START, BOUNDARY), "the recordings lack the lane of some vehicles")
    drivers = Drivers(None, "")
    if CALIBRATED in config.budget.components:
        bar.add_task("calibrated drivers", total=None)
        drivers = calibrated_drivers(config, study, scenes, held_out)
        absent |= _lacking(drivers)
    config = with_road(config, scenes, needs_lanes=START not in absent)
    thresholds = NEVER_EXCEEDED
    if REARL in config.budget.components and REARL not in absent:
        try:
            rearl_config = replace(without_replay(config), method=Method.rearl, model=None)
            thresholds = thresholds_of(rearl_config, inputs, bar)
        except InvalidInputError as error:
            absent[REARL] = str(error)
    components = present(config.budget.components, absent)
    notes = tuple(f"Absent: {TITLES[name]}: {why}" for name, why in absent.items() if name in config.budget.components)
    origin = () if drivers.model is None else (f"Calibrated drivers: {drivers.origin}",)
    return Setting(config, inputs, held_out, components, drivers.model, thresholds), notes, origin


def present(components: tuple[str, ...], absent: Mapping[str, str]) -> tuple[str, ...]:
    """Components that are not absent and whose needed component is not; InvalidInputError if there are none."""
    kept = tuple(name for name in components if name not in absent)
    kept = tuple(name for name in kept if NEEDS.get(name) is None or NEEDS[name] in kept)
    if not kept:
        message = "names nothing that these recordings have: " + "; ".join(f"{n}: {why}" for n, why in absent.items())
        raise out_of_range("budget.components", message, f"[{', '.join(components)}]")
    return kept


def _inputs(config: StudyBudgetTask, study: Study, bar: Progress, absent: dict[str, str]) -> Inputs:
    """Scenes and their splits; with representative scenes where REARL is a component and can be one."""
    if REARL in config.budget.components:
        try:
            return read_inputs(replace(config, method=Method.rearl), study, bar, with_references=True)
        except InvalidInputError as error:
            log.info("REARL: %s", error)
            absent[REARL] = str(error)
    return read_inputs(config, study, bar, with_references=False)


def _lacking(drivers: Drivers) -> dict[str, str]:
    """Components that the drivers lack, with the reason."""
    if drivers.model is None:
        return dict.fromkeys(
            (CALIBRATED, *(name for name, other in NEEDS.items() if other == CALIBRATED)), drivers.origin
        )
    why = "`rearl discover` writes a model; budget.calibrate estimates drivers and noise only"
    return {
        name: f"the model has none ({why})"
        for name, is_present in components_of(drivers.model).items()
        if not is_present
    }


def with_road(config: StudyBudgetTask, scenes: SceneSet, *, needs_lanes: bool) -> StudyBudgetTask:
    """The configuration with as many vehicles as a snapshot and as many lanes as the recordings, for all rows alike.

    Raises:
        InvalidInputError: The recordings have more lanes than a simulated road can have.
    """
    core = replace(config.core, n_vehicles=scenes.n_slots)
    if needs_lanes:
        core = replace(core, n_lanes=recorded_road(core, scenes).n_lanes)
    return replace(config, core=core)
