"""Figure of the scene clusters after Fig. 8 of REARL (Bi et al.): the track labels in the scenes of each cluster."""

from itertools import cycle

import numpy as np
import pandas as pd

from rearl_jax.clustering.figures import LABEL_COLOURS
from rearl_jax.drawing import GREY, add_legend, panels, png, set_title


def draw_clusters(scenes: pd.DataFrame, k: int, *, generated: bool) -> bytes:
    """PNG with the mean label shares and the number of scenes of every cluster.

    Args:
        scenes: `scene_clusters.parquet` of a clustering.
        k: Number of labels; a label is the cluster of a track, whereas the bars are clusters of scenes.
        generated: Whether the recordings were generated, not measured.
    """
    scene_cluster = scenes["cluster"].to_numpy(np.float64, na_value=np.nan)
    clusters = np.unique(scene_cluster[np.isfinite(scene_cluster)]).astype(int)
    positions = np.arange(len(clusters))
    figure, (above, below) = panels(max(4.8, 1.6 + 0.42 * len(clusters)), 4.4, rows=2, generated=generated)
    bottom = np.zeros(len(clusters))
    for label, colour in zip(range(k), cycle(LABEL_COLOURS), strict=False):
        scene_shares = scenes[f"share_{label}"].to_numpy(np.float64)
        shares = np.array([scene_shares[scene_cluster == cluster].mean() for cluster in clusters])
        above.bar(positions, shares, bottom=bottom, color=colour, label=f"label {label}")
        bottom += shares
    above.set(ylabel="mean share of the tracks [-]", ylim=(0, 1))
    add_legend(figure)
    below.bar(positions, [int((scene_cluster == cluster).sum()) for cluster in clusters], color=GREY)
    below.set(xlabel="cluster", ylabel="scenes")
    below.set_xticks(positions, [str(cluster) for cluster in clusters])
    n_assigned = int(np.isfinite(scene_cluster).sum())
    set_title(above, f"{n_assigned} of {len(scenes)} scenes in {len(clusters)} clusters")
    return png(figure)
