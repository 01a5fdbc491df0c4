"""Random references and random traffic, as NumPy arrays and as the records of the package."""

import numpy as np
import pytest

N_REFS, N_SECONDS, N_SLOTS, N_SCENARIOS = 4, 12, 10, 6


@pytest.fixture(scope="session")
def raw():
    """Arrays of four references: speed, spacing, mean_spacing, action, share. The last is a copy of the second."""
    rng = np.random.default_rng(5)
    centre = np.array([9.0, 16.0, 24.0, 16.0])[:, None, None]
    speed = np.clip(centre + rng.normal(0, 3, (N_REFS, N_SECONDS, N_SLOTS)), 5, 32)
    spacing = np.array([60.0, 140.0, 90.0, 140.0])[:, None, None] * rng.uniform(0.5, 1.5, speed.shape)
    speed[3], spacing[3] = speed[1], spacing[1]
    action = rng.integers(0, 5, speed.shape)
    share = np.array([0.5, 0.0, 0.3, 0.2])
    return {
        "speed": speed,
        "spacing": spacing,
        "mean_spacing": spacing.mean(axis=-1),
        "action": action,
        "share": share,
    }


@pytest.fixture(scope="session")
def references(raw):
    import jax.numpy as jnp

    from rearl_jax.detection.references import References

    return References(**{name: jnp.asarray(values) for name, values in raw.items()})


@pytest.fixture(scope="session")
def table(references):
    import jax
    import jax.numpy as jnp

    from rearl_jax.config.metrics import HistConfig
    from rearl_jax.detection.table import tabulate

    return jax.jit(tabulate, static_argnums=(1, 2))(references, HistConfig(), jnp.dtype(jnp.float64))


@pytest.fixture(scope="session")
def frames():
    """Frames of vehicles at random speeds that spread out at another rate in every scenario."""
    import jax.numpy as jnp

    from rearl_jax.core.rollout import Frames

    rng = np.random.default_rng(8)
    shape = (N_SECONDS, N_SLOTS, N_SCENARIOS)
    speed = rng.uniform(8, 24, (1, 1, N_SCENARIOS)) + rng.normal(0, 4, shape)
    place = np.sort(rng.uniform(0, 1, (1, N_SLOTS, N_SCENARIOS)), axis=1)
    x = place * (
        rng.uniform(150, 450, (1, 1, N_SCENARIOS))
        + rng.uniform(5, 30, (1, 1, N_SCENARIOS)) * np.arange(N_SECONDS)[:, None, None]
    )
    lane = rng.integers(0, 4, shape)
    crashed = np.zeros(shape, bool)
    crashed[6:, 3, 2] = True
    zeros = jnp.zeros(shape)
    return Frames(
        x=jnp.asarray(x),
        y=jnp.asarray(4.0 * lane),
        heading=zeros,
        speed=jnp.asarray(speed),
        acceleration=zeros,
        lane=jnp.asarray(lane, jnp.int32),
        crashed=jnp.asarray(crashed),
    )
