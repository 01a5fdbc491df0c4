"""Figures of an evaluation as PNG bytes: speed histogram, errors over time, space-time diagram."""

import numpy as np
from jaxtyping import Bool, Float, Int
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D

from rearl_jax import drawing
from rearl_jax.baselines.figure import ACTION_COLOURS
from rearl_jax.config import EvaluateTask
from rearl_jax.config.scenes import SpeedNorm
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.decision.situation import ACTION_NAMES
from rearl_jax.evaluation.estimates import finite_mean
from rearl_jax.evaluation.runner import DRAWN_BINS_PER_BIN, Evaluation, speed_histogram_edges
from rearl_jax.evaluation.scores import NOISE_FLOOR, REAL, REAL_VS_REAL, Scores
from rearl_jax.evaluation.tables import frame_series
from rearl_jax.metrics import METRICS

_RECORDED, _METHOD, _OTHER, _CHANCE = drawing.DARK_GREY, drawing.BLUE, drawing.VERMILION, drawing.GREY
"""Colours of the held-out scenes, the simulated row, real against real, and the noise floor."""

_BAND = (10, 90)
"""Percentiles between which a band lies, over pairs of a run and a scene."""


def draw(config: EvaluateTask, evaluation: Evaluation) -> dict[str, bytes]:
    """PNG files by name without ending."""
    extra_figures = {name: draw() for extra in evaluation.extras for name, draw in extra.figures.items()}
    return {
        "speed_histogram": speed_histogram(config, evaluation),
        "errors_over_time": errors_over_time(config, evaluation),
        "space_time": space_time(config, evaluation),
        **extra_figures,
    }


def speed_histogram(config: EvaluateTask, evaluation: Evaluation) -> bytes:
    """Speeds of the simulation over those of the held-out scenes, as densities."""
    edges = speed_histogram_edges(config.hist)
    recorded = evaluation.scenes.scaled_speed[evaluation.held_out]
    counts = {
        "recorded": np.histogram(np.clip(recorded, edges[0], edges[-1]), edges)[0],
        "method": evaluation.sample.speed_counts,
    }
    density = {name: c / max(c.sum(), 1) / np.diff(edges) for name, c in counts.items()}
    figure, (axes,) = drawing.panels(6.4, 3.6, generated=evaluation.scenes.generated)
    for edge in edges[::DRAWN_BINS_PER_BIN]:  # edges of the bins of the Hellinger distance
        axes.axvline(edge, color=drawing.LIGHT_GREY, linewidth=0.8, zorder=0)
    axes.stairs(
        density["recorded"], edges, fill=True, color=_RECORDED, alpha=0.3, label=f"real{_rescaled(evaluation.scenes)}"
    )
    axes.stairs(density["method"], edges, color=_METHOD, linewidth=1.6, label=evaluation.method.title)
    axes.set(xlabel="speed [m/s]", ylabel="density [s/m]", xlim=(edges[0], edges[-1]), ylim=(0, None))
    axes.legend(frameon=False, fontsize=drawing.FONT_SIZE)
    drawing.set_title(axes, "Speeds; grey lines: bins of the Hellinger distance")
    return drawing.png(figure)


def _rescaled(scenes: SceneSet, subject: str = "") -> str:
    """Ending of a label of recorded speeds: empty if they are as recorded."""
    return "" if scenes.speed_norm is SpeedNorm.none else f", {subject}rescaled"


def errors_over_time(config: EvaluateTask, evaluation: Evaluation) -> bytes:
    """Hellinger distance, spacing error and mean spacing by second, with bands."""
    error = config.mape.column
    figure, axes = drawing.panels(6.4, 7.2, rows=3, generated=evaluation.scenes.generated)
    method = evaluation.method
    others = evaluation.row(REAL_VS_REAL)
    compared = [(method, _METHOD), *([(others, _OTHER)] if len(others.scene) else [])]
    labels = {"h": "Hellinger distance [-]", error: f"{METRICS[error].title} [-]"}
    for panel, (name, label) in zip(axes, labels.items(), strict=False):  # the third panel is drawn below
        for row, colour in compared:
            _band(panel, row, name, colour, config.hist.window)
        panel.set(ylabel=label, ylim=(0, None))
    floor = finite_mean(evaluation.row(NOISE_FLOOR).values["h"])
    axes[0].axhline(floor, color=_CHANCE, linestyle="--", linewidth=1.2, label="noise floor")
    for row, colour in ((method, _METHOD), (evaluation.row(REAL), _RECORDED)):
        _band(axes[2], row, "spacing", colour, config.hist.window)
    axes[2].set(ylabel="mean spacing [m]", ylim=(0, None), xlabel="time [s]")
    for panel in axes:
        panel.set_xlim(0, evaluation.scenes.seconds - 1)
        panel.legend(frameon=False, ncols=3, loc="upper right", fontsize=drawing.FONT_SIZE)
        low, high = panel.get_ylim()
        panel.set_ylim(low, 1.15 * high)  # room for the legend
    runs = "1 run" if config.eval.n_runs == 1 else f"{config.eval.n_runs} runs"
    drawing.set_title(axes[0], f"Mean and {_BAND[0]} to {_BAND[1]} % band over scenes and {runs}")
    return drawing.png(figure)


def space_time(config: EvaluateTask, evaluation: Evaluation) -> bytes:
    """Vehicles of one scene in space and time, recorded and simulated, all lanes, coloured by speed."""
    scenes, index = evaluation.scenes, evaluation.sample.example
    frames = evaluation.sample.frames
    figure, (left, right) = drawing.panels(7.6, 4.4, columns=2, generated=scenes.generated)
    norm = Normalize(config.hist.low, config.hist.high)
    recorded = (scenes.x[index], scenes.scaled_speed[index], scenes.lane[index], scenes.track_id[index])
    x, crashed = np.asarray(frames.x), np.asarray(frames.crashed)
    around = evaluation.sample.around
    # Among replayed traffic another vehicle enters in the slot of one that has left.
    track = np.broadcast_to(np.arange(x.shape[1]), x.shape) if around is None else around.track_id[0]
    simulated = (x, np.asarray(frames.speed), np.asarray(frames.lane), track)
    for axes, paths in ((left, recorded), (right, simulated)):
        _draw_paths(axes, norm, *paths)
        axes.set(xlabel="time [s]", xlim=(0, scenes.seconds - 1))
        axes.margins(y=0.02)
    left.set_ylabel("position along the road [m]")
    kind = "generated" if scenes.generated else "recorded"
    drawing.set_title(left, f"{kind}: {scenes.recording[index]}, scene {scenes.scene_id[index]}")
    drawing.set_title(right, f"simulated: {evaluation.method.title}, run 0")
    bar = figure.colorbar(ScalarMappable(norm, "viridis"), ax=[left, right], pad=0.02, aspect=30)
    bar.set_label(f"speed{_rescaled(scenes, f'{kind} one ')} [m/s]", fontsize=drawing.FONT_SIZE)
    bar.ax.tick_params(labelsize=8)
    marks = [Line2D([], [], marker="o", linestyle="", color="black", markersize=3, label="lane change")]
    if crashed.any():
        marks.append(Line2D([], [], marker="x", linestyle="", color="red", markersize=6, label="crash"))
        _mark_crashes(right, x, crashed)
    right.legend(handles=marks, frameon=False, loc="upper left", fontsize=drawing.FONT_SIZE)
    return drawing.png(figure)


def draw_actions(
    counts: Int[np.ndarray, "actions bins"], edges: Float[np.ndarray, " edges"], method: str, *, generated: bool
) -> bytes:
    """PNG with the shares of the actions by the speed they were taken at, and how often that speed was driven.

    Args:
        counts: How often each action was taken, from `policy_actions.count_actions`.
        edges: Edges of the bins of the speed [m/s].
        method: Name of the method in the title.
        generated: Whether the data were generated, not measured.
    """
    total = counts.sum(axis=0)
    figure, (density, shares) = drawing.panels(6.4, 4.8, rows=2, generated=generated)
    density.stairs(total / max(total.sum(), 1) / np.diff(edges), edges, color=drawing.BLUE, linewidth=1.6)
    density.set(ylabel="density [s/m]", ylim=(0, None))
    below = np.zeros(len(total))
    for name, count, colour in zip(ACTION_NAMES, counts, ACTION_COLOURS, strict=True):
        above = below + np.divide(count, total, out=np.zeros(len(total)), where=total > 0)
        shares.stairs(above, edges, baseline=below, fill=True, color=colour, label=name)
        below = above
    shares.set(xlabel="speed before the action [m/s]", ylabel="share of the actions [-]", ylim=(0, 1))
    shares.set_xlim(edges[0], edges[-1])
    shares.legend(frameon=False, ncols=5, loc="lower center", bbox_to_anchor=(0.5, 1.0), fontsize=drawing.FONT_SIZE)
    drawing.set_title(density, f"Actions of {method} by speed; empty: no vehicle had this speed")
    return drawing.png(figure)


def _draw_paths(
    axes: Axes,
    norm: Normalize,
    x: Float[np.ndarray, "seconds slots"],
    speed: Float[np.ndarray, "seconds slots"],
    lane: Int[np.ndarray, "seconds slots"],
    track: Int[np.ndarray, "seconds slots"],
) -> None:
    """Lines in space and time, coloured by speed; the vehicle in a slot (`track`) may change."""
    time = np.broadcast_to(np.arange(len(x))[:, None], x.shape)
    order = np.lexsort((time.ravel(), track.ravel()))
    time, x, speed, lane, track = (values.ravel()[order] for values in (time, x, speed, lane, track))
    points = np.stack([time, x], axis=1)
    # A piece joins two snapshots, one second apart, that hold the same vehicle.
    is_joined = (track[1:] == track[:-1]) & (np.diff(time) == 1)
    pieces = np.stack([points[:-1], points[1:]], axis=1)[is_joined]
    lines = LineCollection(list(pieces), cmap="viridis", norm=norm, linewidths=1.6, capstyle="round")
    lines.set_array(speed[1:][is_joined])
    axes.add_collection(lines)
    changes = points[1:][is_joined & (lane[1:] != lane[:-1])]
    axes.plot(changes[:, 0], changes[:, 1], "o", color="black", markersize=3)
    axes.autoscale_view()


def _mark_crashes(
    axes: Axes, x: Float[np.ndarray, "seconds slots"], crashed: Bool[np.ndarray, "seconds slots"]
) -> None:
    """A cross where each vehicle is first seen crashed."""
    first, slots = np.nonzero(crashed & ~np.concatenate([np.zeros_like(crashed[:1]), crashed[:-1]]))
    axes.plot(first, x[first, slots], "x", color="red", markersize=6, markeredgewidth=1.5)


def _band(axes: Axes, row: Scores, name: str, colour: str, window: int) -> None:
    """Mean over the pairs of a row by second, and a band between two percentiles."""
    values = frame_series(row, window)[name]
    seconds = np.flatnonzero(np.isfinite(values).any(axis=1))
    values = values[seconds]
    low, high = np.nanpercentile(values, _BAND, axis=1)
    axes.fill_between(seconds, low, high, color=colour, alpha=0.18, linewidth=0)
    axes.plot(seconds, np.nanmean(values, axis=1), color=colour, linewidth=1.6, label=row.title)
