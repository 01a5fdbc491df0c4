"""Speeds of measured first vehicles, which have no vehicle ahead, in pieces of equal length: parts of their tracks."""

import numpy as np
import pandas as pd
from jaxtyping import Float

from rearl_jax.config.data import DataConfig
from rearl_jax.data.checks.leaders import leader_rows
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.data.vehicle_rows import ABSENT
from rearl_jax.export.platoon import STEPS_PER_SECOND
from rearl_jax.problems import InvalidInputError, Problem


def leader_speeds(data: DataConfig, n_leaders: int, seconds: int) -> Float[np.ndarray, "steps leaders"]:
    """Speeds of vehicles without a leader [m/s], `n_leaders` pieces of some seconds at the clock of the simulations.

    Long tracks are cut into several pieces; the chosen pieces are spread evenly over all pieces.

    Raises:
        InvalidInputError: The recordings have fewer pieces.
    """
    pieces = [
        piece
        for recording in iterate_recordings(data)
        for piece in _pieces(recording.table, recording.info.frame_rate, seconds)
    ]
    if len(pieces) < n_leaders:
        message = (
            f"must be at most {len(pieces)}: the recordings have no more vehicles without a leader for {seconds} s"
        )
        raise InvalidInputError(Problem("leaders-too-few", message, key="export.n_leaders", value=n_leaders))
    chosen = np.linspace(0, len(pieces) - 1, n_leaders).round().astype(int)
    return np.stack([pieces[number] for number in chosen], axis=1)


def _pieces(table: pd.DataFrame, frame_rate: float, seconds: int) -> list[Float[np.ndarray, " steps"]]:
    """Consecutive pieces of the tracks without a leader in one recording, neither a stated one nor one in the lane."""
    has_leader = table["leader_id"].notna() | (leader_rows(table) != ABSENT)
    alone = ~has_leader.groupby(table["track_id"]).transform("any")
    pieces = []
    for _, track in table.loc[alone].groupby("track_id"):
        frame = track["frame"].to_numpy()
        pieces += pieces_at_clock((frame - frame[0]) / frame_rate, track["speed"].to_numpy(), seconds)
    return pieces


def pieces_at_clock(
    time: Float[np.ndarray, " frames"], values: Float[np.ndarray, " frames"], seconds: int
) -> list[Float[np.ndarray, " steps"]]:
    """Consecutive pieces of a series, interpolated at the clock of the simulations; a shorter rest is left out.

    Args:
        time: Times of the values, from 0 [s].
        values: The series.
        seconds: Length of each piece [s].
    """
    clock = np.arange(0, time[-1] + 1e-9, 1 / STEPS_PER_SECOND)
    at_clock, n_steps = np.interp(clock, time, values), seconds * STEPS_PER_SECOND + 1
    return [at_clock[start : start + n_steps] for start in range(0, len(clock) - n_steps + 1, n_steps)]
