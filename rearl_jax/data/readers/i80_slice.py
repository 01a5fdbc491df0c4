"""A slice of the leader-follower pairs of NGSIM I-80, for a first look: one recording, pairs of 60 s or more."""

from rearl_jax.data.readers import i80

READER = i80.READER
