"""The tasks of `rearl`.

Standard library only: `rearl --help` reads these files and nothing heavier. A task's own module is imported when the
task runs.
"""

from rearl_jax.tasks.data import DATA
from rearl_jax.tasks.exchange import EXCHANGE
from rearl_jax.tasks.folders import conf_dir, sweeps_dir
from rearl_jax.tasks.maintenance import MAINTENANCE
from rearl_jax.tasks.simulation import CLOSED_LOOP, SIMULATION
from rearl_jax.tasks.studies import STUDIES
from rearl_jax.tasks.task import Task

__all__ = ["CLOSED_LOOP", "TASKS", "Task", "conf_dir", "sweeps_dir"]

TASKS = (*DATA, *SIMULATION, *STUDIES, *EXCHANGE, *MAINTENANCE)
"""All tasks, in the order of the help text."""
