"""Check that the rows of a recording are those of the tracks that NN_tracksMeta.csv of highD or exiD lists."""

import numpy as np
import pandas as pd

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.checks.losses import Losses
from rearl_jax.data.problems import DROP_HINT, Finding, bad_recording


def require_rows(
    source: pd.DataFrame, meta: pd.DataFrame, policy: DataConfig, losses: Losses, *, file: str, column: str
) -> None:
    """Counts tracks that are only listed in NN_tracksMeta.csv, or stops at the first."""
    absent = np.setdiff1d(meta.index.to_numpy(), source["track_id"].to_numpy())
    if absent.size and policy.on_bad is BadRows.stop:
        text = f"{absent.size} tracks of the meta file have no row, the first is {absent[0]}"
        remedy = f"the file is cut off: copy it again{DROP_HINT}"
        raise bad_recording("tracks-without-rows", text, remedy, file, column=column)
    if absent.size:
        losses.counts["tracks_without_rows"] += int(absent.size)


def not_in_meta(source: pd.DataFrame, meta: pd.DataFrame) -> Finding | None:
    """Rows whose track is not listed in NN_tracksMeta.csv."""
    track = source["track_id"].to_numpy()
    unknown = ~np.isin(track, meta.index.to_numpy())
    if not unknown.any():
        return None
    text = f"track {track[np.argmax(unknown)]} is not in the meta file"
    return Finding("track_without_meta", "track_id", unknown, text, "complete the meta file")


def truncated(source: pd.DataFrame, meta: pd.DataFrame) -> Finding | None:
    """Rows of tracks that have fewer frames than NN_tracksMeta.csv states."""
    ids, which, counts = np.unique(source["track_id"].to_numpy(), return_inverse=True, return_counts=True)
    stated = meta["numFrames"].reindex(ids).to_numpy()
    short = counts < stated
    if not short.any():
        return None
    first = which[np.argmax(short[which])]
    text = f"track {ids[first]} has {counts[first]} of the {stated[first]} frames that the meta file states"
    return Finding("truncated", "track_id", short[which], text, "the file is cut off: copy it again")
