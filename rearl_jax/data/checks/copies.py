"""Detection of recordings that are read twice: identical, contained in another one, or slightly changed."""

import hashlib
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from rearl_jax.data.checks.speed_profiles import Profiles, SpeedProfiles
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.data.vehicle_rows import first_and_last_rows
from rearl_jax.problems import InvalidInputError, Problem


class Copies:
    """Tracks of the recordings read so far, as hashes that do not depend on the format and the ids."""

    def __init__(self) -> None:
        self._earlier: list[tuple[RecordingInfo, int, Path | None]] = []  # each with its number of tracks and its file
        self._where: dict[bytes, int] = {}  # hash of a track -> place of its recording in that list
        self._profiles = SpeedProfiles()

    def checked(self, recording: Recording, file: Path | None) -> Recording:
        """The recording, whose tracks are stored; with a note if it is a slightly changed copy of an earlier one.

        The note is for published data: OpenACC contains a platoon at ZalaZone (parts 22, 23) twice, 21 m apart. `file`
        is the file of the user that holds the recording; None for a part of a published data set.

        Raises:
            InvalidInputError: One recording contains all tracks of the other, or most vehicles have the same speeds as
                those of a recording from another file.
        """
        info, tracks = recording.info, _tracks(recording)
        shared = Counter(self._where[track] for track in tracks if track in self._where)
        for number, n_shared in shared.items():
            earlier, n_earlier, _ = self._earlier[number]
            if n_shared < min(len(tracks), n_earlier):
                continue
            message = f"the rows of {info.id} are those of {earlier.id} ({earlier.file or 'the same source'})"
            if len(tracks) != n_earlier:
                part, whole = (info, earlier) if len(tracks) < n_earlier else (earlier, info)
                message = f"all {n_shared} vehicles of {part.id} are also in {whole.id} ({whole.file or whole.source})"
            raise InvalidInputError(Problem("rows-twice", message, "keep one of the two", file=info.file or info.id))
        profiles = Profiles(recording.table)
        if (copy := self._profiles.copy_of(profiles)) is not None:
            earlier, _, earlier_file = self._earlier[copy.recording]
            fault = f"{copy.share:.0%} of the compared vehicles have the same speeds"
            fault += f", {abs(copy.offset):.1f} s apart" if abs(copy.offset) > copy.TOLERANCE else " at the same times"
            message = f"{info.id} contains vehicles of {earlier.id}: {fault}"
            if file != earlier_file:
                message = f"{info.id} contains vehicles of {earlier.id} ({earlier.file or 'the same source'}): {fault}"
                remedy = "keep one of the two, or cut off what is in both"
                raise InvalidInputError(Problem("rows-twice", message, remedy, file=info.file or info.id))
            recording = replace(recording, info=replace(info, notes=(*info.notes, message)))
        self._profiles.add(profiles)
        self._where |= dict.fromkeys(tracks, len(self._earlier))
        self._earlier.append((info, len(tracks), file))
        return recording


def _tracks(recording: Recording) -> set[bytes]:
    """Hash of each track, of its times, positions, speeds and frames since its first one."""
    table = recording.table
    starts, ends = first_and_last_rows(table["track_id"].to_numpy())
    frame = table["frame"].to_numpy(np.int64)
    frame = frame - np.repeat(frame[starts], ends - starts + 1)
    # Rounded to 1 ms, 1 mm and 1 mm/s, because formats differ by less; as integers, -0.0 and 0.0 are equal.
    columns = [np.rint(1000.0 * table[name].to_numpy()).astype(np.int64) for name in ("time", "x", "y", "speed")]
    rows = np.stack([frame, *columns], axis=1)
    return {hashlib.sha256(part.tobytes()).digest() for part in np.split(rows, starts[1:])}
