"""I-24 MOTION INCEPTION, JSON documents in feet, cut into windows of `data.window` and sections of `data.section`."""

from rearl_jax.data.formats import i24
from rearl_jax.data.reader import Reader, by_first_file, parts_of_files

READER = Reader(
    expected="the folder of the trajectories (.json), or one file",
    entries=parts_of_files(i24.find_files, i24.cells, i24.read_cell),
    files=i24.find_files,
    recognises=by_first_file(i24.find_files, i24.is_one),
    has_one_clock=True,
)
