"""The console script `rearl`: the command line and conf/ in; one finished configuration record for a task out.

The only package that knows Hydra; everything below it takes plain records.
"""

from rearl_jax.cli.command_line import main

__all__ = ["main"]
