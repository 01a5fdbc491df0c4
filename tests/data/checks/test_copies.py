"""Recordings that are there twice and changed a little, and recordings that only look alike."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.checks.copies import Copies
from rearl_jax.data.checks.speed_profiles import Profiles, SpeedProfiles
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.data.records import Recording, RecordingInfo
from tests.refusal import refused


def _recording(name: str, table: pd.DataFrame) -> Recording:
    return Recording(RecordingInfo(name, 10.0, {1: 1}, 1000.0, "test", "CC0", "nobody"), table)


def _traffic(seed: int, n: int = 12, seconds: float = 60.0) -> pd.DataFrame:
    """Vehicles that begin one after another and drive at slowly changing speeds."""
    rng = np.random.default_rng(seed)
    time = np.round(np.arange(0.0, seconds, 0.1), 1)
    parts = []
    for track in range(n):
        phase, pace = rng.uniform(0.0, 6.0, 3), rng.uniform(0.1, 0.8, 3)
        speed = 15.0 + sum(np.sin(pace[k] * time + phase[k]) for k in range(3))
        begin = round(float(rng.uniform(0.0, 20.0)), 1)
        rows = {"track_id": track, "time": time + begin, "speed": speed, "x": np.cumsum(0.1 * speed), "y": 0.0}
        parts.append(pd.DataFrame(rows))
    table = pd.concat(parts, ignore_index=True)
    return table.assign(frame=np.rint(10.0 * table["time"]).astype(int))


def _each_second(rows: pd.DataFrame) -> pd.DataFrame:
    kept = rows[rows["frame"] % 2 == 1]
    return kept.assign(frame=kept["frame"] // 2)


CHANGES = {
    "another clock": lambda rows: rows.assign(time=rows["time"] + 1.62e9 + 0.04),
    "rounded": lambda rows: rows.round(1),
    "a row less": lambda rows: rows.groupby("track_id").head(599),
    "another origin": lambda rows: rows.assign(x=rows["x"] + 567_000.0),
    "half the frames": _each_second,
    "overlap": lambda rows: rows[rows["time"] > 31.7],
    "other ids": lambda rows: rows.round(2).assign(track_id=11 - rows["track_id"]).sort_values(["track_id", "frame"]),
    "a part of the vehicles": lambda rows: rows.round(2)[rows["track_id"] > 5],
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
@pytest.mark.parametrize("is_first", [True, False])
def test_a_recording_that_is_there_twice_and_changed_stops(change, is_first):
    one, other = _recording("a", _traffic(0)), _recording("b", change(_traffic(0)).reset_index(drop=True))
    first, second = (one, other) if is_first else (other, one)
    copies = Copies()
    assert copies.checked(first, None) is first
    # From one file it is how the data were published.
    with refused("rows-twice", file=second.info.id):
        copies.checked(second, Path("another.csv"))


def test_other_recordings_are_no_copies():
    copies = Copies()
    for seed in range(12):
        recording = _recording(str(seed), _traffic(seed))
        assert copies.checked(recording, Path(f"{seed}.csv")) is recording
    # Most vehicles must be the same, and steady ones are all alike.
    some = _traffic(3)
    mixed = pd.concat([some[some["track_id"] < 6], _traffic(20).query("track_id >= 6")], ignore_index=True)
    assert copies.checked(_recording("mixed", mixed), Path("mixed.csv")).info.notes == ()
    for name, speed in (("steady", 20.0), ("steadier", 20.01)):
        assert copies.checked(_recording(name, some.assign(speed=speed)), Path(f"{name}.csv")).info.notes == ()


@pytest.mark.parametrize("kind", ["us101", "i80", "fhwa"])
def test_published_recordings_are_no_copies_of_each_other(kind):
    recordings = list(iterate_recordings(DataConfig(DataFormat[kind])))
    assert len(recordings) > 1
    assert not any("contains vehicles of" in note for recording in recordings for note in recording.info.notes)


def test_a_platoon_that_is_published_twice_is_noted():
    data = DataConfig(DataFormat.openacc, on_bad=BadRows.drop_row, recordings="*short_setting__dynamic_part2[23]")
    first, second = iterate_recordings(data)
    assert not any("contains vehicles of" in note for note in first.info.notes)
    (note,) = (note for note in second.info.notes if "contains vehicles of" in note)
    assert first.info.id in note
    assert second.info.file is not None
    assert str(Path(second.info.file).parent) not in note  # a page is given to others


def test_the_trees_of_many_recordings_are_few_and_find_each():
    library, tables = SpeedProfiles(), [_traffic(seed, n=3) for seed in range(40)]
    for table in tables:
        library.add(Profiles(table))
    assert len(library._trees) < 8
    for number in (0, 17, 39):
        copy = library.copy_of(Profiles(tables[number].assign(time=tables[number]["time"] + 5.0)))
        assert copy is not None
        assert (copy.recording, copy.share) == (number, 1.0)
        assert copy.offset == pytest.approx(-5.0)
