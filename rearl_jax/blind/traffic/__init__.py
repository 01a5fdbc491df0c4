"""Generator of traffic with hidden effects, independent of the simulation core and of discovery.

It shares no code with either: own integrator, own neighbour search, own functional forms of every effect. What is
found in its data says something about the finder.
"""

from rearl_jax.blind.traffic.dataset import write_dataset as write_dataset
from rearl_jax.blind.traffic.scenario import Planted as Planted
from rearl_jax.blind.traffic.scenario import Scenario as Scenario
