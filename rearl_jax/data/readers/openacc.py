"""Platoons of OpenACC, campaign ZalaZone, one Parquet file."""

from rearl_jax.data import openacc
from rearl_jax.data.reader import Reader, parts_of

READER = Reader(
    expected="the folder of the Parquet file of OpenACC platoons; leave it empty for the shipped one",
    entries=parts_of(openacc.find_platoons, openacc.platoon_recordings, openacc.read_platoon),
    files=lambda root: [openacc.find_platoons(root)],
)
