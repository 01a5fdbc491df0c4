"""Cuts scenes of equal shape from recordings: 60 snapshots of ten vehicles, one per second.

Recordings are read one at a time and not kept. Speeds are rescaled with extremes over all scenes, which
are known only once the last recording has been read.
"""

import logging
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from rearl_jax.config.scenes import Direction, ScenesConfig
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.data.scenes.scene_set import SceneCounts, SceneSet, speed_extremes
from rearl_jax.data.scenes.scene_windows import SceneKeys, WindowCount, cutting_keys, windows_of
from rearl_jax.problems import InvalidInputError, Problem

log = logging.getLogger(__name__)

PAPER_SCENES = 741
"""Scenes that REARL cut from the 60 recordings of highD. Source: Bi et al."""


def build_scenes(
    recordings: Iterable[Recording], keys: SceneKeys, progress: Callable[[str, int], None] | None = None
) -> SceneSet:
    """All scenes of the recordings, which are read once, one at a time; none is kept.

    `progress` is called after each recording with its id and the number of scenes so far.

    Raises:
        ValueError: No scene is left, two recordings share an id, or a recording is not canonical.

    Source: Bi et al., preprocessing of highD; what the paper leaves open is a key of the records above.
    """
    keys.scenes.check()
    parts: dict[str, list[np.ndarray]] = defaultdict(list)
    infos: list[RecordingInfo] = []
    window_counts: dict[str, WindowCount] = {}
    dropped: Counter[str] = Counter()
    n_scenes = 0
    for recording in recordings:
        info = recording.info
        if info.id in window_counts:
            message = "two recordings have this id: give every recording its own id"
            raise InvalidInputError(Problem("recording-twice", message, file=f"recording {info.id}"))
        arrays, window_counts[info.id] = windows_of(recording, keys)
        if arrays:
            infos.append(info)
        for name, values in arrays.items():
            parts[name].append(values)
        dropped.update(recording.dropped)
        n_scenes += window_counts[info.id].accepted
        log.info("%s: %d of %d windows", info.id, window_counts[info.id].accepted, window_counts[info.id].windows)
        # The loop variable would keep this recording alive while the next one is read.
        del recording
        if progress is not None:
            progress(info.id, n_scenes)
    if n_scenes == 0:
        raise InvalidInputError(_no_scene(window_counts, dropped, keys.scenes))
    counts = _counts(window_counts)
    log.info("%d scenes of %d windows; REARL reports %d from highD", n_scenes, counts.windows, PAPER_SCENES)
    # Field by field, so that the parts of a field are freed before the next one is joined.
    joined = {name: np.concatenate(parts.pop(name)) for name in tuple(parts)}
    low, high = speed_extremes(joined["speed"], keys.speed.norm)
    return SceneSet(
        scene_id=np.arange(n_scenes),
        **joined,
        speed_min=low,
        speed_max=high,
        speed_norm=keys.speed.norm,
        infos=tuple(infos),
        counts=counts,
        settings={
            f"{group}.{name}": value for group, plain in cutting_keys(keys).items() for name, value in plain.items()
        },
    )


def _counts(window_counts: Mapping[str, WindowCount]) -> SceneCounts:
    windows = sum(count.windows for count in window_counts.values())
    accepted = sum(count.accepted for count in window_counts.values())
    return SceneCounts(
        recordings=len(window_counts),
        recordings_without_scenes=sum(count.accepted == 0 for count in window_counts.values()),
        windows=windows,
        rejected=windows - accepted,
        accepted=accepted,
    )


def _no_scene(window_counts: Mapping[str, WindowCount], dropped: Mapping[str, int], scenes: ScenesConfig) -> Problem:
    """Problem of recordings that give no scene, with the key to change."""
    if not window_counts:
        message = "there are no recordings to cut scenes from: check data.format and data.root"
        return Problem("recordings-missing", message)
    windows = sum(count.windows for count in window_counts.values())
    if windows == 0:
        longest, count = max(window_counts.items(), key=lambda item: item[1].duration)
        message = (
            f"no recording lasts scenes.seconds = {scenes.seconds} s: the longest, {longest}, {count.duration:.1f} s"
        )
        return Problem("recordings-too-short", message, f"set scenes.seconds={max(int(count.duration), 2)} or less")
    best, count = max(window_counts.items(), key=lambda item: item[1].best_window)
    most = max(count.most_vehicles for count in window_counts.values())
    if count.best_window >= 2:
        remedy = f"set scenes.min_vehicles={count.best_window}"
        remedy += f" and scenes.slots={count.best_window}" if count.best_window < scenes.slots else ""
    elif most >= 2:
        remedy = "lower scenes.seconds"
    else:
        remedy = "give recordings with several vehicles at a time, each with an id of its own"
    if scenes.direction is not Direction.pooled:
        remedy += " or scenes.direction=pooled"
    message = (
        f"none of {windows} windows of {scenes.seconds} s has {scenes.min_vehicles} vehicles in every "
        f"snapshot: at best {count.best_window} in every snapshot of a window (recording {best}), {most} in "
        "a single snapshot"
    )
    if dropped:
        message += f"; left out by data.on_bad: {', '.join(f'{cause} {n}' for cause, n in dropped.items())}"
    return Problem("vehicles-too-few", message, remedy)
