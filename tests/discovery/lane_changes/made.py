"""Opportunities made by hand, with a known chance of a change."""

import numpy as np

from rearl_jax.discovery.lane_changes.opportunities import PERIOD, Opportunities

COLUMNS = tuple(Opportunities.__dataclass_fields__)


def made(n, **columns):
    """Opportunities of which only some columns matter; the others are 0, each row a driver and a moment of its own."""
    usual = {name: np.zeros(n) for name in COLUMNS} | {
        "vehicle": np.arange(n),
        "recording": np.zeros(n, int),
        "frame": np.arange(n),
        "side": np.where(np.arange(n) % 2, 1, -1),
        "period": np.full(n, PERIOD),
    }
    usual |= {name: np.zeros(n, bool) for name in COLUMNS if name == "changes" or "is_" in name}
    return Opportunities(**usual | {name: np.asarray(values) for name, values in columns.items()})


def by_mobil(seed, n=60_000, drivers=600, threshold=0.6, politeness=0.5, bias=0.4, accepted=0.05, refused=0.001):
    """Drivers who change lanes by MOBIL, and now and then against it."""
    rng = np.random.default_rng(seed)
    gain, rear = rng.normal(0.0, 0.8, n), rng.normal(-0.3, 0.8, n)
    side, rear_after = rng.choice([-1, 1], n), rng.uniform(-2.0, 1.0, n)
    accepts = (gain + politeness * rear + bias * side >= threshold) & (rear_after >= -1.0)
    return made(
        n,
        vehicle=np.repeat(np.arange(drivers), n // drivers),
        side=side,
        incentive=gain,
        rear_gain=rear,
        rear_after=rear_after,
        side_leader_speed=rng.normal(0.0, 4.0, n),
        changes=rng.random(n) < np.where(accepts, accepted, refused),
    )
