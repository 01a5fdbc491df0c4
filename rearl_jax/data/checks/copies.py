"""Recordings that are there twice: whole, or the tracks of one among those of another, exactly or changed a little."""

import hashlib
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from rearl_jax.data.checks.speed_profiles import Profiles, SpeedProfiles
from rearl_jax.data.checks.typed_table import follows_row_before
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.problems import InvalidInputError, Problem


class Copies:
    """The tracks of the recordings read so far, each as a hash: the same in other formats and under other ids."""

    def __init__(self) -> None:
        self._infos: list[tuple[RecordingInfo, int]] = []
        self._files: list[Path | None] = []
        self._where: dict[bytes, int] = {}
        self._profiles = SpeedProfiles()

    def checked(self, recording: Recording, file: Path | None) -> Recording:
        """The recording, which is remembered; with a note if most vehicles drive as those of another one of its file.

        The note is for published data: a platoon of OpenACC at ZalaZone (parts 22, 23) is there twice, 21 m apart.

        Args:
            recording: The recording.
            file: The file of the user that it is from; None for a part of a published data set.

        Raises:
            InvalidInputError: All tracks of it are tracks of one that was read before, or the other way round, or most
                drive as those of a recording from another file.
        """
        info, tracks = recording.info, _tracks(recording)
        shared = Counter(self._where[track] for track in tracks if track in self._where)
        for number, n_shared in shared.items():
            first, n_first = self._infos[number]
            if n_shared < min(len(tracks), n_first):
                continue
            message = f"the rows of {info.id} are those of {first.id} ({first.file or 'the same source'})"
            if len(tracks) != n_first:
                part, whole = (info, first) if len(tracks) < n_first else (first, info)
                message = f"all {n_shared} vehicles of {part.id} are also in {whole.id} ({whole.file or whole.source})"
            raise InvalidInputError(Problem("rows-twice", message, "keep one of the two", file=info.file or info.id))
        profiles = Profiles(recording.table)
        if (copy := self._profiles.copy_of(profiles)) is not None:
            first, _ = self._infos[copy.recording]
            message = f"the vehicles of {info.id} drive as those of {first.id} ({first.file or 'the same source'}): "
            message += f"{copy.share:.0%} of those compared have the same speeds"
            message += (
                f", {abs(copy.offset):.1f} s apart" if abs(copy.offset) > copy.TOLERANCE else " at the same times"
            )
            if file != self._files[copy.recording]:
                remedy = "keep one of the two, or cut off what is in both"
                raise InvalidInputError(Problem("rows-twice", message, remedy, file=info.file or info.id))
            recording = replace(recording, info=replace(info, notes=(*info.notes, message)))
        self._profiles.add(profiles)
        self._where |= dict.fromkeys(tracks, len(self._infos))
        self._infos.append((info, len(tracks)))
        self._files.append(file)
        return recording


def _tracks(recording: Recording) -> set[bytes]:
    """A hash of each track: where it is when, and how fast; frames may count from another one."""
    table = recording.table
    starts = np.flatnonzero(~follows_row_before(table["track_id"].to_numpy()))
    frame = table["frame"].to_numpy(np.int64)
    frame = frame - np.repeat(frame[starts], np.diff(np.append(starts, len(frame))))
    # To 1 ms and 1 mm, more than formats differ by; - 0.0 and 0.0 are the same.
    columns = [np.rint(1000.0 * table[name].to_numpy()).astype(np.int64) for name in ("time", "x", "y", "speed")]
    rows = np.stack([frame, *columns], axis=1)
    return {hashlib.sha256(part.tobytes()).digest() for part in np.split(rows, starts[1:])}
