"""Populations far from the usual one are found, where the traffic tells it: slow people on a slow road."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import DataConfig
from rearl_jax.config.discover import DiscoverConfig
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.data.tables.in_memory import in_memory
from rearl_jax.discovery.observe.drivers import IDM_PRIOR
from rearl_jax.discovery.observe.noise import calibrate
from rearl_jax.discovery.observe.parts import measured_drivers
from rearl_jax.discovery.observe.solver import solver_of

MEDIAN = {"desired_speed": 9.0, "time_gap": 1.1, "jam_gap": 2.0, "max_accel": 1.2, "comfort_decel": 1.6}
LENGTH, STEP, EVERY = 4.5, 0.05, 2
DRIVER_NOISE, NOISE_TIME, POSITION_NOISE = 0.2, 2.0, 0.05


def platoon(n_drivers: int, seconds: float, seed: int) -> pd.DataFrame:
    """Drivers of the published model with the parameters above, a tenth apart, behind a leader at 2 to 8 m/s."""
    rng = np.random.default_rng(seed)
    v0, gap, jam, a, b = (median * np.exp(0.1 * rng.normal(size=n_drivers)) for median in MEDIAN.values())
    x, v, noise = -8.0 * np.arange(n_drivers + 1), np.full(n_drivers + 1, 5.0), np.zeros(n_drivers)
    rows = []
    for k in range(round(seconds / STEP)):
        if k % EVERY == 0:
            rows.append((x + POSITION_NOISE * rng.normal(size=x.shape), v.copy()))
        ahead, closing = x[:-1] - x[1:] - LENGTH, v[1:] - v[:-1]
        wanted = jam + np.maximum(v[1:] * gap + v[1:] * closing / (2.0 * np.sqrt(a * b)), 0.0)
        noise += (
            DRIVER_NOISE * np.sqrt(2.0 * STEP / NOISE_TIME) * rng.normal(size=n_drivers) - noise * STEP / NOISE_TIME
        )
        accelerations = a * (1.0 - (v[1:] / v0) ** 4 - (wanted / ahead) ** 2) + noise
        time = (k + 1) * STEP
        first = 5.0 + 2.0 * np.sin(0.11 * time) + np.sin(0.29 * time + seed)
        after = np.r_[first, np.maximum(v[1:] + accelerations * STEP, 0.0)]
        x, v = x + 0.5 * (v + after) * STEP, after
    n = n_drivers + 1
    places, speeds = (np.concatenate(values) for values in zip(*rows, strict=True))
    frame = np.repeat(np.arange(len(rows)), n)
    columns = {"track_id": np.tile(np.arange(n), len(rows)), "frame": frame, "time": frame * STEP * EVERY}
    return pd.DataFrame(columns | {"position": places - places.min(), "speed": speeds, "lane": 0})


@pytest.fixture(scope="module")
def found():
    """Median parameters of the population that calibration finds."""
    table = pd.concat([platoon(7, 90.0, seed).assign(recording=f"run_{seed}") for seed in (1, 2)], ignore_index=True)
    recordings = list(iterate_recordings(in_memory(table, DataConfig())))
    _, data = measured_drivers(recordings, DiscoverConfig(), IDM_PRIOR)
    assert data.n_drivers == 14
    state, _ = calibrate(solver_of(data, IDM_PRIOR), data)
    return dict(zip(IDM_PRIOR.names, IDM_PRIOR.values(state.mean, np.array([0, 1]))[0], strict=True))


def test_the_desired_speed_of_slow_people_is_found(found):
    far = np.log(MEDIAN["desired_speed"] / IDM_PRIOR.usual_car[0])
    assert abs(far) > 10.0 * IDM_PRIOR.spread[0]  # farther than any driver of a usual population
    assert found["desired_speed"] == pytest.approx(MEDIAN["desired_speed"], rel=0.15)


@pytest.mark.parametrize("name", ["time_gap", "jam_gap", "max_accel"])
def test_what_depends_on_it_is_found_too(found, name):
    assert found[name] == pytest.approx(MEDIAN[name], rel=0.25)
