"""TGSIM highways (I-90/I-94, I-294, I-395), one `.csv` per place with several runs, in metres."""

from rearl_jax.data.formats import tgsim
from rearl_jax.data.reader import Reader, by_first_file, parts_of_files

READER = Reader(
    expected="the folder of the TGSIM trajectories (.csv)",
    entries=parts_of_files(tgsim.find_files, tgsim.runs, tgsim.read_run),
    files=tgsim.find_files,
    recognises=by_first_file(tgsim.find_files, tgsim.is_one),
    has_one_clock=True,
)
