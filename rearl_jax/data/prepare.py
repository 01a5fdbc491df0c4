"""The task `rearl prepare`: checked tables in the canonical columns (see `schema`), counts and scenes from recordings.

Writes into the study folder `tables/<recording>.parquet`, named by `folder.file_name_of`, `recordings.parquet` with one
row per recording, `scenes.parquet`, `config.json` and `summary.json`. Generated recordings get no tables, because their
own files are read just as fast. Recordings are read once, one at a time.
"""

import json
import logging
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from rich.progress import Progress
from rich.table import Table

from rearl_jax.config import PrepareTask
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.console import standard_output
from rearl_jax.data.files.folder import file_name_of
from rearl_jax.data.generator import generate
from rearl_jax.data.recordings import count_recordings, data_id, is_generated, iterate_recordings
from rearl_jax.data.records import Recording
from rearl_jax.data.scenes.cutting import build_scenes
from rearl_jax.data.scenes.scene_files import save_scenes
from rearl_jax.data.tables.canonical import METADATA, describe
from rearl_jax.data.vehicle_rows import follows_row_before, lane_steps
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.progress import progress_bar
from rearl_jax.results import Study

log = logging.getLogger(__name__)


def run(config: PrepareTask) -> dict:
    """The summary of the prepared data, as written to summary.json.

    Keys: recordings, rows, vehicles, trucks, hours, truck_share, in_view_mean (vehicles per frame, mean over time),
    lane_changes, windows (of time, examined for scenes), n_scenes, dropped (rows, cuts and tracks left out, by cause).

    Raises:
        FileNotFoundError, ValueError: There are no recordings, one is bad (BadRecordingError), no scene can be cut from
            them, or the folder of the tables holds other files.
    """
    config.scenes.require_free()
    with progress_bar() as progress:
        if config.data.format is DataFormat.generated:
            _generate(config, progress)
            _refuse_other_recordings(config)
        generated = is_generated(config.data)
        identity = data_id(config.data)
        study = Study(config.results.root, config.study, config, "prepare", identity, generated=generated)
        if not generated:
            _refuse_unknown_tables(study)
        study.write_config()
        task = progress.add_task("recordings", total=count_recordings(config.data))
        tally = _Tally(study, keep_tables=not generated)
        scenes = build_scenes(tally.read(config.data), config, progress=lambda _, __: progress.advance(task))
    study.write_table("recordings", pd.DataFrame(tally.rows))
    save_scenes(scenes, study)
    summary = {**_totals(tally), "windows": scenes.counts.windows, "n_scenes": len(scenes)}
    study.write_summary(summary)
    _print(summary, generated=generated)
    return summary


@dataclass
class _Tally:
    """Counts and losses of the recordings read so far.

    Attributes:
        study: Where tables are stored.
        keep_tables: Whether they are stored.
        rows: Those of recordings.parquet.
        dropped: Rows, cuts and tracks left out, by cause.
        notes: Notes already logged.
        names: Names of tables already given.
    """

    study: Study
    keep_tables: bool
    rows: list[dict] = field(default_factory=list)
    dropped: Counter[str] = field(default_factory=Counter)
    notes: set[str] = field(default_factory=set)
    names: set[str] = field(default_factory=set)

    def read(self, data: DataConfig) -> Iterator[Recording]:
        """The recordings of the data set, each counted and, if requested, stored when it is read."""
        for recording in iterate_recordings(data):
            info = recording.info
            if self.keep_tables:
                metadata = {METADATA: describe([info])}
                name = file_name_of(info.id, self.names)
                self.names.add(name)
                self.study.write_table(f"tables/{name}", recording.table, **metadata)
            self.rows.append(counts_of(recording))
            self.dropped.update(recording.dropped)
            for note in info.notes:
                if note not in self.notes:
                    log.info("%s: %s", info.id, note)
            self.notes.update(info.notes)
            yield recording
            # Released before the next recording is read.
            del recording


def counts_of(recording: Recording) -> dict:
    """One row of recordings.parquet: size, traffic and losses of a recording.

    duration [s] from the first to the last frame; in_view = mean number of vehicles per frame; speed_mean
    [m/s] over rows; lane_changes = frames in which a vehicle's lane differs from that in the frame before.
    """
    info, table = recording.info, recording.table
    track, frame = table["track_id"].to_numpy(), table["frame"].to_numpy()
    lane = table["lane"].to_numpy(dtype=np.float64, na_value=np.nan)
    follows = follows_row_before(track)
    classes = table["vehicle_class"].to_numpy()[~follows]
    n_frames = int(frame.max() - frame.min()) + 1
    dropped = recording.dropped
    return {
        "recording": info.id,
        "source": info.source,
        "licence": info.licence,
        "frame_rate": info.frame_rate,
        "duration": n_frames / info.frame_rate,
        "road_length": info.road_length,
        "lanes_1": info.lane_count.get(1, 0),
        "lanes_2": info.lane_count.get(2, 0),
        "rows": len(table),
        "vehicles": len(classes),
        "trucks": int((classes == "truck").sum()),
        "truck_share": float((classes == "truck").mean()),
        "in_view": len(table) / n_frames,
        "speed_mean": float(np.mean(table["speed"].to_numpy())),
        "lane_changes": int(np.count_nonzero(lane_steps(lane, follows))),
        "tracks_dropped": dropped.get("tracks", 0),
        "dropped": json.dumps(dict(dropped), sort_keys=True),
        "notes": "; ".join(info.notes),
    }


_SUMMED = ("rows", "vehicles", "trucks", "lane_changes", "duration")


def _totals(tally: _Tally) -> dict:
    sums = {name: sum(row[name] for row in tally.rows) for name in _SUMMED}
    seconds = sums.pop("duration")
    return {
        "recordings": len(tally.rows),
        **sums,
        "hours": seconds / 3600.0,
        "truck_share": sums["trucks"] / sums["vehicles"],
        "in_view_mean": sum(row["in_view"] * row["duration"] for row in tally.rows) / seconds,
        "dropped": dict(tally.dropped),
    }


def _generate(config: PrepareTask, progress: Progress) -> None:
    root = config.data.root
    if not root:
        message = "must name the folder the generated recordings are written to"
        raise InvalidInputError(Problem("root-unset", message, key="data.root", value="nothing"))
    task = progress.add_task("generating", total=config.generator.n_recordings)
    generate(
        config.generator,
        Path(root),
        lambda done, total: progress.update(task, completed=done, total=total),
    )


def _refuse_other_recordings(config: PrepareTask) -> None:
    """Raise InvalidInputError if the folder also holds recordings that the keys of the generator do not name."""
    wanted, found = config.generator.n_recordings, count_recordings(config.data)
    if config.data.recordings == "*" and found > wanted:
        fault = (
            f"holds {found} recordings, of which {wanted} are those of generator.n_recordings and generator.first_id"
        )
        remedy = "name another folder with data.root, or choose with data.recordings"
        raise InvalidInputError(Problem("recordings-beside", fault, remedy, key="data.root", value=config.data.root))


def _refuse_unknown_tables(study: Study) -> None:
    """Raise InvalidInputError for files beside the tables to write, because all of them would be read as one data set.

    Such are a user's own files, and the tables of a study that was copied or renamed.
    """
    if unknown := study.unknown_files("tables"):
        fault = f"holds {', '.join(unknown[:3])}{' and more' if len(unknown) > 3 else ''}, not written by this study"
        remedy = "move them elsewhere, or choose another folder with study=NAME"
        raise InvalidInputError(Problem("recordings-beside", fault, remedy, file=str(study.path / "tables")))


def _print(summary: dict, *, generated: bool) -> None:
    table = Table(title="Prepared recordings" + (" (generated, no measurements)" if generated else ""))
    table.add_column("figure")
    table.add_column("value", justify="right")
    for name, value in summary.items():
        if name == "dropped":
            value = ", ".join(f"{cause} {n}" for cause, n in value.items()) or "nothing"
        table.add_row(name, f"{value:.3f}" if isinstance(value, float) else str(value))
    standard_output(80).print(table)
