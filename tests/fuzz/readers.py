"""One fuzzed recording in, what its reader made of it out.

A reader may refuse a recording with an error of this package that names the fault, or read it. It must neither fail in
another way nor let a missing or infinite number, or a column in a wrong unit, pass.
"""

import shutil
import warnings
from pathlib import Path
from random import Random

import numpy as np

from rearl_jax.config.data import BadRows, DataConfig
from rearl_jax.data.checks.typed_table import RANGES
from rearl_jax.data.recordings import data_id, is_generated, iterate_recordings
from rearl_jax.data.records import Recording
from rearl_jax.data.schema import COLUMNS
from tests.fuzz.formats import FORMATS
from tests.fuzz.mutation import in_other_units, spoiled, unit_faults, without_a_value
from tests.fuzz.outcome import Outcome, Result, judged
from tests.fuzz.traffic import Source


class Reader:
    """One format under test."""

    def __init__(self, name: str, folder: Path) -> None:
        """Makes the sound recording.

        Args:
            name: One of FORMATS.
            folder: Where files may be written; emptied.
        """
        self.name, self._folder = name, folder
        self._format = FORMATS[name]
        self._sound: Source = self._format.make()
        self._units = unit_faults(self._format)
        self._wide = sorted({column for names in self._format.kinds.values() for column in names})

    def try_one(self, rng: Random) -> Result:
        """A fuzzed recording, read: what became of it, and details."""
        policy = rng.choice((BadRows.stop, BadRows.stop, BadRows.drop_row, BadRows.drop_track))
        dice = rng.random()
        kind = ""
        if dice < 0.15:
            kind, names, factor = rng.choice(self._units)
            kind += f" x {factor:.4g}"
            files = in_other_units(self._sound, names, factor, rng)
        elif dice < 0.25:
            files = without_a_value(self._sound, self._wide, rng)
        else:
            files = spoiled(self._sound, rng, rng.choice((0, 1, 1, 1, 2, 3, 6)))
        outcome, said = self.read(files, policy)
        if outcome is Outcome.accepted and kind:
            return Outcome.silent, f"wrong unit: {kind}"
        return outcome, said

    def read(self, files: dict[str, bytes], policy: BadRows) -> Result:
        """The reader's result for files."""
        shutil.rmtree(self._folder, ignore_errors=True)
        self._folder.mkdir(parents=True)
        for name, content in files.items():
            (self._folder / name).write_bytes(content)
        data = DataConfig(self._format.reads, str(self._folder), on_bad=policy)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                data_id(data)
                is_generated(data)
                recordings = list(iterate_recordings(data))
        except Exception as error:
            return judged(error)
        for recording in recordings:
            problem = _fault(recording)
            if problem:
                return Outcome.silent, problem
        return Outcome.accepted, ""


def _fault(recording: Recording) -> str:
    """The first thing found that no checked recording may hold; empty if there is none."""
    table = recording.table
    for column in COLUMNS:
        values = table[column.name]
        if column.dtype == "float64":
            numbers = values.to_numpy(np.float64)
            known = ~np.isnan(numbers) if column.nullable else np.ones(len(numbers), bool)
            if not np.isfinite(numbers[known]).all():
                return f"{column.name} is not finite"
        elif not column.nullable and values.isna().any():
            return f"{column.name} is unknown"
        if str(values.dtype) != column.dtype:
            return f"{column.name} is {values.dtype}"
    for name, (low, high) in RANGES.items():
        numbers = table[name].to_numpy(np.float64)
        if (numbers < low).any() or (numbers > high).any():
            return f"{name} is out of range"
    info = recording.info
    numbers = [info.frame_rate, info.road_length, *([info.speed_limit] if info.speed_limit is not None else [])]
    numbers += [offset for offsets in info.lane_markings.values() for offset in offsets]
    if not np.isfinite(numbers).all() or info.frame_rate <= 0 or not len(table):
        return f"the recording has frame rate {info.frame_rate}, road length {info.road_length}, {len(table)} rows"
    return ""
