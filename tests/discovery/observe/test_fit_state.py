"""The state of a fit: information on drivers."""

import numpy as np

from rearl_jax.discovery.observe.fit_state import with_prior


def test_the_information_of_an_unstable_observer_can_be_inverted():
    """Derivatives that grow along one direction make all parameters of a driver seem known along it, and no other."""
    direction = np.array([0.2, 0.5, -0.1, 1.0])
    single = np.float32(1e18) * np.outer(direction, direction).astype(np.float32)
    usual = np.diag([1.0, 2.0, 3.0, 4.0])
    information, precision = np.stack([single.astype(float), usual]), np.eye(4) / 16
    assert np.linalg.cond(information[0] + precision) > 1e15, "the sum itself cannot be inverted"
    inverse = np.linalg.inv(with_prior(information, precision))
    assert np.isfinite(inverse).all()
    assert (np.linalg.eigvalsh(inverse[0]) > 0).all()
    np.testing.assert_allclose(inverse[1], np.linalg.inv(usual + precision), rtol=1e-5)
