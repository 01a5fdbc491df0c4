"""Figures of a clustering as PNG bytes: tracks with their centres, map of the scenes, the search."""

import matplotlib
import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from rearl_jax import drawing
from rearl_jax.clustering.references import Clusters, TrackClusters
from rearl_jax.config import ClusterTask
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.data.scenes.splits import Splits

LABEL_COLOURS = (
    drawing.BLUE,
    drawing.ORANGE,
    drawing.GREEN,
    drawing.PURPLE,
    drawing.SKY_BLUE,
    drawing.VERMILION,
    drawing.YELLOW,
    drawing.GREY,
)
"""Colours of the labels of tracks; from the first again if there are more labels."""

_FEATURES = ("scaled speed [m/s]", "position [m]", "mean distance to others [m]")


def draw(
    config: ClusterTask,
    scenes: SceneSet,
    splits: Splits,
    clusters: Clusters,
    coordinates: Float[np.ndarray, "scenes 2"],
) -> dict[str, bytes]:
    """PNG files by name without ending."""
    figures = {
        "tracks": track_figure(clusters.tracks, generated=scenes.generated),
        "scenes": scene_figure(splits, clusters, coordinates, generated=scenes.generated),
    }
    if clusters.trace is not None:
        figures["search"] = search_figure(config, clusters.trace, generated=scenes.generated)
    return figures


def track_figure(tracks: TrackClusters, *, generated: bool) -> bytes:
    """Some tracks coloured by cluster, and the centres: speed and distance over position. Bi et al., Fig. 3."""
    figure, panels = drawing.panels(9.0, 4.0, columns=2, generated=generated)
    curves, labels = tracks.drawn_curves, tracks.labels[tracks.drawn]
    for axes, feature in zip(panels, (0, 2), strict=True):
        lines = np.stack([curves[1], curves[feature]], axis=-1).swapaxes(0, 1)
        colours = [LABEL_COLOURS[label % len(LABEL_COLOURS)] for label in labels]
        axes.add_collection(LineCollection(list(lines), colors=colours, linewidths=0.5, alpha=0.25))
        for label, centre in enumerate(tracks.centres):
            colour = LABEL_COLOURS[label % len(LABEL_COLOURS)]
            outline = {"color": "white", "linewidth": 4.5, "zorder": 3}
            axes.plot(centre[1], centre[feature], **outline)
            name = f"centre {label} ({(tracks.labels == label).mean():.0%})"
            axes.plot(centre[1], centre[feature], "o-", color=colour, linewidth=2.2, markersize=4, zorder=4, label=name)
        axes.autoscale_view()
        axes.set(xlabel=_FEATURES[1], ylabel=_FEATURES[feature], ylim=(0, None))
    panels[0].legend(frameon=False, fontsize=drawing.FONT_SIZE, loc="lower right")
    drawing.set_title(panels[0], f"{len(labels)} of {len(tracks.labels)} tracks and the centres")
    return drawing.png(figure)


def scene_figure(
    splits: Splits, clusters: Clusters, coordinates: Float[np.ndarray, "scenes 2"], *, generated: bool
) -> bytes:
    """Scenes on a t-SNE map, coloured by cluster, the representatives marked. Bi et al., Fig. 8."""
    figure, (axes,) = drawing.panels(6.4, 5.2, generated=generated)
    scene_clusters = clusters.scenes
    colours = matplotlib.colormaps["tab20"](scene_clusters.labels % 20)
    held_out = np.zeros(len(coordinates), dtype=bool)
    held_out[np.concatenate([splits.evaluation, splits.tuning])] = True
    for chosen, marker in ((~held_out, "o"), (held_out, "x")):
        shown = chosen & (scene_clusters.labels >= 0)
        axes.scatter(*coordinates[shown].T, c=colours[shown], marker=marker, s=18, linewidths=1.0)
    chosen = scene_clusters.representatives
    axes.scatter(*coordinates[chosen].T, c=colours[chosen], marker="*", s=150, edgecolors="black", linewidths=0.9)
    for reference, scene in enumerate(chosen):
        axes.annotate(str(reference), tuple(coordinates[scene]), xytext=(6, 5), textcoords="offset points", fontsize=8)
    marks = (("o", "scene"), ("x", "evaluation or tuning scene"), ("*", "representative"))
    handles = [Line2D([], [], marker=marker, linestyle="", color="black", label=text) for marker, text in marks]
    figure.legend(handles=handles, frameon=False, fontsize=drawing.FONT_SIZE, ncols=3, loc="outside lower center")
    axes.set(xlabel="t-SNE 1 [-]", ylabel="t-SNE 2 [-]")
    drawing.set_title(axes, f"{len(coordinates)} scenes in {len(scene_clusters.centres)} clusters")
    return drawing.png(figure)


def search_figure(config: ClusterTask, trace: pd.DataFrame, *, generated: bool) -> bytes:
    """Objective of every round with the best so far, and the best of every k and l."""
    figure, (left, right) = drawing.panels(9.0, 4.0, columns=2, generated=generated)
    rounds, objective = trace["round"].to_numpy(), trace["objective"].to_numpy()
    left.plot(rounds, objective, "o", color=LABEL_COLOURS[-1], markersize=2.5, label="tried")
    left.step(rounds, np.maximum.accumulate(objective), where="post", color=LABEL_COLOURS[0], label="best so far")
    left.set(xlabel="round", ylabel="silhouette minus penalty [-]")
    left.legend(frameon=False, fontsize=drawing.FONT_SIZE, loc="lower right")
    best = trace.loc[objective.argmax()]
    drawing.set_title(left, f"best: k = {best['k']}, l = {best['l']}, iterations = {best['iterations']}")
    table = np.full((len(config.bo.l), len(config.bo.k)), np.nan)
    for k, l, value in zip(trace["k"], trace["l"], objective, strict=True):  # noqa: E741 - the name in the field
        cell = config.bo.l.index(l), config.bo.k.index(k)
        table[cell] = np.fmax(table[cell], value)
    image = right.imshow(table, origin="lower", aspect="auto", cmap="viridis")
    right.set(xlabel="k", ylabel="l")
    right.set_xticks(range(len(config.bo.k)), [str(k) for k in config.bo.k])
    right.set_yticks(range(len(config.bo.l)), [str(value) for value in config.bo.l])
    bar = figure.colorbar(image, ax=right, pad=0.02)
    bar.set_label("best over iterations [-]", fontsize=drawing.FONT_SIZE)
    bar.ax.tick_params(labelsize=8)
    drawing.set_title(right, "k and l tried; white: not tried")
    return drawing.png(figure)
