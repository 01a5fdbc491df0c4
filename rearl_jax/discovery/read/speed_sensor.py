"""Independently measured speeds, and positions that take their high-frequency part from them.

Satellite receivers and wheel sensors measure speed more accurately than the derivative of a position, so the speed
column is better for changes within seconds and the position for slow changes. A speed column that was computed from
positions (a filter of them, however smooth) contains no new information and is not used.

Source: complementary filter, Higgins, IEEE Trans. Aerosp. Electron. Syst. 11 (1975) 321.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float

from rearl_jax.discovery.read.fused_errors import FusedErrors, fused_errors
from rearl_jax.discovery.read.gate import Finding
from rearl_jax.discovery.read.smoothing import Thinned, smoothed, track_bounds
from rearl_jax.discovery.thresholds import THRESHOLDS

FAST = 2.0
"""Angular frequency [rad/s] above which positions and integrated speeds are compared."""

DRIFT = 0.3
"""Angular frequency [rad/s] below which the position is used, because integrated speeds drift."""

FILTER_TIME = 1.0
"""Half width of the window of positions that a computed speed would use [s]."""

FILTER_STEPS = 5
"""Smallest half width of this window [time steps]: a filter has some coefficients, however long a time step is."""

LEAST_TIME = 20.0
"""Shortest part of a track that is compared [s]."""

SPEED_SENSOR = Finding(
    name="speed_sensor",
    is_artefact=False,
    parameter="slower",
    unit="rad/s",
    value=DRIFT,
    deviation=0.0,
    words="speeds were measured independently and are smoother than positions: "
    "motion within seconds is taken from them",
)
"""Finding that the high-frequency part of positions is taken from the speeds."""


def has_speed_sensor(tables: Sequence[Thinned]) -> bool:
    """True if speeds are smoother than positions and are not a filter of the positions."""
    of_position, of_speed, dt = [], [], tables[0][1]
    reach = max(round(FILTER_TIME / dt), FILTER_STEPS)
    for position, _, driven in _tracks(tables):
        if len(position) * dt < LEAST_TIME or len(position) <= 4 * reach:
            continue
        fast_position, fast_driven = (values - smoothed(values, dt, FAST)[0] for values in (position, driven))
        window = np.lib.stride_tricks.sliding_window_view(fast_position, 2 * reach + 1)
        inner = slice(reach, len(window) - reach)  # smoothing distorts the ends
        of_position.append(window[inner])
        of_speed.append(fast_driven[reach : len(fast_driven) - reach][inner])
    if not of_position:
        return False
    windows, driven = np.concatenate(of_position), np.concatenate(of_speed)
    if driven.std() > THRESHOLDS.sensor_roughness * windows[:, reach].std():
        return False
    # What the best linear filter of the positions around each time step does not explain.
    remainder = driven - windows @ np.linalg.lstsq(windows, driven, rcond=None)[0]
    return bool(remainder.var() > THRESHOLDS.sensor_own_share * driven.var())


def with_fast_speeds(table: Thinned) -> Thinned:
    """The table with positions whose high-frequency part is the integrated speed."""
    rows, dt = table
    fused = [driven + smoothed(position - driven, dt, DRIFT)[0] for position, _, driven in _tracks([table])]
    return rows.assign(position=np.concatenate(fused) if fused else rows["position"]), dt


def errors_of_positions(tables: Sequence[Thinned]) -> FusedErrors | None:
    """Errors of positions that take their high-frequency part from the speeds; None if the tracks are too short."""
    tracks = list(_tracks(tables))
    differences, speeds = [position - driven for position, _, driven in tracks], [speed for _, speed, _ in tracks]
    return fused_errors(differences, speeds, tables[0][1], DRIFT)


def _tracks(
    tables: Sequence[Thinned],
) -> Iterator[tuple[Float[np.ndarray, " steps"], Float[np.ndarray, " steps"], Float[np.ndarray, " steps"]]]:
    """Positions of each track [m], its speeds [m/s], and the integral of these speeds since the track's start [m]."""
    for table, dt in tables:
        position, speed = table["position"].to_numpy(), table["speed"].to_numpy()
        for start, stop in zip(*track_bounds(table), strict=True):
            track_speed = speed[start:stop]
            yield (
                position[start:stop],
                track_speed,
                np.concatenate([[0.0], np.cumsum((track_speed[1:] + track_speed[:-1]) / 2) * dt]),
            )
