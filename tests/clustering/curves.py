"""Random curves, and groups of curves that are plain to see."""

import numpy as np

POINTS = 20


def random_curves(n_curves, n_points, seed=0):
    """Random walks, `[features, points, curves]`."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(3, n_points, n_curves)).cumsum(axis=1).astype(np.float32)


def random_bridges(n_curves, n_points, seed=0):
    """Random walks that start and end at 0, so that their ends do not decide their distance."""
    walks = random_curves(n_curves, n_points, seed)
    time = np.linspace(0.0, 1.0, n_points, dtype=np.float32)[:, None]
    return walks - walks[:, :1] - time * (walks[:, -1:] - walks[:, :1])


def grouped_curves(n_curves=240, seed=0):
    """Curves of three overlapping groups (slow, fast, slowing down), and their groups."""
    rng = np.random.default_rng(seed)
    group = rng.integers(3, size=n_curves)
    time = np.linspace(0.0, 1.0, POINTS)
    speed = np.stack([0.25 + 0 * time, 0.75 + 0 * time, 0.75 - 0.5 * time])[group]
    level = rng.normal(0.0, 0.08, (n_curves, 1))
    noise = rng.normal(0.0, 0.03, (n_curves, POINTS))
    position = np.broadcast_to(time, speed.shape) + rng.normal(0.0, 0.05, (n_curves, 1))
    distance = rng.uniform(0.2, 0.4, (n_curves, 1)) + 0.0 * speed
    curves = np.stack([speed + level + noise, position, distance]).transpose(0, 2, 1)
    return np.ascontiguousarray(curves.astype(np.float32)), group
