"""A folder of generated recordings: written in parallel, resumed after an interruption, marked as generated."""

import hashlib
import json
import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import numpy as np

from rearl_jax.config._schema import as_plain
from rearl_jax.config.generator import GeneratorConfig
from rearl_jax.data.generator.camera import observe
from rearl_jax.data.generator.demand import draw_arrivals
from rearl_jax.data.generator.files import recording_files, write_recording
from rearl_jax.data.generator.fleet import draw_drivers
from rearl_jax.data.generator.highd_tables import Sizes, highd_tables
from rearl_jax.data.generator.plan import WARM_UP, plan_recording
from rearl_jax.data.generator.traffic import FRAME, Traffic
from rearl_jax.machine import available_cores
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.whole_files import remove_leftovers, replacing

TRUTH_FILE = "generator.json"
MODEL_VERSION = 1  # to be raised with every change that alters the files written for a given configuration
_NOT_CONTENT = ("n_recordings", "first_id", "workers")  # these keys do not alter a recording's content

_PLANTED: list[str] = []
"""Effects beyond the driver model that the generator adds: none; generator.json states an empty list."""

Progress = Callable[[int, int], None]


def generate(config: GeneratorConfig, root: Path, progress: Progress | None = None) -> list[Path]:
    """Paths of the recordings' tracks files, after writing those that are missing.

    A recording depends on the seed, its number and the configuration, not on the workers or the other recordings. The
    same call resumes a killed run. The file generator.json in the same folder marks the recordings as generated and
    states their configuration and seed. `progress` is called with the recordings done and wanted, at the start and
    after each recording.

    Raises:
        ValueError: The folder holds recordings of another configuration or of another origin.
    """
    config.check()
    root.mkdir(parents=True, exist_ok=True)
    remove_leftovers(root)
    truth = _opened_truth(config, root)
    wanted = range(config.first_id, config.first_id + config.n_recordings)
    missing = [number for number in wanted if not _is_complete(root, truth, number)]
    done = len(wanted) - len(missing)
    if progress is not None:
        progress(done, len(wanted))
    for number, sizes in _written(config, root, missing):
        truth["recordings"][f"{number:02d}"] = sizes
        _write_truth(root, truth)
        done += 1
        if progress is not None:
            progress(done, len(wanted))
    return [recording_files(root, number)[0] for number in wanted]


def generate_recording(config: GeneratorConfig, root: Path, number: int) -> dict[str, int]:
    """Simulate, observe and write one recording; returns the sizes of its files [bytes] by name."""
    plan = plan_recording(config, number)
    streams = np.random.default_rng([config.seed, number, 2]).spawn(4)
    arrivals = draw_arrivals(plan, WARM_UP + plan.duration, streams[0])
    drivers = draw_drivers(arrivals.is_truck, arrivals.pace, config, plan.section.speed_limit, streams[1])
    samples = Traffic(plan, config, arrivals, drivers, streams[2]).record()
    tracks = observe(samples, drivers, round(plan.duration / FRAME), config, streams[3])
    sizes = Sizes(drivers.is_truck, drivers.length, drivers.width)
    write_recording(root, number, highd_tables(plan, tracks, sizes, arrivals.direction, config.camera_length))
    return {path.name: path.stat().st_size for path in recording_files(root, number)}


def _written(config: GeneratorConfig, root: Path, numbers: list[int]) -> Iterator[tuple[int, dict[str, int]]]:
    """Number and file sizes of every recording as it is finished."""
    workers = min(config.workers or available_cores(), len(numbers))
    if workers <= 1:
        for number in numbers:
            yield number, generate_recording(config, root, number)
        return
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))
    try:
        jobs = {pool.submit(generate_recording, config, root, number): number for number in numbers}
        for job in as_completed(jobs):
            yield jobs[job], job.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _opened_truth(config: GeneratorConfig, root: Path) -> dict:
    """The content of generator.json, which is written if the folder is new."""
    content = {name: value for name, value in as_plain(config).items() if name not in _NOT_CONTENT}
    identity = json.dumps([MODEL_VERSION, content, _PLANTED], sort_keys=True)
    config_hash = hashlib.sha256(identity.encode()).hexdigest()[:16]
    path = root / TRUTH_FILE
    if path.exists():
        try:
            truth = json.loads(path.read_text())
        except json.JSONDecodeError as error:
            message, remedy = f"the file is not JSON ({error})", "remove the folder and generate it again"
            raise InvalidInputError(Problem("not-json", message, remedy, file=str(path))) from error
        if truth.get("config_hash") != config_hash:
            message = f"the folder holds recordings generated with another configuration{_difference(truth, content)}"
            remedy = "choose another folder (data.root), or remove this one"
            raise InvalidInputError(Problem("generated-otherwise", message, remedy, file=str(path)))
        return truth
    foreign_files = sorted(file.name for file in root.glob("*_tracks.csv"))
    if foreign_files:
        message = (
            f"the folder holds {foreign_files[0]} but no {TRUTH_FILE}, so these recordings were not generated here and "
            "are not overwritten"
        )
        remedy = "choose another folder (data.root)"
        raise InvalidInputError(Problem("not-generated", message, remedy, file=str(root)))
    truth = {
        "generated": True,
        "format": "highD",
        "model": "Gipps car following, lane changes by speed gain and gap acceptance, smoothing tracker",
        "model_version": MODEL_VERSION,
        "config_hash": config_hash,
        "config": content,
        "planted_effects": _PLANTED,
        "recordings": {},
    }
    _write_truth(root, truth)
    return truth


def _difference(truth: dict, content: dict) -> str:
    """The keys that differ, in words."""
    before = truth.get("config", {})
    changed = [
        f"{name}={before.get(name)} there, {value} here" for name, value in content.items() if before.get(name) != value
    ]
    return f" ({'; '.join(changed)})" if changed else ""


def _is_complete(root: Path, truth: dict, number: int) -> bool:
    """True if the three files are listed and have the sizes listed."""
    sizes = truth["recordings"].get(f"{number:02d}")
    return sizes is not None and all(
        (root / name).is_file() and (root / name).stat().st_size == size for name, size in sizes.items()
    )


def _write_truth(root: Path, truth: dict) -> None:
    truth["recordings"] = dict(sorted(truth["recordings"].items()))
    with replacing(root / TRUTH_FILE) as temporary:
        temporary.write_text(json.dumps(truth, indent=1) + "\n")
