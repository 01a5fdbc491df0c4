"""The learning curve in the terminal."""

from pathlib import Path

import numpy as np
import pandas as pd

from rearl_jax.baselines.training import Training
from rearl_jax.config import TrainPpoTask
from rearl_jax.console import print_notes, standard_output, titled_table
from rearl_jax.decision.situation import ACTION_NAMES

_WIDTH = 100
"""Columns the table and its notes need."""

_ROWS = 10
"""Updates shown; the file has all."""


def print_curve(config: TrainPpoTask, training: Training, curve: pd.DataFrame, weights: Path) -> None:
    """Prints some updates of the training, the first and the last among them, and what to do with the weights."""
    console = standard_output(_WIDTH)
    table = titled_table(f"ppo, {len(curve)} updates of {config.ppo.batch(config.core.n_vehicles):,} vehicle-seconds")
    headings = ("vehicle-seconds", "return", "crashed", "speed, m/s", *ACTION_NAMES)
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    for number in np.unique(np.linspace(0, len(curve) - 1, _ROWS).round().astype(int)):
        row = curve.iloc[number]
        shares = (f"{row[name]:.3f}" for name in ("crashed", "speed", *ACTION_NAMES))
        table.add_row(f"{int(row['car_steps']):,}", f"{row['return']:.2f}", *shares)
    console.print(table)
    print_notes(console, _notes(config, training, weights))


def _notes(config: TrainPpoTask, training: Training, weights: Path) -> list[str]:
    horizon = config.ppo.horizon
    notes = [
        f"return: rewards of a vehicle until it crashes, {horizon} at most; actions are drawn while training, an "
        "evaluation takes the likeliest"
    ]
    n_trained = len(training.curve.gain) - training.n_before
    if n_trained:
        rate = n_trained * config.ppo.batch(config.core.n_vehicles) / training.seconds
        before = f" after the {training.n_before} that were there" if training.n_before else ""
        notes.append(
            f"{n_trained} updates{before} in {training.seconds:.0f} s, {rate:,.0f} vehicle-seconds per second; "
            f"compiled in {training.compile_s:.0f} s"
        )
    return [*notes, f"to evaluate it: rearl evaluate method=ppo ppo.weights={weights}"]
