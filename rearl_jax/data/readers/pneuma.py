"""pNEUMA, vehicles of a city in wide rows, of which a straight stretch `data.stretch` is read."""

from rearl_jax.data.formats import pneuma
from rearl_jax.data.reader import Reader, by_first_file, one_per_file

READER = Reader(
    expected="the folder of the files of pNEUMA (.csv)",
    entries=one_per_file(pneuma.find_files, pneuma.recording_id, pneuma.read_recording),
    files=pneuma.find_files,
    recognises=by_first_file(pneuma.find_files, pneuma.is_one),
    has_one_clock=True,
)
