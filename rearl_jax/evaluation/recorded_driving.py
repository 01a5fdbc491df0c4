"""The shares of driver classes in the recordings of some scenes; read once per machine and data set."""

import logging
from collections.abc import Iterator

from rich.progress import Progress

from rearl_jax._typing import SceneIndices
from rearl_jax.baselines.critical.mixture import Mixture
from rearl_jax.baselines.critical.statistics import Driving, Stretch, driving_of, recorded_mixture
from rearl_jax.cache import kept_path, read_arrays, write_arrays
from rearl_jax.config import EvaluateTask
from rearl_jax.config._schema import as_plain
from rearl_jax.config.scenes import Direction
from rearl_jax.data.recordings import count_recordings, data_id, file_stamps, iterate_recordings
from rearl_jax.data.records import Recording
from rearl_jax.data.scenes.scene_set import SceneSet

log = logging.getLogger(__name__)

_SOURCES = ("baselines/critical", "config", "data")
"""Parts of the package whose code determines the result."""


def recorded_shares(config: EvaluateTask, scenes: SceneSet, subset: SceneIndices, bar: Progress) -> Mixture:
    """Shares of the driver classes among all vehicles that drive during the scenes of a subset.

    Raises:
        ValueError: There are too few cars, or a recording is bad.
    """
    stretches = stretches_of(config, scenes, subset)
    stamps = [list(stamp) for stamp in file_stamps(config.data)]
    keys = {
        "data": data_id(config.data),
        "files": stamps,
        "stretches": {name: [list(vars(s).values()) for s in parts] for name, parts in stretches.items()},
        "reading": as_plain(config.data),
    }
    path = kept_path("driving", keys, _SOURCES, ".npz")
    arrays = read_arrays(path)
    if arrays is None:
        reading = bar.add_task("drivers in the recordings", total=count_recordings(config.data))

        def counted() -> Iterator[Recording]:
            for recording in iterate_recordings(config.data):
                yield recording
                bar.advance(reading)

        driving = driving_of(counted(), stretches)
        write_arrays(path, vars(driving))
    else:
        driving = Driving(**arrays)
    mixture = recorded_mixture(driving)
    log.info("%d vehicles in %d threshold scenes: %s", len(driving.speed), len(subset), mixture.written())
    return mixture


def stretches_of(config: EvaluateTask, scenes: SceneSet, subset: SceneIndices) -> dict[str, list[Stretch]]:
    """Parts of the recordings that the scenes of a subset show, by recording."""
    stretches: dict[str, list[Stretch]] = {}
    for index in subset:
        first = int(scenes.start_frame[index])
        stop = first + round(scenes.seconds * float(scenes.frame_rate[index]))
        is_one_way = config.scenes.direction is Direction.per_direction
        direction = int(scenes.direction[index, 0, 0]) if is_one_way else None
        stretches.setdefault(str(scenes.recording[index]), []).append(Stretch(first, stop, direction))
    return stretches
