"""Text of an evaluation besides its tables: data, notes, definitions, sources."""

import json
from dataclasses import asdict, dataclass

import numpy as np

from rearl_jax._typing import SceneIndices
from rearl_jax.config import ClusterTask, EvaluateTask
from rearl_jax.config.core import InitialSource
from rearl_jax.config.evaluation import SeedScope
from rearl_jax.config.metrics import HistConfig
from rearl_jax.config.scenes import BoundarySource, SpeedNorm
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.document.document import DataSource, data_sources
from rearl_jax.document.table import percent
from rearl_jax.evaluation.runner import Evaluation
from rearl_jax.evaluation.traffic import model_notes, with_road
from rearl_jax.metrics.histograms import legacy_scale

_STARTS = {
    InitialSource.seed: "drawn by eval.seed, run and scene alone",
    InitialSource.scene: "the first snapshot of the scene, with desired speeds of at most the highest recorded speed "
    "of the vehicle; runs of a scene differ in drivers drawn by eval.seed, run and scene, not in the start",
}

_ENTERING = (
    "The picked vehicles of each second are simulated: a vehicle leaves the simulation when it is no longer picked, "
    "and the vehicle that is picked instead enters where it was recorded. A driver's desired speed is at most the "
    "highest recorded speed of its vehicle, and exactly that for highway-env's drivers. Replayed vehicles do not react "
    "or collide, and no metric counts them."
)

_BOUNDARIES = {
    BoundarySource.free: (),
    BoundarySource.leaders: (f"Replayed: on each lane the vehicle ahead of the foremost simulated one. {_ENTERING}",),
    BoundarySource.measured: (f"Replayed: all recorded vehicles that are not simulated. {_ENTERING}",),
}
"""Text on what is replayed around the simulated vehicles."""

_ROLLOUTS = {
    SeedScope.run_x_scene: "one rollout for every run and scene, scored against its scene",
    SeedScope.run: "one rollout for every run, scored against every scene",
}


_INTERVALS = {
    SeedScope.run_x_scene: "",
    SeedScope.run: " The same rollouts serve all scenes, so intervals do not cover other initial states, and figures "
    "of the rollouts alone have none.",
}
"""Text on what the intervals do not cover."""


@dataclass(frozen=True)
class Remarks:
    """Text that goes with the tables; the metadata of `summary.parquet` keep it.

    Attributes:
        data: The scenes in a sentence or two.
        notes: Notes below the table.
        definitions: Definitions of rollouts, reference rows and intervals.
        sources: Data sets with their licences.
    """

    data: str = ""
    notes: tuple[str, ...] = ()
    definitions: tuple[str, ...] = ()
    sources: tuple[DataSource, ...] = ()

    def to_json(self) -> str:
        """The remarks as JSON text."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "Remarks":
        """The remarks that `to_json` wrote."""
        stored = json.loads(text)
        sources = tuple(DataSource(**source | {"notes": tuple(source["notes"])}) for source in stored["sources"])
        return cls(stored["data"], tuple(stored["notes"]), tuple(stored["definitions"]), sources)


def remarks_of(evaluation: Evaluation) -> Remarks:
    """The remarks on an evaluation."""
    config, scenes = evaluation.config, evaluation.scenes
    notes = (note for extra in evaluation.extras for note in extra.notes)
    return Remarks(
        data_summary(config, scenes, f"{len(evaluation.held_out)} of them held out for this evaluation"),
        (*notes, *model_notes(config)),
        _definitions(config, scenes, evaluation.held_out),
        data_sources(scenes.infos),
    )


def data_summary(config: EvaluateTask | ClusterTask, scenes: SceneSet, use: str) -> str:
    """Sentences on the origin of the scenes; the phrase `use` says how many of them are used, and for what."""
    counts = scenes.counts
    return (
        f"{counts.recordings} recordings, {counts.windows} windows of {scenes.seconds} s, {counts.accepted} "
        f"scenes with at least {config.scenes.min_vehicles} vehicles in every snapshot, "
        f"{use} (split.unit={config.split.unit.name}, split.seed={config.split.seed}). {_overlap(scenes)}"
        f"{_speeds(scenes)}"
    )


def _overlap(scenes: SceneSet) -> str:
    """Sentence on what overlapping scenes mean for intervals, and a space; empty if they share no traffic."""
    stride = scenes.settings.get("scenes.stride")
    if stride is None or float(stride) >= scenes.seconds:
        return ""
    return (
        f"A scene starts every {float(stride):g} s, so scenes share traffic: intervals, which take them as "
        "independent, are too narrow. "
    )


def _speeds(scenes: SceneSet) -> str:
    """Sentence on the range and the rescaling of recorded speeds."""
    speeds = f"Recorded speeds from {scenes.speed_min:.2f} to {scenes.speed_max:.2f} m/s are"
    if scenes.speed_norm is SpeedNorm.none:
        return f"{speeds} not rescaled."
    return f"{speeds} rescaled by speed.norm={scenes.speed_norm.name}; every Hellinger distance depends on these two."


def speed_bins(hist: HistConfig, speed: np.ndarray) -> str:
    """Sentence on the distribution of the compared recorded speeds [m/s] over the bins of the Hellinger distance."""
    counts, _ = np.histogram(np.clip(speed, hist.low, hist.high), hist.n_bins, (hist.low, hist.high))
    outside = float(np.mean((speed < hist.low) | (speed > hist.high)))
    return (
        f"The fullest of the {hist.n_bins} bins of the Hellinger distance holds {percent(counts.max() / speed.size)} "
        f"of the recorded speeds, and {percent(outside)} of them are outside {hist.low:g} to {hist.high:g} m/s; where "
        "one bin holds nearly all, H tells little: set hist.low and hist.high to their range."
    )


def _definitions(config: EvaluateTask, scenes: SceneSet, held_out: SceneIndices) -> tuple[str, ...]:
    road = with_road(config, scenes).core
    return (
        f"Rollouts: {road.n_vehicles} vehicles on {road.lanes} lanes for {scenes.seconds} s, "
        f"{_ROLLOUTS[config.eval.seed_scope]}. Initial states: {_STARTS[config.init.source]}; all methods start alike.",
        *_BOUNDARIES[config.scenes.boundary],
        speed_bins(config.hist, scenes.scaled_speed[held_out]),
        f"Scenes: {scenes.n_slots} vehicles in each of {scenes.seconds} snapshots one second apart, those "
        f"recorded the longest (scenes.pick={config.scenes.pick.name}).",
        f"real against real: up to {config.eval.n_runs} other scenes that share no second of traffic with "
        "the scene, scored in place of a simulation. No method can be expected to be closer.",
        f"noise floor: mean distance of two samples of {config.hist.window * scenes.n_slots} speeds from the scene's "
        "distribution.",
        "real: the held-out scenes themselves. Their lane-change rate, and that of real against real, counts "
        "every vehicle of a snapshot over the second after it.",
        "realism and the likelihoods pool the runs of a scene before it is scored; the ± is of single runs. The energy "
        "score is one of all runs of a scene, at least two.",
        f"Intervals: {100 * config.eval.confidence:g} % percentile bootstrap, {config.eval.resamples} resamples of the "
        "scenes, the same for every figure. Differences are taken scene by scene: to `real` where the real scenes have "
        f"the metric themselves, else to real against real.{_INTERVALS[config.eval.seed_scope]}",
        f"h_legacy = {legacy_scale(config.hist):.4f} h, for comparison with published values on that scale.",
    )
