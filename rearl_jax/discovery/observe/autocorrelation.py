"""Autocorrelation of innovations, the prediction errors of the observer, and autocovariances of residuals."""

from collections.abc import Iterable

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
    variance = max(float(((innovation * weight) ** 2).sum() / max(weight.sum(), 1.0)), 1e-12)
    return autocovariances(innovation, weight, range(stride, min(furthest, len(weight) - 1) + 1, stride)) / variance


def autocovariances(
    values: Float[np.ndarray, "steps pieces"], weight: Float[np.ndarray, "steps pieces"], lags: Iterable[int]
) -> Float[np.ndarray, " lags"]:
    """Mean products of values of mean 0 at given lags [time steps], over the pairs of time steps that both count; 0 at
    lags without such pairs.
    """
    counted, covariances = values * weight, []
    for lag in lags:
        pairs = max((weight[lag:] * weight[:-lag]).sum(), 1.0)
        covariances.append((counted[lag:] * counted[:-lag]).sum() / pairs)
    return np.array(covariances)
