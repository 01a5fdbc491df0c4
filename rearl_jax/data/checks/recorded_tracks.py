"""Check that the rows of a recording are those of the tracks that NN_tracksMeta.csv of highD or exiD lists."""

import numpy as np
import pandas as pd

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.checks.losses import Losses, reject
from rearl_jax.data.problems import DROP_HINT, Finding, bad_recording, without_value
from rearl_jax.data.records import RecordingInfo


def whole_tracks(
    rows: pd.DataFrame, meta: pd.DataFrame, info: RecordingInfo, policy: DataConfig, losses: Losses
) -> pd.DataFrame:
    """The rows of tracks with all frames that NN_tracksMeta.csv states; tracks that are only listed there are counted.

    Raises:
        BadRecordingError: A row has no track, its track is not listed or lacks frames, or a listed track has no row,
            and data.on_bad is stop; or nothing is left.
    """
    rows = reject(rows, without_value(rows, "track_id"), info, policy, losses).astype({"track_id": np.int64})
    absent = np.setdiff1d(meta.index.to_numpy(), rows["track_id"].to_numpy())
    if absent.size and policy.on_bad is BadRows.stop:
        text = f"{absent.size} tracks of the meta file have no row, the first is {absent[0]}"
        remedy = f"the file is cut off: copy it again{DROP_HINT}"
        raise bad_recording("tracks-without-rows", text, remedy, info.file, column=info.columns["track_id"])
    losses.count("tracks_without_rows", int(absent.size))
    rows = reject(rows, _not_in_meta(rows, meta), info, policy, losses)
    return reject(rows, _truncated(rows, meta), info, policy, losses)


def _not_in_meta(rows: pd.DataFrame, meta: pd.DataFrame) -> Finding | None:
    """Rows whose track is not listed in NN_tracksMeta.csv."""
    track = rows["track_id"].to_numpy()
    unknown = ~np.isin(track, meta.index.to_numpy())
    if not unknown.any():
        return None
    text = f"track {track[np.argmax(unknown)]} is not in the meta file"
    return Finding("track_without_meta", "track_id", unknown, text, "complete the meta file")


def _truncated(rows: pd.DataFrame, meta: pd.DataFrame) -> Finding | None:
    """Rows of tracks that have fewer frames than NN_tracksMeta.csv states."""
    ids, which, counts = np.unique(rows["track_id"].to_numpy(), return_inverse=True, return_counts=True)
    stated = meta["numFrames"].reindex(ids).to_numpy()
    short = counts < stated
    if not short.any():
        return None
    first = which[np.argmax(short[which])]
    text = f"track {ids[first]} has {counts[first]} of the {stated[first]} frames that the meta file states"
    return Finding("truncated", "track_id", short[which], text, "the file is cut off: copy it again")
