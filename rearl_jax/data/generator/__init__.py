"""Generator of recordings in the highD format.

Its traffic follows Gipps' car-following model and random lane changes by speed gain and gap acceptance. It
shares neither code nor model with the simulation core, so generated recordings are an independent test of the core.
"""

from rearl_jax.data.generator.dataset import generate as generate
