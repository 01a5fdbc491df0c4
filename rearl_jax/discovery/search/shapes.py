"""Shape of a curve (a map of the acceleration residual over one variable) in words: kind, size and range."""

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.observe.forcing import DriverScores
from rearl_jax.discovery.observe.uncertainty import LOG_OBSERVATIONS
from rearl_jax.discovery.search.maps import Curve, fitted

PENALTY = 0.5 * LOG_OBSERVATIONS
"""Complexity penalty per parameter of a shape [nats], as for a parameter of a candidate."""


def shape_words(curve: Curve, scores: DriverScores) -> str:
    """The shape with the largest gain less complexity penalty, as in `falls by 0.31 m/s^2 from 2 to 14 m`; `scores` are
    those of the knots on the innovations.
    """
    knots, n = curve.basis.knots, len(curve.basis.knots)
    edges = (knots[1:] + knots[:-1]) / 2
    unit = "" if curve.basis.variable.unit == "-" else f" {curve.basis.variable.unit}"
    tried = [(0.0, "does not change")]  # gain less penalty [nats], and shape
    size, gain = _scaled((knots - knots.mean()) / np.ptp(knots), scores)
    way = "rises" if size > 0 else "falls"
    tried.append((gain - PENALTY, f"{way} by {_amount(size)} from {knots[0]:.3g} to {knots[-1]:.3g}{unit}"))
    for k in range(1, n):
        start = edges[k - 1]
        size, gain = _scaled((np.arange(n) >= k).astype(float), scores)
        way = "up" if size > 0 else "down"
        tried.append((gain - 2 * PENALTY, f"steps {way} by {_amount(size)} at about {start:.3g}{unit}"))
        for last in range(k + 1, n):
            size, gain = _scaled(((np.arange(n) >= k) & (np.arange(n) < last)).astype(float), scores)
            level, end = "higher" if size > 0 else "lower", edges[last - 1]
            words = f"is {level} by {_amount(size)} between about {start:.3g} and {end:.3g}{unit}"
            tried.append((gain - 3 * PENALTY, words))
    free, value = fitted(scores), curve.value
    gain = float(free @ scores.score.sum(axis=0) - 0.5 * free @ scores.gram.sum(axis=0) @ free) / scores.variance
    words = (
        f"varies by {_amount(curve.reach)}, lowest at about {knots[value.argmin()]:.3g}{unit}, "
        f"highest at about {knots[value.argmax()]:.3g}{unit}"
    )
    tried.append((gain - n * PENALTY, words))
    return max(tried, key=lambda item: item[0])[1]


def _scaled(form: Float[np.ndarray, " knots"], scores: DriverScores) -> tuple[float, float]:
    """Best size [m/s^2] of a form, whose values at the knots are given for size 1 [-], and its gain [nats]."""
    score, square = float(form @ scores.score.sum(axis=0)), float(form @ scores.gram.sum(axis=0) @ form)
    size = score / max(square, 1e-12)
    return size, 0.5 * score * size / scores.variance


def _amount(size: float) -> str:
    return f"{abs(size):.2f} m/s^2"
