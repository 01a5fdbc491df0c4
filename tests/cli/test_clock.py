"""A clock that jumps back and forth changes no result: nothing but file dates and Retry-After headers looks at it."""

import subprocess
import sys

import pandas as pd
import pytest

JUMPING = """
import random, sys, time
rng, real = random.Random(0), time.time
time.time = lambda: real() + rng.uniform(-1e8, 1e8)
from rearl_jax.cli import main
sys.exit(main())
"""


@pytest.mark.slow
def test_rows_do_not_depend_on_the_clock(tmp_path):
    words = ["evaluate", "eval.n_runs=1", "eval.resamples=100", f"results.root={tmp_path}"]
    subprocess.run([sys.executable, "-m", "rearl_jax", *words, "study=usual"], check=True, capture_output=True)
    subprocess.run([sys.executable, "-c", JUMPING, *words, "study=jumping"], check=True, capture_output=True)
    for name in ("runs", "frames", "summary"):
        usual, jumping = (pd.read_parquet(tmp_path / study / f"{name}.parquet") for study in ("usual", "jumping"))
        assert len(usual) > 0
        pd.testing.assert_frame_equal(usual, jumping)
