"""Leader-follower pairs of NGSIM I-80 with lateral positions, one Parquet file in SI units."""

from rearl_jax.data.formats import ngsim_pairs
from rearl_jax.data.reader import Reader, by_columns, parts_of

READER = Reader(
    expected="the folder of the Parquet file of NGSIM I-80 pairs with lateral positions; leave it empty for the "
    "shipped one",
    entries=parts_of(ngsim_pairs.find_lateral, ngsim_pairs.lateral_recordings, ngsim_pairs.read_lateral),
    files=lambda root: [ngsim_pairs.find_lateral(root)],
    recognises=by_columns(ngsim_pairs.LATERAL_COLUMNS),
    has_one_clock=True,
)
