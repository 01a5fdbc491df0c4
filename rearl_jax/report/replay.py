"""Some rollouts of a finished evaluation, simulated again and checked against the stored figures.

The study stores figures, not trajectories. A rollout follows from seed, run and scene alone, so the same functions give
the same rollout again; if they do not, nothing is shown.
"""

import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from tempfile import TemporaryDirectory

import jax
import numpy as np
from jaxtyping import Int
from rich.progress import Progress

from rearl_jax._typing import SceneIndices
from rearl_jax.baselines.critical.mixture import Mixture
from rearl_jax.clustering.search import TRACE
from rearl_jax.config import EvaluateTask
from rearl_jax.config.decision import PolicyName
from rearl_jax.config.evaluation import Method, Variant
from rearl_jax.config.report import ReportConfig
from rearl_jax.config.scenes import BoundarySource
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.evaluation.host_policy import MakePolicy
from rearl_jax.evaluation.inputs import Inputs, read_inputs
from rearl_jax.evaluation.language_model import language_model
from rearl_jax.evaluation.percentiles import thresholds_of
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row, compares_variants
from rearl_jax.evaluation.runner import make_scorer, named_scenes, scored_chunks
from rearl_jax.evaluation.scores import WITH_EFFECT, title_of
from rearl_jax.evaluation.simulators import interventions
from rearl_jax.evaluation.traffic import inputs_id, with_road
from rearl_jax.problems import out_of_range
from rearl_jax.progress import shown
from rearl_jax.replay.scenes import Replay, ReplayedScene
from rearl_jax.report.decision_recorder import DecisionRecorder, policy_of
from rearl_jax.report.finished import FinishedStudy
from rearl_jax.results import Study
from rearl_jax.runtime import set_precision

ROUNDING_TOLERANCE = 1e-5
"""Difference of Hellinger distances [-] up to which a rollout is that of the study: the largest effect of rounding on a
mean.
"""


class NoReplayError(ValueError):
    """The scenes of a study cannot be shown; the message contains reason and remedy."""


def simulate_again(study: FinishedStudy, options: ReportConfig, bar: Progress) -> Replay:
    """The chosen rollouts of a finished `rearl evaluate`.

    Raises:
        NoReplayError: The data are missing or others, or the rollouts are not those of the study.
        ValueError: The requested scenes or the requested run are not part of the study.
    """
    config, row = _one_method(study.config)
    if config.scenes.boundary is not BoundarySource.free and interventions(config) is not None:
        raise NoReplayError(
            f"which vehicles were asked is not known with scenes.boundary={config.scenes.boundary.name}; the page of "
            "the study itself shows one scene"
        )
    if options.run >= config.eval.n_runs:
        fault = f"must be within the runs of the study, 0 to {config.eval.n_runs - 1}"
        raise out_of_range("report.run", fault, options.run)
    _require_same_data(study)
    set_precision(config.core.dtype)
    with _copy_of_search(study) as search:
        inputs = read_inputs(config, search, bar, with_references=config.method.needs_references)
    held_out = inputs.held_out(config.eval)
    chosen = chosen_scenes(inputs.scenes, held_out, options)
    replayed = tuple(_replayed(study, config, inputs, chosen, len(held_out), options.run, bar))
    _require_same_figures(study, row, inputs.scenes, replayed)
    origin = (
        f"Simulated again with {title_of(row)}, eval.seed={config.eval.seed}, run {options.run} of "
        f"{config.eval.n_runs} (from 0), and found to be the rollouts of the study: their Hellinger distances are "
        "those in runs.parquet."
    )
    has_decisions = interventions(config) is not None
    return Replay(with_road(config, inputs.scenes), inputs.scenes, replayed, origin, has_decisions=has_decisions)


def _one_method(config: EvaluateTask) -> tuple[EvaluateTask, str]:
    """The method that is shown and its row: with variants of a model the closed loop on the repaired one."""
    row = config.method.name
    if compares_variants(config):
        config = replace(config, method=Method.rearl, variant=Variant.repaired)
        row = f"{Method.rearl.name}{WITH_EFFECT}"
    if config.decision.policy is PolicyName.llm:
        # The answers are stored, so no language model is queried again.
        config = replace(config, decision=replace(config.decision, policy=PolicyName.replay))
    return config, row


@contextmanager
def _copy_of_search(study: FinishedStudy) -> Iterator[Study]:
    """A study with a copy of the trace of the search for cluster parameters, which may be continued there: nothing of
    the finished study is changed.
    """
    with TemporaryDirectory(prefix="rearl_report_") as folder:
        copy = Study(folder, "search", study.config, study.task.words, generated=study.generated)
        if study.has_table(TRACE):
            shutil.copy(study.path / f"{TRACE}.parquet", copy.path)
        yield copy


def _require_same_data(study: FinishedStudy) -> None:
    """Raise NoReplayError if the recordings are not there, or not those of the study."""
    try:
        data_id = inputs_id(study.config)
    except (OSError, ValueError) as error:
        raise NoReplayError(f"its data cannot be read: {error}") from error
    if data_id != study.provenance["data_id"]:
        raise NoReplayError(
            f"the data of the study are {study.provenance['data_id']}, those at data.root are {data_id} now: restore "
            "the former, or run the study again"
        )


def chosen_scenes(scenes: SceneSet, held_out: SceneIndices, options: ReportConfig) -> Int[np.ndarray, " chosen"]:
    """Indices of the scenes that are shown, in ascending order.

    By default they are evenly spaced in the order of mean speed, slowest and fastest included, so that the choice is
    not biased.

    Raises:
        ValueError: A requested scene is not held out.
    """
    if options.scenes is not None:
        return named_scenes(scenes, held_out, options.scenes, "report.scenes")
    by_speed = held_out[np.argsort(scenes.speed[held_out].mean(axis=(1, 2)), kind="stable")]
    ranks = np.linspace(0, len(by_speed) - 1, min(options.n_scenes, len(by_speed)))
    return np.sort(by_speed[np.unique(np.rint(ranks).astype(int))])


def _replayed(
    study: FinishedStudy,
    config: EvaluateTask,
    inputs: Inputs,
    chosen: Int[np.ndarray, " chosen"],
    n_held_out: int,
    run: int,
    bar: Progress,
) -> Iterator[ReplayedScene]:
    """One run of the chosen scenes, scored as the study scored it."""
    scenes = inputs.scenes
    thresholds = thresholds_of(replace(config, variant=study.config.variant), inputs, bar)
    row = Row(config, config.method.name, thresholds, _mixture(study))

    def rollouts_with(host_policy: MakePolicy | None) -> Rollouts:
        all_runs = Rollouts([row], scenes, chosen, inputs.references, host_policy)
        n = len(all_runs) // config.eval.n_runs
        return all_runs[run * n : (run + 1) * n]

    # As many at a time as in the study, so that its compiled programs serve again.
    scorer = make_scorer(config, scenes, config.eval.n_runs * n_held_out)
    with _decision_recorder(config, rollouts_with, bar) as recorder:
        rollouts = rollouts_with(recorder)
        first = 0
        for simulated, chunk in scored_chunks(rollouts, scorer, chosen, shown(bar, "replay")):
            for column, scene, h in zip(chunk.rollout, chunk.scene, chunk.metrics.h.value, strict=True):
                rollout = first + int(column)
                decisions = () if recorder is None else recorder.decisions
                of_rollout = tuple(decision for decision in decisions if decision.rollout == rollout)
                frames = jax.tree.map(lambda leaf, column=column: np.asarray(leaf[..., column]), simulated.frames)
                length = np.asarray(simulated.length[:, column])
                around = rollouts.boundary
                if around is not None:
                    around = around.select(rollouts.column[rollout : rollout + 1])
                yield ReplayedScene(int(scene), run, frames, length, float(h), of_rollout, around)
            first += simulated.frames.x.shape[-1]


def _mixture(study: FinishedStudy) -> Mixture | None:
    """Shares of the driver classes that the study has found; None for other methods."""
    if study.config.method is not Method.critical:
        return None
    names = tuple(f"ratio_{name}" for name in Mixture._fields)
    summary = study.summary(names)
    return Mixture(*(float(summary[name]) for name in names))


@contextmanager
def _decision_recorder(
    config: EvaluateTask, rollouts_with: Callable[[MakePolicy | None], Rollouts], bar: Progress
) -> Iterator[DecisionRecorder | None]:
    """Recorder of decisions; None if the method makes none."""
    acts = interventions(config)
    if acts is None:
        yield None
        return
    with ExitStack() as opened:
        try:
            asked = opened.enter_context(language_model(config, bar))
        except (ImportError, OSError, ValueError) as error:
            raise NoReplayError(f"the stored answers of its language model cannot be read: {error}") from error
        make = policy_of(acts, rollouts_with(None).decision_keys) if asked is None else asked.make_policy
        yield DecisionRecorder(make)


def _require_same_figures(
    study: FinishedStudy, method: str, scenes: SceneSet, replayed: tuple[ReplayedScene, ...]
) -> None:
    """Raise NoReplayError if a rollout scores otherwise than it did in the study."""
    runs = study.table("runs", ("method", "scene_id", "run", "h"))
    rows = runs.loc[(runs["method"] == method) & runs["h"].notna(), ["scene_id", "run", "h"]]
    stored = {(int(scene), int(run)): float(h) for scene, run, h in rows.itertuples(index=False)}
    for rollout in replayed:
        scene = int(scenes.scene_id[rollout.index])
        stored_h = stored.get((scene, rollout.run))
        if stored_h is None or abs(stored_h - rollout.h) > ROUNDING_TOLERANCE:
            figure = "no" if stored_h is None else f"{stored_h:.5f} as"
            raise NoReplayError(
                f"simulated again, run {rollout.run} of scene {scene} has a Hellinger distance of {rollout.h:.5f}, but "
                f"the study has {figure} figure for it: it was made by other code or on another machine "
                f"({study.provenance['code_version']}, {study.provenance['git_sha']}); {study.remedy}"
            )
