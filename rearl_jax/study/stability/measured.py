"""Amplification between measured vehicles and their leaders, and between simulated drivers and the same leaders.

A piece is an uninterrupted stretch of a track behind one leader, of a fixed length. The amplification of a piece in a
band of frequencies is the root of the follower's spectral power over the leader's, of speeds without mean and trend,
weighted by a Hann window. A follower is a car or person where the recordings name it, else a track; its figure is the
mean of the logarithms over its pieces. Followers are taken as independent of each other.

For each follower the logarithm of the recording is subtracted from that of the model. Two one-sided t-tests compare the
mean difference with a margin: model and recording are equivalent if its 90 % interval lies within the margin.

Source: Schuirmann, J. Pharmacokinet. Biopharm. 15 (1987) 657 (two one-sided tests).
"""

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Float, Int
from scipy import signal, stats

from rearl_jax.data.records import Recording
from rearl_jax.export.leaders import pieces_at_clock
from rearl_jax.export.platoon import STEPS_PER_SECOND, simulate, start_platoons
from rearl_jax.study.stability.cases import Case

BANDS = ((0.02, 0.05), (0.05, 0.1), (0.1, 0.2))
"""Bands of frequencies [Hz], around those at which traffic oscillates."""

MIN_SPEED = 2.0
"""Smallest mean speed of leader and follower in a piece [m/s], because standing traffic amplifies nothing."""

MIN_FOLLOWERS = 5
"""Smallest number of followers whose mean is tested."""

MEASURED_COLUMNS = ("band_low", "band_high", "followers", "measured", "measured_low", "measured_high", "simulated")
MEASURED_COLUMNS += ("ratio", "ratio_low", "ratio_high", "equivalent")


@dataclass(frozen=True)
class Pairs:
    """Pieces of measured tracks behind one leader each.

    Attributes:
        leader: Speeds of the leaders [m/s].
        follower: Speeds of the followers [m/s].
        driver: Number of each piece's follower, the same for all pieces of a car, person or track.
        overlaps: How often a follower has come to overlap its leader in the recordings.
        hours: Time behind leaders in the recordings [h].
    """

    leader: Float[np.ndarray, "steps pieces"]
    follower: Float[np.ndarray, "steps pieces"]
    driver: Int[np.ndarray, " pieces"]
    overlaps: int
    hours: float


def read_pairs(recordings: Iterable[Recording], seconds: int, same: str | None = None) -> Pairs:
    """All pieces of some recordings.

    Args:
        recordings: The recordings.
        seconds: Length of the pieces [s].
        same: Label of the same car or person in several tracks and recordings; None if none is known.
    """
    pieces: list[tuple[np.ndarray, np.ndarray, int]] = []
    numbers: dict[Hashable, int] = {}
    overlaps, hours = 0, 0.0
    for recording in recordings:
        rate, names = recording.info.frame_rate, _names(recording, same)
        for _, stretch in _behind_leaders(recording.table).groupby(["track_id", "leader_id", "stretch"]):
            is_overlap = stretch["gap"].to_numpy() < 0
            overlaps += int((is_overlap[1:] & ~is_overlap[:-1]).sum())
            hours += len(stretch) / rate / 3600
            track = int(stretch["track_id"].iloc[0])
            number = numbers.setdefault(names.get(track, (recording.info.id, track)), len(numbers))
            pieces += [(*piece, number) for piece in _pieces(stretch, rate, seconds)]
    n_steps = seconds * STEPS_PER_SECOND + 1
    leader, follower = (
        np.stack([piece[k] for piece in pieces], axis=1) if pieces else np.empty((n_steps, 0)) for k in (0, 1)
    )
    return Pairs(leader, follower, np.array([piece[2] for piece in pieces], int), overlaps, hours)


def _names(recording: Recording, same: str | None) -> Mapping[int, str]:
    """Name of the car or person of each track; without tracks whose car or person is unknown."""
    labels = recording.labels
    return labels[same].dropna().to_dict() if same in labels else {}


def _behind_leaders(table: pd.DataFrame) -> pd.DataFrame:
    """Rows with a leader, its speed, the gap [m], and the number of the uninterrupted stretch in the track."""
    followers = table.loc[table["leader_id"].notna(), ["track_id", "frame", "leader_id", "position", "speed", "length"]]
    followers = followers.astype({"leader_id": "int64"})
    columns = ["frame", "position", "speed", "length"]
    leaders = table.loc[:, columns].assign(leader_id=table["track_id"])
    both = followers.merge(leaders, on=["leader_id", "frame"], suffixes=("", "_leader"))
    both = both.sort_values(["track_id", "frame"], ignore_index=True)
    is_start = (both[["track_id", "leader_id"]].diff() != 0).any(axis=1) | (both["frame"].diff() != 1)
    gap = both["position_leader"] - both["position"] - (both["length_leader"] + both["length"]) / 2
    return both.assign(stretch=is_start.cumsum(), gap=gap)


def _pieces(stretch: pd.DataFrame, rate: float, seconds: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Speeds of leader and follower in consecutive pieces of one stretch, at the clock of the simulation; without
    pieces in which one of them stands or drives at a constant speed, whose amplification is undefined.
    """
    time = np.arange(len(stretch)) / rate
    leaders, followers = (
        pieces_at_clock(time, stretch[name].to_numpy(float), seconds) for name in ("speed_leader", "speed")
    )
    return [
        (leader, follower)
        for leader, follower in zip(leaders, followers, strict=True)
        if min(leader.mean(), follower.mean()) >= MIN_SPEED and min(np.ptp(leader), np.ptp(follower)) > 0
    ]


def log_amplification(
    leader: Float[np.ndarray, "steps pieces"], follower: Float[np.ndarray, "steps pieces"]
) -> Float[np.ndarray, "bands pieces"]:
    """Logarithm of the amplification in each of BANDS."""
    window = np.hanning(len(leader))[:, None]
    power = [np.abs(np.fft.rfft(signal.detrend(speed, axis=0) * window, axis=0)) ** 2 for speed in (leader, follower)]
    frequency = np.fft.rfftfreq(len(leader), 1 / STEPS_PER_SECOND)
    in_band = [(frequency >= low) & (frequency < high) for low, high in BANDS]
    leaders, followers = (np.stack([values[band].sum(axis=0) for band in in_band]) for values in power)
    return np.log(followers / leaders) / 2


def measured_table(case: Case, pairs: Pairs, margin: float, seed: int) -> pd.DataFrame:
    """One row per band with MEASURED_COLUMNS: geometric means over the followers of the `measured` amplification (95 %
    interval) and that of the model (`simulated`), their `ratio` (model over recording, 90 % interval) and whether both
    are `equivalent`; empty with fewer than MIN_FOLLOWERS.

    Args:
        case: The traffic model; its drawn drivers follow the measured leaders from the gap that they want.
        pairs: Measured pieces.
        margin: Largest excess of the ratio, or of its inverse, over 1 that counts as equivalent [-].
        seed: Seed of the drivers.
    """
    n = len(set(pairs.driver.tolist()))
    if n < MIN_FOLLOWERS:
        return pd.DataFrame(columns=list(MEASURED_COLUMNS))
    motion = simulate(start_platoons(case.population, pairs.leader, 1, seed), pairs.leader)
    measured = _by_follower(log_amplification(pairs.leader, pairs.follower), pairs.driver)
    model = _by_follower(log_amplification(pairs.leader, motion.speed[:, 1]), pairs.driver)
    rows = []
    for band, recorded, simulated in zip(BANDS, measured, model, strict=True):
        low, high = mean_interval(recorded, 0.95)
        ratio_low, ratio_high = mean_interval(simulated - recorded, 0.9)
        within = -np.log1p(margin) < ratio_low and ratio_high < np.log1p(margin)
        means = (recorded.mean(), low, high, simulated.mean(), (simulated - recorded).mean(), ratio_low, ratio_high)
        rows.append((*band, n, *np.exp(means), bool(within)))
    return pd.DataFrame(rows, columns=list(MEASURED_COLUMNS))


def _by_follower(
    values: Float[np.ndarray, "bands pieces"], driver: Int[np.ndarray, " pieces"]
) -> Float[np.ndarray, "bands followers"]:
    """Means over the pieces of each follower."""
    return np.stack([values[:, driver == number].mean(axis=1) for number in np.unique(driver)], axis=1)


def mean_interval(values: Float[np.ndarray, " n"], confidence: float) -> tuple[float, float]:
    """Student's interval of a mean."""
    half_width = stats.t.ppf((1 + confidence) / 2, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    return float(values.mean() - half_width), float(values.mean() + half_width)
