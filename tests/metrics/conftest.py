"""Scenes for the tests of the metrics: random ones and every degenerate case, as NumPy arrays by name."""

import numpy as np
import pytest

N_STEPS, N_VEHICLES = 12, 10

#: What can be wrong with a scene. Each is a scene the metrics must survive without a NaN.
DEGENERATE = (
    *("equal_speeds", "one_lane", "own_lanes", "one_vehicle"),
    *("all_crashed", "standing", "one_place", "out_of_range"),
)


def make_scene(seed, kind="random", n_steps=N_STEPS, n_vehicles=N_VEHICLES, recorded=False):
    """Arrays [frames, vehicles] of a scene with lane changes, crashes and close pairs."""
    rng = np.random.default_rng(seed)
    n = 1 if kind == "one_vehicle" else n_vehicles
    shape = (n_steps, n)
    speed = rng.uniform(3.0, 34.0, shape)
    speed = {"equal_speeds": np.full(shape, 21.5), "standing": np.zeros(shape)}.get(kind, speed)
    speed = rng.choice([2.0, 40.0], shape) if kind == "out_of_range" else speed
    x = rng.uniform(0.0, 150.0, n) + np.cumsum(speed, axis=0)
    lane = rng.integers(0, 4, n) + np.cumsum(rng.choice([-1, 0, 0, 0, 1], shape), axis=0)
    lane = np.clip(lane, 0, 3)
    if kind == "one_lane":
        lane = np.zeros(shape, int)
    if kind == "own_lanes":
        lane = np.tile(np.arange(n), (n_steps, 1))
    x = np.full(shape, 77.0) if kind == "one_place" else x
    y = np.zeros(shape) if kind == "one_place" else 4.0 * lane + rng.uniform(-1.0, 1.0, shape)
    crashed = np.cumsum(rng.uniform(size=shape) < 0.02, axis=0) > 0
    crashed = np.ones(shape, bool) if kind == "all_crashed" else crashed
    scene = {
        "x": x,
        "y": y,
        "position": x,
        "speed": speed,
        "scaled_speed": speed,
        "lane": lane,
        "crashed": crashed,
        "length": np.full(shape, 5.0),
        "width": np.full(shape, 2.0),
        "track_id": np.tile(np.arange(n), (n_steps, 1)),
    }
    return record(scene, rng) if recorded else scene


def record(scene, rng):
    """The scene as a recording: two carriageways, sizes, vehicles that leave and change slots."""
    shape = scene["x"].shape
    direction = rng.integers(1, 3, shape[1])[None].repeat(shape[0], 0)
    scene |= {
        "crashed": np.zeros(shape, bool),
        "direction": direction,
        "position": np.where(direction == 1, 2000.0 - scene["x"], scene["x"]),
        "length": rng.uniform(4.0, 16.0, shape[1])[None].repeat(shape[0], 0),
        "width": rng.uniform(1.7, 2.6, shape[1])[None].repeat(shape[0], 0),
        "scaled_speed": 5.0 + 27.0 * (scene["speed"] - 3.0) / 31.0,
        "track_id": scene["track_id"] + 100 * np.cumsum(rng.uniform(size=shape) < 0.1, axis=0),
    }
    order = rng.permuted(np.tile(np.arange(shape[1]), (shape[0], 1)), axis=1)
    return {name: np.take_along_axis(values, order, axis=1) for name, values in scene.items()}


@pytest.fixture(params=["float32", "float64"])
def dtype(request):
    return np.dtype(request.param)


@pytest.fixture
def rtol(dtype):
    """Sums of a few hundred numbers of similar size: some units in the last place."""
    return 2e-5 if dtype == np.float32 else 1e-11


def cast(scene, dtype):
    """The scene in the floating-point type under test; the reference reads the very same numbers."""
    return {k: v.astype(dtype) if v.dtype.kind == "f" else v for k, v in scene.items()}
