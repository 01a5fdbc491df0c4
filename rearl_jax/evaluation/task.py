"""The task `rearl evaluate`: simulated traffic compared with recorded scenes in tables, figures and one page.

Writes into the study folder `runs.parquet` (one row per scored pair), `frames.parquet` (one per pair and
frame), `summary.parquet` (one per method and metric), PNG figures, `page.html`, `config.json` and, last of all,
`summary.json` (one object per row of the table). Some methods add tables (`extras.Extra`): `decisions.parquet` (one
row per rollout and second, where a policy intervenes), `requests.parquet` (one per question to a language model),
`rounds.parquet` (one per mixture of driver classes that was tried out).
"""

from contextlib import ExitStack
from dataclasses import replace
from typing import Any

from rich.progress import Progress

from rearl_jax.config import EvaluateTask
from rearl_jax.config.evaluation import Method
from rearl_jax.data.recordings import is_generated
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.document.document import Document
from rearl_jax.document.publishing import publish_document
from rearl_jax.evaluation import tables
from rearl_jax.evaluation.boundaries import check_boundary
from rearl_jax.evaluation.document import document_of
from rearl_jax.evaluation.estimates import Estimate, estimates
from rearl_jax.evaluation.extras import Extra
from rearl_jax.evaluation.inputs import inputs_of_scenes, read_inputs
from rearl_jax.evaluation.percentiles import thresholds_of
from rearl_jax.evaluation.remarks import remarks_of
from rearl_jax.evaluation.rows import compares_variants
from rearl_jax.evaluation.runner import Evaluation, evaluate
from rearl_jax.evaluation.traffic import inputs_id
from rearl_jax.problems import out_of_range
from rearl_jax.progress import progress_bar, shown
from rearl_jax.results import Study
from rearl_jax.runtime import set_precision


def run(config: EvaluateTask, *, show: bool = True) -> dict:
    """The summary under `rows`: one object per row of the table, the method first, as in summary.json.

    Raises:
        FileNotFoundError, ValueError: As in `compute`.
    """
    check(config)
    generated = is_generated(config.data)
    study = Study(config.results.root, config.study, config, "evaluate", inputs_id(config), generated=generated)
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return {"rows": stored}
    with progress_bar() as bar:
        evaluation = compute(config, bar, study=study)
    found = estimates(evaluation.rows, evaluation.held_out, config.eval)
    write_tables(study, evaluation, found)
    return {"rows": write_pages(study, evaluation, found, show=show)}


def check(config: EvaluateTask) -> None:
    """Raise InvalidInputError if two keys contradict each other."""
    if config.hist.window > config.scenes.seconds:
        message = f"must be at most {config.scenes.seconds} s, the length of a scene"
        raise out_of_range("hist.window", message, config.hist.window)
    check_boundary(config)


def compute(
    config: EvaluateTask, bar: Progress, *, scenes: SceneSet | None = None, study: Study | None = None
) -> Evaluation:
    """The evaluation with all its results; nothing is printed.

    Args:
        config: The task; it has passed `check`.
        bar: Shows the progress.
        scenes: Scenes to evaluate on; None for those of `config.data`.
        study: Keeps the trace of a search for the clusters' parameters; None to keep nothing.

    Raises:
        FileNotFoundError, ValueError: There are no recordings, one is bad, too few scenes can be cut from
            them, or two keys contradict each other.
    """
    set_precision(config.core.dtype)
    if compares_variants(config):
        config = replace(config, method=Method.rearl)
    if scenes is None:
        inputs = read_inputs(config, study, bar, with_references=config.method.needs_references)
    else:
        check_boundary(config, has_given_scenes=True)
        inputs = inputs_of_scenes(config, scenes)
    thresholds = thresholds_of(config, inputs, bar)
    mixture, extras = None, list[Extra]()
    if config.method is Method.critical:
        from rearl_jax.evaluation.critical import adapt  # imported only here: it brings the client of a language model

        mixture, extras = adapt(config, inputs.scenes, inputs.splits.threshold, bar)
    with ExitStack() as opened:
        model = None
        if config.decision.policy.is_outside:
            from rearl_jax.evaluation.language_model import language_model  # likewise

            model = opened.enter_context(language_model(config, bar))
        evaluation = evaluate(
            config,
            inputs.scenes,
            inputs.held_out(config.eval),
            shown(bar, "rollouts"),
            inputs.references,
            thresholds,
            None if model is None else model.make_policy,
            mixture,
        )
        if model is not None:
            extras.append(model.extra())
    return replace(evaluation, extras=(*evaluation.extras, *extras))


def write_tables(study: Study, evaluation: Evaluation, found: dict[tuple[str, str], Estimate]) -> None:
    """Writes the Parquet tables; `found` has the estimates by row and metric."""
    config = evaluation.config
    metadata = tables.metadata(config, evaluation)
    study.write_table("runs", tables.run_table(evaluation), **metadata)
    study.write_table("frames", tables.frame_table(evaluation, config.hist.window), **metadata)
    summary = tables.summary_table(evaluation, found, config.eval.confidence)
    study.write_table("summary", summary, **metadata, remarks=remarks_of(evaluation).to_json())
    for extra in evaluation.extras:
        for name, table in extra.tables.items():
            study.write_table(name, table, **metadata)


def documented(evaluation: Evaluation, found: dict[tuple[str, str], Estimate]) -> Document:
    """The document of the evaluation; arguments as in `write_tables`."""
    summary = tables.summary_table(evaluation, found, evaluation.config.eval.confidence)
    decisions = (extra.tables["decisions"] for extra in evaluation.extras if "decisions" in extra.tables)
    return document_of(
        evaluation.config,
        summary,
        remarks_of(evaluation),
        decisions=next(decisions, None),
        generated=evaluation.scenes.generated,
    )


def write_pages(
    study: Study, evaluation: Evaluation, found: dict[tuple[str, str], Estimate], *, show: bool = False
) -> list[dict]:
    """The objects of summary.json, written last, after figures and page."""
    config, data_id = evaluation.config, evaluation.scenes.data_id

    def draw() -> dict[str, bytes]:
        from rearl_jax.evaluation import figures

        return figures.draw(config, evaluation)

    def player() -> Any:
        from rearl_jax.evaluation.page import example_player

        return example_player(evaluation)

    rows, document = tables.summary_rows(evaluation, found), documented(evaluation, found)
    publish_document(study, document, config, rows, draw, data_id=data_id, player=player, show=show)
    return rows
