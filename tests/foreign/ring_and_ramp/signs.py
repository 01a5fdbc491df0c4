"""Sign of each effect in the TRUE trajectories, before any sensor: one number per effect and run.

With the true driver parameters the base model leaves a rest of acceleration unexplained. Each sign is how that rest
depends on what the effect reacts to; it moves in DIRECTION against the control run of the same seed if drivers do
what the source of the effect says (e.g. more desired gap = less acceleration than the base model at the same gap).
"""

from __future__ import annotations

import numpy as np

from .effects import SAG_BEND, SAG_CLIMB
from .models import Array, Ints, base_acceleration
from .traffic import DT, Run

DIRECTION = {
    "reaction_delay": 1,
    "second_leader": 1,
    "brake_light": 1,
    "speed_gap": -1,
    "hysteresis": -1,
    "resignation": -1,
    "truck_gap": -1,
    "sag": -1,
    "side_friction": -1,
    "action_points": 1,
}


def _gap(run: Run, row: Ints, i: Ints, j: Ints) -> Array:
    d = (run.x[row, j].astype(float) - run.x[row, i]) % run.wrap
    return np.where(d == 0.0, run.wrap, d) - run.fleet.length[j]


def _rest(run: Run, row: Ints, i: Ints, j: Ints, back: int = 0) -> Array:
    """Acceleration (m/s2) that the base model misses if gap and speed difference are `back` steps old."""
    f, v, old = run.fleet, run.v[row, i].astype(float), row - back
    dv = run.v[old, j].astype(float) - run.v[old, i]
    return run.a[row, i] - base_acceleration(
        run.scene.model, f, i, f.v0[i], f.gap_time[i], _gap(run, old, i, j), v, v + dv
    )


def _slope(i: Ints, y: Array, x: Array) -> float:
    """Least-squares slope of y on x within drivers."""
    n = np.maximum(np.bincount(i), 1)
    x, y = (c - (np.bincount(i, weights=c) / n)[i] for c in (x.astype(float), y))
    return float((x * y).sum() / max((x * x).sum(), 1e-9))


def _beside(run: Run, row: Ints, i: Ints) -> Array:
    """Mean speed (m/s) in the other main lane within 50 m, own speed where nobody is near."""
    out = run.v[row, i].astype(float)
    for k in np.unique(row):
        at = np.flatnonzero(row == k)
        d = (run.x[k][None, :] - run.x[k, i[at]][:, None] + run.wrap / 2) % run.wrap - run.wrap / 2
        near = (np.abs(d) < 50.0) & (run.lane[k][None, :] == 1 - run.lane[k, i[at]][:, None])
        total = (near * np.nan_to_num(run.v[k])).sum(axis=1)
        out[at] = np.where(near.any(axis=1), total / np.maximum(near.sum(axis=1), 1), out[at])
    return out


def sign(run: Run, effect: str) -> float:
    """The number that the effect moves, from car-following samples every 0.25 s without recent lane changes."""
    rows = np.arange(60, run.x.shape[0], 5)
    r, i = np.nonzero((run.lead[rows] >= 0) & (run.lane[rows] < 2))
    row, j = rows[r], run.lead[rows[r], i].astype(np.int64)
    calm = np.ones(run.x.shape, dtype=bool)
    for t, car, *_ in run.changes:
        at = round((t - run.time[0]) / DT)
        calm[max(at - 60, 0) : max(at + 400, 0), car] = False
    s, v, a = _gap(run, row, i, j), run.v[row, i].astype(float), run.a[row, i]
    good = (j != i) & (s > 1.0) & (s < 60.0) & (v > 2.0) & (v < 20.0) & (a > -2.0) & calm[row, i]
    good &= ~np.isin(i, run.pace) & (run.lead[row - 40, i] == j)
    row, i, j, s, v = row[good], i[good], j[good], s[good], v[good]
    if effect == "reaction_delay":  # s, age of the stimulus with the least rest
        return 2 * DT * int(np.argmin([np.median(np.abs(_rest(run, row, i, j, k))) for k in range(0, 38, 2)]))
    if effect == "action_points":
        return float(np.mean(np.abs(run.a[row, i] - run.a[row - 1, i]) < 2e-4))
    rest = _rest(run, row, i, j)
    if effect == "resignation":
        return float(np.mean(rest / v))
    if effect == "second_leader":
        far = run.lead[row, j].astype(np.int64)
        keep = (far >= 0) & (s + _gap(run, row, j, far) < 80.0)
        return _slope(i[keep], rest[keep], (run.v[row, far] - v)[keep])
    if effect == "brake_light":
        return _slope(i, rest, np.minimum(run.a[row - 1, j] + 0.2, 0.0))
    if effect == "sag":
        d = (run.x[row, i].astype(float) - run.scene.sag_start) % run.wrap
        return _slope(i, rest, (d > 160.0 + 0.5 * SAG_BEND) & (d < 160.0 + SAG_BEND + SAG_CLIMB))
    if effect == "truck_gap":
        cars = ~run.fleet.truck[i]
        behind = run.fleet.truck[j[cars]]
        rate = rest[cars] / v[cars]
        return float(np.mean(rate[behind]) - np.mean(rate[~behind]))
    if effect == "side_friction":
        return _slope(i, rest / v, v - _beside(run, row, i))
    if effect == "hysteresis":
        past = np.tanh(np.stack([run.a[row - k, i] for k in (1, 15, 30, 60)]) / 0.4)
        return _slope(i, rest / v, np.nan_to_num(past).mean(axis=0))
    if effect == "speed_gap":
        return _slope(i, rest / v, np.clip(1.0 - v / 20.0, 0.0, 1.0))
    raise ValueError(f"no sign for {effect!r}")
