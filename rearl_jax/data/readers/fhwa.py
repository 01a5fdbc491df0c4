"""Leader-follower pairs of the U.S. Federal Highway Administration, one Parquet file in SI units."""

from rearl_jax.data.formats import fhwa_pairs
from rearl_jax.data.reader import Reader, by_columns, parts_of

READER = Reader(
    expected="the folder of the Parquet file of FHWA's leader-follower pairs; leave it empty for the shipped one",
    entries=parts_of(fhwa_pairs.find_pairs, fhwa_pairs.pairs_recordings, fhwa_pairs.read_pairs),
    files=lambda root: [fhwa_pairs.find_pairs(root)],
    recognises=by_columns(fhwa_pairs.COLUMNS),
    same=fhwa_pairs.PERSON,
)
