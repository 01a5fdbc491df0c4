"""A small repaired model for the tests."""

import math

from rearl_jax.config.driver import MODELS
from rearl_jax.models.record import DriverClass, EffectValues, LaneChangeValues, RepairedModel, Source, diagonal

PARAMETERS = MODELS["idm"].names
SD = dict(zip(PARAMETERS, (0.1, 0.3, 0.2, 0.25, 0.3), strict=True))


def drivers(share, usual, length, noise_sd, covariance=None):
    means = {name: math.log(value) for name, value in zip(PARAMETERS, usual, strict=True)}
    return DriverClass(share, means, covariance or diagonal(SD), noise_sd, 1.5, length, 0.1 * length)


def model(*effects, noise_sd=0.15):
    population = {
        "car": drivers(0.8, (30.0, 1.2, 2.5, 1.4, 2.0), 4.5, noise_sd),
        "truck": drivers(0.2, (24.0, 1.6, 2.5, 0.9, 2.0), 12.0, noise_sd),
    }
    baseline = {
        "car": drivers(0.8, (29.0, 1.4, 2.5, 1.4, 2.0), 4.5, 2 * noise_sd),
        "truck": drivers(0.2, (23.0, 1.8, 2.5, 0.9, 2.0), 12.0, 2 * noise_sd),
    }
    return RepairedModel(Source("us101-abc", "discover", "0.1"), population, baseline, effects)


GAIN = EffectValues("leader_acceleration", {"gain": 0.5, "reach": 60.0})
CURVE = EffectValues("dependence", {"values": [0.0, -0.1, 0.2], "knots": [0.0, 15.0, 30.0]}, "speed")
MOBIL = LaneChangeValues(politeness=0.3, gain_threshold=0.45, safe_decel=1.5, bias=-0.2, delay=90.0)
NOISE = EffectValues("perception_noise", {"gap_error": 0.05, "rate_error": 0.01, "time": 20.0})
