"""exiD: motorways with entries and exits, which are left out; not inD, rounD and uniD, whose roads are not straight."""

from rearl_jax.data.formats import exid
from rearl_jax.data.formats.highd import find_recordings
from rearl_jax.data.reader import Reader, one_per_file
from rearl_jax.data.readers.highd import by_tracks, files

READER = Reader(
    expected="the folder of NN_tracks.csv, NN_tracksMeta.csv and NN_recordingMeta.csv",
    entries=one_per_file(find_recordings, exid.recording_id, exid.read_recording),
    files=files,
    recognises=by_tracks(exid.COLUMNS),
    has_one_clock=True,
)
