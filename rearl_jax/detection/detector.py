"""Detection: once a second, the distance of every scenario from its representative scene.

Each scenario is compared with the reference that has been nearest over all seconds so far, or with one that is drawn at
the beginning. Two figures measure the deviation: the Hellinger distance of the speeds of the last seconds, and the
relative error of the present mean spacing. If one of them passes its threshold, vehicles need a decision.

Source: REARL (Bi et al.), detection section; the metrics are those of the evaluation.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, Key

from rearl_jax.config.detection import Cues, DetectionConfig, ReferenceConfig, ReferenceMode, Scope
from rearl_jax.config.metrics import HistConfig, MapeConfig, MapeDefinition
from rearl_jax.config.scenes import SpacingConfig
from rearl_jax.core.compaction import if_any
from rearl_jax.core.rollout import Frames
from rearl_jax.detection.table import ReferenceTable, at_second, draw_references, of_reference, root_shares
from rearl_jax.metrics.histograms import histogram_distances, speed_counts, speed_edges
from rearl_jax.metrics.measure import unrolled_sum
from rearl_jax.metrics.spacing import mean_spacing, spacing_errors, vehicle_spacing


@dataclasses.dataclass(frozen=True)
class DetectionOptions:
    """Choices that change the program; thresholds are arrays instead.

    Attributes:
        cues: Which of the two figures trigger decisions.
        interval: Time between two detections [s].
        scope: Vehicles of a triggered scenario that need a decision.
        mode: Choice of the reference that a scenario is compared with.
        weights: Weights of spacing error and Hellinger distance, if the choice depends on both.
        hist: Speed histogram and its window.
        definition: Relative error of the mean spacing.
        spacing: Distance between two vehicles.
    """

    cues: Cues = Cues.both
    interval: int = 1
    scope: Scope = Scope.scene
    mode: ReferenceMode = ReferenceMode.spacing
    weights: tuple[float, float] = (1.0, 1.0)
    hist: HistConfig = dataclasses.field(default_factory=HistConfig)
    definition: MapeDefinition = MapeDefinition.A
    spacing: SpacingConfig = dataclasses.field(default_factory=SpacingConfig)


def detection_options(
    detection: DetectionConfig, reference: ReferenceConfig, hist: HistConfig, mape: MapeConfig, spacing: SpacingConfig
) -> DetectionOptions:
    """The configuration without its thresholds."""
    return DetectionOptions(
        cues=detection.cues,
        interval=detection.interval,
        scope=detection.scope,
        mode=reference.mode,
        weights=reference.weights,
        hist=hist,
        definition=mape.definition,
        spacing=spacing,
    )


class Thresholds(eqx.Module):
    """Detection thresholds of every scenario.

    Attributes:
        hellinger: Distance of the speed histograms above which the speeds trigger decisions [-].
        mape: Relative error of the mean spacing above which the spacing triggers decisions [-].
    """

    hellinger: Float[Array, " scenarios"]
    mape: Float[Array, " scenarios"]


class DetectorMemory(eqx.Module):
    """Memory of the detection about the seconds so far.

    Attributes:
        second: Number of frames seen.
        counts: Speeds per bin in all frames seen.
        counts_before: Speeds per bin before each of the last frames, frame t in row t modulo the window's length.
        error_sum: Sum over the frames of the relative error of the mean spacing against each reference.
        drawn: Reference of each scenario for the whole rollout; None if the nearest reference is searched.
    """

    second: Int[Array, ""]
    counts: Int[Array, "bins scenarios"]
    counts_before: Int[Array, "window bins scenarios"]
    error_sum: Float[Array, "refs scenarios"]
    drawn: Int[Array, " scenarios"] | None


class Detection(eqx.Module):
    """Result of one frame.

    Attributes:
        reference: Index of the reference that the scenario is compared with.
        hellinger: Hellinger distance of the window's speeds to the reference's; 0 before the first full window [-].
        mape: Relative error of the mean spacing to the reference's, in the configured definition [-].
        speed_exceeded: Whether the Hellinger distance is above its threshold.
        spacing_exceeded: Whether the error of the spacing is above its threshold.
        triggered: Whether vehicles of the scenario need a decision.
        mask: Whether each vehicle needs a decision.
        spacing: Mean distance of each vehicle to the others [m].
        mean_spacing: Mean distance over all pairs [m].
    """

    reference: Int[Array, " scenarios"]
    hellinger: Float[Array, " scenarios"]
    mape: Float[Array, " scenarios"]
    speed_exceeded: Bool[Array, " scenarios"]
    spacing_exceeded: Bool[Array, " scenarios"]
    triggered: Bool[Array, " scenarios"]
    mask: Bool[Array, "vehicles scenarios"]
    spacing: Float[Array, "vehicles scenarios"]
    mean_spacing: Float[Array, " scenarios"]


def initial_memory(table: ReferenceTable, keys: Key[Array, " scenarios"], options: DetectionOptions) -> DetectorMemory:
    """Memory before the first frame.

    Args:
        table: References.
        keys: Random keys of the rollouts, from which references are drawn.
        options: Choices that change the program.
    """
    n_bins, window, n_scenarios = options.hist.n_bins, options.hist.window, keys.shape[0]
    return DetectorMemory(
        second=jnp.zeros((), jnp.int32),
        counts=jnp.zeros((n_bins, n_scenarios), jnp.int32),
        counts_before=jnp.zeros((window, n_bins, n_scenarios), jnp.int32),
        error_sum=jnp.zeros((table.n_references, n_scenarios), table.speed.dtype),
        drawn=draw_references(table.share, keys) if options.mode is ReferenceMode.drawn else None,
    )


def detect(
    memory: DetectorMemory,
    frame: Frames,
    table: ReferenceTable,
    thresholds: Thresholds,
    options: DetectionOptions,
) -> tuple[DetectorMemory, Detection]:
    """Memory after one more frame, and the result of that frame.

    Args:
        memory: Memory of the frames before.
        frame: The traffic at the end of a second; the first frame is compared with second 0 of the references.
        table: References, at least as long as the rollout.
        thresholds: Thresholds of every scenario.
        options: Choices that change the program.
    """
    second = memory.second
    spacing = vehicle_spacing(frame.x[None], frame.y[None], options.spacing)[0]
    mean = mean_spacing(spacing[None])[0]
    errors = errors_to_references(mean, table, second, options.definition)
    error_sum = memory.error_sum + errors

    window = options.hist.window
    counts_before = jax.lax.dynamic_update_index_in_dim(memory.counts_before, memory.counts, second % window, 0)
    counts = memory.counts + speed_counts(frame.speed, options.hist)
    window_counts = counts - at_second(counts_before, (second + 1) % window)

    score = error_sum / (second + 1).astype(error_sum.dtype)
    if options.mode is ReferenceMode.spacing_speed:
        spacing_weight, speed_weight = options.weights
        score = spacing_weight * score + speed_weight * prefix_distances(counts, table, second, score.dtype)
    if memory.drawn is None:
        reference, mape = nearest(score, errors)
    else:
        reference, mape = memory.drawn, jnp.take_along_axis(errors, memory.drawn[None], axis=0)[0]

    reference_counts = of_reference(at_second(table.window_counts, second), reference)
    distance = histogram_distances(window_counts, reference_counts, score.dtype)
    is_full = second + 1 >= window
    hellinger = jnp.where(is_full, distance.value, 0)
    speed_exceeded = is_full & distance.valid & (hellinger > thresholds.hellinger)
    spacing_exceeded = mape > thresholds.mape
    speed_cue, spacing_cue = _cues(speed_exceeded, spacing_exceeded, options.cues)
    is_due = (second + 1) % options.interval == 0
    triggered = is_due & (speed_cue | spacing_cue)

    def vehicles_to_ask() -> Bool[Array, "vehicles scenarios"]:
        if options.scope is Scope.scene:
            return triggered[None] & ~frame.crashed
        reference_mean = of_reference(at_second(table.mean_spacing, second), reference)
        crowded = is_in_crowded_bin(frame.speed, window_counts, reference_counts, options.hist)
        deviates_alike = jnp.sign(spacing - reference_mean[None]) == jnp.sign(mean - reference_mean)[None]
        contributes = (speed_cue[None] & crowded) | (spacing_cue[None] & deviates_alike)
        return triggered[None] & ~frame.crashed & contributes

    # Without the branch XLA would compute the whole detection once more for every vehicle.
    mask = if_any(triggered, vehicles_to_ask, jnp.zeros(frame.crashed.shape, bool))
    memory = DetectorMemory(second + 1, counts, counts_before, error_sum, memory.drawn)
    return memory, Detection(
        reference, hellinger, mape, speed_exceeded, spacing_exceeded, triggered, mask, spacing, mean
    )


def errors_to_references(
    mean: Float[Array, " scenarios"], table: ReferenceTable, second: Int[Array, ""], definition: MapeDefinition
) -> Float[Array, "refs scenarios"]:
    """Relative error of the mean spacing [m] against every reference at a second [-]; 0 if either is undefined."""

    def against(
        reference_mean: Float[Array, ""], reference_spacing: Float[Array, " slots"]
    ) -> Float[Array, " scenarios"]:
        shape = (1, reference_spacing.shape[0], mean.shape[0])
        reference_spacings = jnp.broadcast_to(reference_spacing[None, :, None], shape)
        errors = spacing_errors(mean[None], jnp.broadcast_to(reference_mean, (1, mean.shape[0])), reference_spacings)
        return {MapeDefinition.A: errors.a, MapeDefinition.B: errors.b, MapeDefinition.C: errors.c}[definition][0]

    return jax.vmap(against, in_axes=(0, -1))(at_second(table.mean_spacing, second), at_second(table.spacing, second))


def prefix_distances(
    counts: Int[Array, "bins scenarios"], table: ReferenceTable, second: Int[Array, ""], dtype: jnp.dtype
) -> Float[Array, "refs scenarios"]:
    """Hellinger distance of all speeds so far to those of every reference [-]."""
    roots = root_shares(counts, dtype)

    def against(reference: Float[Array, " bins"]) -> Float[Array, " scenarios"]:
        half_square = unrolled_sum((roots - reference[:, None]) ** 2, 0) / 2
        return jnp.sqrt(jnp.minimum(half_square, 1))

    return jax.vmap(against, in_axes=-1)(at_second(table.prefix_roots, second))


def nearest(
    score: Float[Array, "refs scenarios"], errors: Float[Array, "refs scenarios"]
) -> tuple[Int[Array, " scenarios"], Float[Array, " scenarios"]]:
    """Index of the least score, the lowest index of equal scores, and the error at that index.

    Written out over the few references: an `argmin` over the first axis is scalar code on a CPU.
    """
    index, least, error = jnp.zeros(score.shape[1:], jnp.int32), score[0], errors[0]
    for number in range(1, score.shape[0]):
        is_less = score[number] < least
        index = jnp.where(is_less, number, index)
        least = jnp.where(is_less, score[number], least)
        error = jnp.where(is_less, errors[number], error)
    return index, error


def _cues(speed: Bool[Array, " scenarios"], spacing: Bool[Array, " scenarios"], cues: Cues) -> tuple[Array, Array]:
    """Triggers of every scenario by its speeds and by its spacing."""
    no_vehicle = jnp.zeros_like(speed)
    return {
        Cues.both: (speed, spacing),
        Cues.speed: (speed, no_vehicle),
        Cues.spacing: (no_vehicle, spacing),
        Cues.always: (~no_vehicle, ~no_vehicle),
        Cues.never: (no_vehicle, no_vehicle),
    }[cues]


def is_in_crowded_bin(
    speed: Float[Array, "vehicles scenarios"],
    counts: Int[Array, "bins scenarios"],
    reference: Int[Array, "bins scenarios"],
    hist: HistConfig,
) -> Bool[Array, "vehicles scenarios"]:
    """True where a vehicle's speed is in a bin with a larger share in the simulation than in the reference.

    Args:
        speed: Speeds [m/s]; those outside the histogram belong to its outer bins.
        counts: Speeds per bin in the simulated window.
        reference: Speeds per bin in the window of the reference.
        hist: Bins.
    """
    # Shares n / N and m / M are compared exactly, as n M > m N.
    is_crowded = counts * unrolled_sum(reference, 0)[None] > reference * unrolled_sum(counts, 0)[None]
    in_crowded = jnp.broadcast_to(is_crowded[0], speed.shape)
    for bin_number, edge in enumerate(speed_edges(hist)[1:-1], 1):
        in_crowded = jnp.where(speed >= edge, is_crowded[bin_number], in_crowded)
    return in_crowded
