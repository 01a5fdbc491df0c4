"""Differences between a study and the paper besides the method, which a comparison of figures must name.

Every function gives those of one subject, each as `name: text`.
"""

from rearl_jax.config import ClusterTask, EvaluateTask
from rearl_jax.config.clustering import FitOn
from rearl_jax.config.core import InitialSource
from rearl_jax.config.metrics import MapeDefinition
from rearl_jax.config.study import Table1Config
from rearl_jax.data.scenes.cutting import PAPER_SCENES
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.evaluation.tables import source_names
from rearl_jax.evaluation.traffic import with_road
from rearl_jax.metrics.histograms import legacy_scale
from rearl_jax.study.published import N_RUNS


def of_data(config: EvaluateTask | ClusterTask, scenes: SceneSet) -> list[str]:
    """Data and scenes."""
    sources = source_names(scenes)
    if scenes.generated:
        data = f"data: GENERATED recordings ({sources}), the paper has measured ones (highD)"
    else:
        data = f"data: {sources}; the paper has highD"
    notes = list(dict.fromkeys(note for info in scenes.infos for note in info.notes))
    if notes:
        data += f" ({'; '.join(note.rstrip('.') for note in notes)})"
    return [
        data,
        f"scenes: {len(scenes)} of {scenes.seconds} s with {scenes.n_slots} vehicles; the paper has {PAPER_SCENES}, "
        "and states neither the treatment of the two carriageways nor the speed range of rescaling "
        f"(here scenes.direction={config.scenes.direction.name}, speed.norm={config.speed.norm.name})",
    ]


def of_subset(n_scenes: int, n_paper: int, purpose: str, n_runs: int) -> list[str]:
    """Number of scenes for a purpose, and of simulations per scene."""
    return [f"{purpose}: {n_scenes} scenes x {n_runs} runs; the paper has {n_paper} x {N_RUNS}"]


def of_model(config: EvaluateTask, scenes: SceneSet) -> list[str]:
    """The simulated traffic."""
    road = with_road(config, scenes).core
    start = (
        "first snapshots of the scenes" if config.init.source is InitialSource.scene else "drawn as highway-env does"
    )
    return [
        f"traffic model: IDM and MOBIL as in highway-env, reimplemented; {road.n_vehicles} vehicles on "
        f"{road.lanes} lanes, initial states {start} (init.speed={config.init.speed.name}); the paper does "
        "not state its version, its parameters or its initial speeds"
    ]


def of_errors(config: EvaluateTask) -> list[str]:
    """Definitions of Hellinger distance and spacing error."""
    scale = legacy_scale(config.hist)
    definition = config.mape.definition
    written = "the paper's Eq. 8" if definition is MapeDefinition.A else "not the paper's Eq. 8 (A)"
    return [
        f"Hellinger distance: H is not scaled; H legacy = {scale:.3f} H. All values in the paper are below "
        f"{scale:.3f}, so they are probably on that scale, which the paper does not state; see H legacy here",
        f"MAPE: definition {definition.name} decides, {written}; the paper's percentiles fit definition C better, so "
        "the definition of its figures is open; they are listed under MAPE A here",
    ]


def of_decisions(asked: Table1Config | None = None) -> list[str]:
    """Decisions in the closed loop; `asked` says how often a language model is asked, None for none."""
    sentences = [
        "decisions: the matcher, a rule, replaces the paper's language models; its rows are listed next to REARL "
        "Qwen3-32B for lack of a better match"
    ]
    if asked is not None:
        sentences.append(
            f"language model: asked every {asked.llm_interval} s in {asked.llm_runs} rollout(s), each scored on all "
            "scenes, so its interval does not cover other initial states; another model than the paper's unless "
            "llm.model names one of them"
        )
    return sentences


def of_traffic_figures() -> list[str]:
    """Time headway and lane-change rate."""
    return [
        "time headway and lane-change rate: they describe traffic, so more is not better; the paper's lane-change rate "
        "of CRITICAL, .563, is one lane change per vehicle every 1.8 s and unexplained",
        "PPO and CRITICAL: built from the paper's description and public code, without the paper's weights or prompts",
    ]


def of_references(n_references: int, config: EvaluateTask | ClusterTask) -> list[str]:
    """Representative scenes."""
    if config.cluster.fit_on is FitOn.not_eval:
        fit = "fitted without evaluation and tuning scenes; the paper fits on all"
    else:
        fit = "fitted on all scenes, as in the paper"
    return [f"representative scenes: {n_references}, {fit}"]
