"""Scenarios drawn from broad priors."""

import numpy as np

from rearl_jax.blind.traffic.models import BASES
from rearl_jax.blind.traffic.population import CARS, USUAL, DriverParameter, Population
from rearl_jax.blind.traffic.priors import CHOICES, Priors
from rearl_jax.blind.traffic.scenario import Chain, Planted, Scenario

SUMO_BASES = ("sumo_idm", "sumo_eidm", "sumo_krauss", "sumo_acc", "sumo_cacc")
"""Car-following models of SUMO."""

N_RECORDINGS = 3
"""Recordings of a data set."""

BOUNDS = {
    "desired_speed": (8.0, 60.0),
    "time_gap": (0.3, 8.0),
    "jam_gap": (0.5, 15.0),
    "max_accel": (0.2, 6.0),
    "comfort_decel": (0.3, 9.0),
    "accel_exponent": (0.5, 20.0),
    "gap_exponent": (0.3, 15.0),
    "gap_gain": (0.001, 5.0),
    "approach_gain": (0.01, 5.0),
    "speed_gain": (0.01, 5.0),
}
"""Bounds of the parameters of single drivers, in the units of `models`; wider than `population.BOUNDS`."""


def draw_scenario(
    priors: Priors,
    planted: tuple[Planted, ...],
    base: str,
    seed: int,
    attempt: int,
    followers: int | None = None,
    duration: float | None = None,
) -> Scenario:
    """A scenario with given hidden effects and car-following model, all else drawn.

    Args:
        priors: Priors.
        planted: Hidden effects.
        base: The car-following model, one of BASES or SUMO_BASES.
        seed: Seed of the data set.
        attempt: Number of the attempt; each has other draws.
        followers: Followers in all recordings together, rounded to as many on each lane; None to draw it.
        duration: Recorded time [s]; None to draw it.
    """
    rng = np.random.default_rng([seed, attempt, 9])
    is_sumo = base in SUMO_BASES
    population = _population(priors, BASES["idm" if is_sumo else base].parameters, rng)
    speed_scale = population.median("desired_speed") / USUAL.median("desired_speed")
    n_lanes = int(rng.choice(CHOICES["n_lanes"]))
    # Drawn even where they are given, so that the draws after them are the same.
    drawn_followers, drawn_duration = priors.followers.draw(rng), priors.duration.draw(rng)
    per_recording = (followers or drawn_followers) / N_RECORDINGS
    per_lane = max(1, round(per_recording / n_lanes))
    seconds = round(duration or drawn_duration)
    changes = priors.lane_changes.draw(rng) * n_lanes * per_lane * seconds / 60.0
    frame_rates = CHOICES["frame_rate"][: 2 if is_sumo else None]  # the last one is too high for SUMO's time step
    driver_noise = priors.driver_noise.draw(rng)
    return Scenario(
        seed=int(rng.integers(2**32)),
        planted=planted,
        n_recordings=N_RECORDINGS,
        n_vehicles=n_lanes * (per_lane + 1),
        n_lanes=n_lanes,
        duration=float(seconds),
        frame_rate=float(rng.choice(frame_rates)),
        lane_changes=0 if is_sumo else round(changes),
        spacing=priors.spacing.draw(rng),
        pace=priors.pace.draw(rng) * speed_scale,
        driver_noise=0.0 if is_sumo else driver_noise,
        driver_noise_time=priors.driver_noise_time.draw(rng),
        noise_spread=priors.noise_spread.draw(rng),
        noise_growth=priors.noise_growth.draw(rng),
        position_noise=priors.position_noise.draw(rng),
        noise_time=_value_or_zero(priors.noise_time.draw(rng), rng),
        base="idm" if is_sumo else base,  # gives the gaps from which SUMO's own drivers start
        population=population,
        chain=_chain(priors, rng),
    )


def _population(priors: Priors, names: tuple[str, ...], rng: np.random.Generator) -> Population:
    """Drivers with the parameters of the car-following model, and in any case those of IDM: the strengths of hidden
    effects are relative to them.
    """
    all_names = tuple(dict.fromkeys((*CARS, *names)))
    factors = {
        "desired_speed": priors.truck_speed.draw(rng),
        "time_gap": priors.truck_time_gap.draw(rng),
        "max_accel": priors.truck_accel.draw(rng),
    }
    parameters = []
    for name in all_names:
        median, sd = getattr(priors, name).draw(rng), priors.parameter_spread.draw(rng)
        truck_median = median * factors.get(name, 1.0)
        parameters.append(DriverParameter(name, median, sd, truck_median, sd, *BOUNDS[name]))
    return Population(
        tuple(parameters),
        priors.truck_share.draw(rng),
        _correlation(len(all_names), priors.correlation.draw(rng), rng),
        str(rng.choice(CHOICES["shape"])),
    )


def _correlation(n: int, bound: float, rng: np.random.Generator) -> tuple[tuple[float, ...], ...]:
    """A correlation matrix whose elements are uniform between minus and plus a bound."""
    factor = rng.standard_normal((n, n + 1))
    covariance = np.linalg.inv(factor @ factor.T)
    scale = np.sqrt(np.diag(covariance))
    correlation = bound * covariance / np.outer(scale, scale) + (1.0 - bound) * np.eye(n)
    return tuple(tuple(map(float, row)) for row in correlation)


def _chain(priors: Priors, rng: np.random.Generator) -> Chain:
    kernel_time = _value_or_zero(priors.kernel_time.draw(rng), rng)
    kernel = str(rng.choice(CHOICES["kernel"]))
    return Chain(
        kernel=kernel if kernel_time else "none",
        kernel_time=kernel_time,
        speed=str(rng.choice(CHOICES["speed"])),
        slope_time=priors.slope_time.draw(rng),
        sensor_noise=priors.sensor_noise.draw(rng),
        lane=str(rng.choice(CHOICES["lane"])),
        change_time=priors.change_time.draw(rng),
    )


def _value_or_zero(value: float, rng: np.random.Generator) -> float:
    """The value or 0, each with a probability of one half."""
    return value if rng.random() < 0.5 else 0.0
