"""Effects missing in lane changing: opportunities, the probability of a change, and the variables it depends on.

An opportunity is a moment, about every half second, at which a driver has room to change to one side; tables have a row
per opportunity. Its own gain is the acceleration that the driver gains by the change. Held-out drivers are those to
whom no model was fitted.
"""

from rearl_jax.discovery.lane_changes.findings import LaneChangeFindings as LaneChangeFindings
from rearl_jax.discovery.lane_changes.incentives import KnownDrivers as KnownDrivers
from rearl_jax.discovery.lane_changes.selection import lane_change_findings as lane_change_findings
from rearl_jax.discovery.lane_changes.selection import too_few_changes as too_few_changes
