"""Tables of a blind study made by hand, for tests of what is printed and reported of it."""

import pandas as pd

PROTOCOL = {"code_hash": "c0de", "config_hash": "c0", "seed_drawn": True, "master_seed": 7, "truth_sha256": "ab" * 32}

SUMMARY = {"n_cases": 3, "n_drawn": 5, "n_right": 2, "oracle_share": 0.9, "n_oracles": 2, "median_seconds": 1.5}

_ENDS = {"low": 0.09, "high": 0.99}
_OUTCOMES = {f"n_{name}": 0 for name in ("more", "part", "ambiguous", "unexplained", "nothing", "wrong", "failed")}
_SCORE = {"name": "identified", "title": "effects named", "n_hits": 2, "n_cases": 3, "rate": 2 / 3, **_ENDS}
_SET = {"set": "named", "n": 3, "n_right": 2, **_OUTCOMES, "n_wrong": 1, "n_false": 1, "rate": 1 / 3, **_ENDS}
_PARAMETER = {"effect": "grade", "parameter": "push", "n": 2, "truth": 0.5, "bias": 0.01, "rms_error": 0.02}
_CLAIMS = {"from": 0.8, "to": 0.9, "n_claims": 3, "stated": 0.85, "true": 2 / 3, **_ENDS}
_CASE = {"variant": "grade", "set": "named", "verdict": "named", "named": "grade", "outcome": "right"}

TABLES = {
    "scores": pd.DataFrame([_SCORE | {"goal": "≥ 95 %", "is_met": False}]),
    "sets": pd.DataFrame([_SET]),
    "confusion": pd.DataFrame({"hidden": ["grade", "bend"], "grade": [1, 1], "nothing": [0, 1]}),
    "parameters": pd.DataFrame([_PARAMETER | {"n_intervals": n, "coverage": c} for n, c in ((2, 0.5), (0, None))]),
    "calibration": pd.DataFrame([_CLAIMS]),
    "cases": pd.DataFrame([_CASE]),
}
"""As in the Parquet files; `cases` without the ends of intervals that some rates need."""
