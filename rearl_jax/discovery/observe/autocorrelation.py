"""Autocorrelation of innovations, the prediction errors of the observer."""

import numpy as np
from jaxtyping import Float


def autocorrelation(
    innovation: Float[np.ndarray, "steps pieces"],
    weight: Float[np.ndarray, "steps pieces"],
    stride: int,
    furthest: int,
) -> Float[np.ndarray, " lags"]:
    """Autocorrelation of weighted innovations at lags of one, two, ... strides [-].

    Args:
        innovation: Innovations [m]; a piece is an uninterrupted part of a track.
        weight: 1 where a time step counts.
        stride: Time steps from one independent measurement to the next.
        furthest: Largest lag [time steps].
    """
    counted = innovation * weight
    variance = max(float((counted**2).sum() / max(weight.sum(), 1.0)), 1e-12)
    correlations = []
    for lag in range(stride, min(furthest, len(weight) - 1) + 1, stride):
        pairs = max((weight[lag:] * weight[:-lag]).sum(), 1.0)
        correlations.append((counted[lag:] * counted[:-lag]).sum() / pairs)
    return np.array(correlations) / variance
