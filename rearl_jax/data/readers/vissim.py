"""Vehicle records of Vissim, `.fzp`: the road that most vehicles follow, in the units that the file states."""

from rearl_jax.data.formats import vissim
from rearl_jax.data.formats.simulated import is_generated
from rearl_jax.data.reader import Reader, by_first_file, one_per_file

READER = Reader(
    expected="a vehicle record of Vissim (.fzp), or a folder of them",
    entries=one_per_file(vissim.find_records, vissim.recording_id, vissim.read_record),
    files=vissim.find_records,
    generated=is_generated,
    recognises=by_first_file(vissim.find_records, vissim.is_record),
    has_one_clock=True,
)
