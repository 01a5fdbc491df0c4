"""Leader-follower pairs of NGSIM I-80, one Parquet file in SI units."""

from rearl_jax.data.formats import ngsim_pairs
from rearl_jax.data.reader import Reader, by_columns, parts_of

READER = Reader(
    expected="the folder of the Parquet file of NGSIM I-80 leader-follower pairs; leave it empty for the shipped one",
    entries=parts_of(ngsim_pairs.find_pairs, ngsim_pairs.pairs_recordings, ngsim_pairs.read_pairs),
    files=lambda root: [ngsim_pairs.find_pairs(root)],
    recognises=by_columns(ngsim_pairs.COLUMNS),
    has_one_clock=True,
)
