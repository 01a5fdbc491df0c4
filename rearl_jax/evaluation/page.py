"""One HTML page that holds everything: table, figures, data and licence, definitions, how to get it again."""

from collections.abc import Mapping

from rearl_jax.config import ClusterTask, EvaluateTask
from rearl_jax.config.core import InitialSource
from rearl_jax.config.evaluation import SeedScope
from rearl_jax.data.scene_set import SceneSet
from rearl_jax.evaluation.estimates import Estimate
from rearl_jax.evaluation.layout import data_sources, render_page
from rearl_jax.evaluation.runner import Evaluation
from rearl_jax.evaluation.tables import source_names, table_notes, written
from rearl_jax.metrics import METRICS
from rearl_jax.metrics.histograms import legacy_scale

CAPTIONS = {
    "speed_histogram": ("Speeds of all held-out scenes (rescaled to the range of the simulator) and of all rollouts."),
    "errors_over_time": (
        "Hellinger distance of the window that ends at each second, relative error of the mean spacing, and "
        "the mean spacing itself. Lines are means, bands hold the middle 80 % of scenes and runs."
    ),
    "space_time": (
        "Left: the vehicles picked in the snapshots of one scene, inside the observed stretch of road. "
        "Right: the simulated vehicles, followed to the end; the vertical scales differ. The scene is the "
        "held-out one of median mean speed unless eval.example names another."
    ),
    "actions_by_speed": (
        "What the policy that drives all vehicles does: above, how often each speed was driven; below, the share of "
        "each action among those taken at that speed. Crashed vehicles take none."
    ),
    "critical": (
        "How the shares of the driver classes were found before the evaluation, on other scenes and other initial "
        "states: every mixture that was tried out, and how far its traffic was from the threshold scenes."
    ),
}
"""What is below each figure."""

_STARTS = {
    InitialSource.seed: "drawn by eval.seed, run and scene alone",
    InitialSource.scene: "the first snapshot of the scene; drivers drawn by eval.seed, run and scene alone",
}

BETTER = {"lower": "lower", "higher": "higher", "none": "neither; compare with `real`"}
"""What people read for a metric's direction."""


def render(
    config: EvaluateTask,
    evaluation: Evaluation,
    estimates: Mapping[tuple[str, str], Estimate],
    figures: Mapping[str, bytes],
) -> str:
    """The page as HTML text; nothing in it is loaded from anywhere else.

    Args:
        config: The task.
        evaluation: What was measured.
        estimates: Figures of the table.
        figures: PNG files by name.
    """
    scenes = evaluation.scenes
    return render_page(
        "page.html.j2",
        words=f"evaluate method={config.method.name}",
        config=config,
        figures=figures,
        captions=CAPTIONS,
        data_id=scenes.data_id,
        title=f"{evaluation.method.title} against {source_names(evaluation.scenes)}",
        generated=scenes.generated,
        rows=[row.title for row in evaluation.rows],
        difference=f"{evaluation.method.title} less reference",
        metrics=[_metric(name, config, evaluation, estimates) for name in METRICS],
        notes=table_notes(config, evaluation, estimates),
        data={
            "summary": data_summary(config, scenes, f"{len(evaluation.held_out)} of them held out for this evaluation"),
            "sources": data_sources(scenes.infos),
        },
        definitions=_definitions(config, evaluation),
    )


def _metric(
    name: str,
    config: EvaluateTask,
    evaluation: Evaluation,
    estimates: Mapping[tuple[str, str], Estimate],
) -> dict[str, object]:
    """A line of the table of results and of the table of definitions."""
    metric = METRICS[name]
    cells = [_cell(estimates.get((row.row, name)), name) for row in evaluation.rows]
    method = estimates.get((evaluation.method.row, name))
    if method is None or method.difference is None:
        cells.append({"figure": "-", "interval": ""})
    else:
        ends = (method.difference_low, method.difference_high)
        cells.append({"figure": written(method.difference, name), "interval": _interval(*ends, name)})
    return {
        "name": name,
        "title": metric.title,
        "unit": metric.unit,
        "better": BETTER[metric.direction.name],
        "definition": metric.definition,
        "source": metric.source,
        "cells": cells,
    }


def _cell(estimate: Estimate | None, name: str) -> dict[str, str]:
    if estimate is None:
        return {"figure": "-", "interval": ""}
    spread = "" if estimate.sd is None else f" ± {written(estimate.sd, name)}"
    figure = written(estimate.value, name) + spread
    return {"figure": figure, "interval": _interval(estimate.low, estimate.high, name)}


def _interval(low: float | None, high: float | None, name: str) -> str:
    if low is None or high is None:
        return ""
    return f"{written(low, name)} to {written(high, name)}"


def data_summary(config: EvaluateTask | ClusterTask, scenes: SceneSet, use: str) -> str:
    """Where the scenes come from.

    Args:
        config: The task.
        scenes: All scenes.
        use: How many of them are used for what.
    """
    counts = scenes.counts
    return (
        f"{counts.recordings} recordings, {counts.windows} windows of {scenes.seconds} s, {counts.accepted} "
        f"scenes with at least {config.scenes.min_vehicles} vehicles in every snapshot, "
        f"{use} (split.unit={config.split.unit.name}, split.seed={config.split.seed}). Recorded speeds from "
        f"{scenes.speed_min:.2f} to {scenes.speed_max:.2f} m/s are rescaled by speed.norm="
        f"{scenes.speed_norm.name}; every Hellinger distance depends on these two numbers."
    )


def _definitions(config: EvaluateTask, evaluation: Evaluation) -> list[str]:
    scenes = evaluation.scenes
    n_samples = config.hist.window * scenes.n_slots
    a_rollout = {
        SeedScope.run_x_scene: "one rollout for every run and scene, scored against its scene",
        SeedScope.run: "one rollout for every run, scored against every scene",
    }[config.eval.seed_scope]
    percent = f"{100 * config.eval.confidence:g} %"
    return [
        f"Rollouts: {config.core.n_vehicles} vehicles on {config.core.n_lanes} lanes for {scenes.seconds} s, "
        f"{a_rollout}. Initial states: {_STARTS[config.init.source]}; all methods start alike.",
        f"Scenes: {scenes.n_slots} vehicles in each of {scenes.seconds} snapshots one second apart, those "
        f"recorded the longest (scenes.pick={config.scenes.pick.name}).",
        f"real against real: up to {config.eval.n_runs} other scenes that share no second of traffic with "
        "the scene, scored in place of a simulation. No method can be expected to be closer.",
        f"noise floor: mean distance of two samples of {n_samples} speeds from the scene's distribution.",
        "real: the held-out scenes themselves. Their lane-change rate, and that of real against real, counts "
        "every vehicle of a snapshot over the second after it.",
        "realism pools the runs of a scene before it is scored; the ± is of single runs.",
        f"Intervals: {percent} percentile bootstrap, {config.eval.resamples} resamples of the scenes, the "
        "same for every figure. Differences are taken scene by scene: to `real` where the real scenes have "
        "the metric themselves, else to real against real.",
        f"h_legacy = {legacy_scale(config.hist):.4f} h, to stand beside published values on that scale.",
    ]
