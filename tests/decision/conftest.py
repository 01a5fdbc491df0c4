"""Random references, and traffic to decide about."""

import numpy as np
import pytest

N_VEHICLES, N_SCENARIOS, N_SECONDS = 10, 24, 8


@pytest.fixture(scope="session")
def model():
    from rearl_jax.core.model import TrafficModel

    return TrafficModel(meta_follows=True)


@pytest.fixture(scope="session")
def table():
    """Three references: slow, of mixed speeds, fast; with all kinds of actions."""
    import jax
    import jax.numpy as jnp

    from rearl_jax.config.metrics import HistConfig
    from rearl_jax.detection.references import References
    from rearl_jax.detection.table import tabulate

    rng = np.random.default_rng(2)
    shape = (3, N_SECONDS, N_VEHICLES)
    speed = np.clip(np.array([9.0, 18.0, 27.0])[:, None, None] + rng.normal(0, 4, shape), 5, 32)
    spacing = np.array([150.0, 90.0, 50.0])[:, None, None] * rng.uniform(0.5, 1.5, shape)
    references = References(
        speed=jnp.asarray(speed),
        spacing=jnp.asarray(spacing),
        mean_spacing=jnp.asarray(spacing.mean(axis=-1)),
        action=jnp.asarray(rng.choice(5, shape, p=[0.2, 0.2, 0.2, 0.2, 0.2])),
        share=jnp.asarray([0.2, 0.3, 0.5]),
    )
    return jax.jit(tabulate, static_argnums=1)(references, HistConfig())


@pytest.fixture(scope="session")
def start(model):
    """Drawn traffic and its drivers."""
    import jax

    from rearl_jax.core.spawn import spawn

    draw = jax.jit(lambda keys: spawn(keys, model, n_vehicles=N_VEHICLES, density=3.0))
    return draw(jax.random.split(jax.random.key(4), N_SCENARIOS))
