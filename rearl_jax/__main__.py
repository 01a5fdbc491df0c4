"""`python -m rearl_jax` is the console script `rearl`."""

import sys

from rearl_jax.cli import main

sys.exit(main())
