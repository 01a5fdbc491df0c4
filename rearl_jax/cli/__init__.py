"""The console script `rearl`: turns the command line and conf/ into the configuration record of a task.

The only package that uses Hydra; all packages below it take plain records.
"""

from rearl_jax.cli.command_line import main

__all__ = ["main"]
