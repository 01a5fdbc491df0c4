"""Generator of traffic with hidden effects, independent of the simulation core and of discovery.

It shares no code with either and has its own integrator, neighbour search and functional forms of every effect, so that
results on its data are an independent test of discovery.
"""

from rearl_jax.blind.traffic.dataset import write_dataset as write_dataset
from rearl_jax.blind.traffic.scenario import Planted as Planted
from rearl_jax.blind.traffic.scenario import Scenario as Scenario
