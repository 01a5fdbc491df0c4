"""What a training of PPO says: some updates of its learning curve, and how to evaluate the weights."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.config import TrainPpoTask
from rearl_jax.decision.situation import ACTION_NAMES
from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import Cell, Row, Table

_ROWS = 10
"""Updates shown; the file has all."""


def document_of(config: TrainPpoTask, curve: pd.DataFrame, summary: Mapping[str, Any], weights: str) -> Document:
    """The document of a training.

    Args:
        config: The task.
        curve: The table `curve.parquet`.
        summary: The figures of `summary.json`.
        weights: File of the weights.
    """
    names = ("crashed", "speed", *ACTION_NAMES)
    updates = np.unique(np.linspace(0, len(curve) - 1, _ROWS).round().astype(int))
    rows = tuple(
        Row(
            f"{update['car_steps']:,}",
            (Cell(f"{update['return']:.2f}"), *(Cell(f"{update[name]:.3f}") for name in names)),
        )
        for update in curve.iloc[updates].to_dict("records")
    )
    title = f"ppo by vehicle-seconds, {len(curve)} updates of {config.ppo.batch(config.core.n_vehicles):,}"
    notes = [
        f"return: rewards of a vehicle until it crashes, {config.ppo.horizon} at most; actions are drawn while "
        "training, an evaluation takes the likeliest"
    ]
    if (rate := summary["car_steps_per_s"]) is not None:
        notes.append(
            f"trained for {summary['seconds']:.0f} s, {rate:,.0f} vehicle-seconds per second; compiled in "
            f"{summary['compile_s']:.0f} s"
        )
    notes.append(f"to evaluate it: rearl evaluate method=ppo ppo.weights={weights}")
    return Document(
        title="Training of PPO",
        verdict=f"From the first to the last of {len(curve)} updates the return of a vehicle went from "
        f"{summary['return_first']:.2f} to {summary['return_last']:.2f}.",
        sections=(
            Section(
                "Learning curve",
                tables=(Table(title, ("return", "crashed", "speed, m/s", *ACTION_NAMES), rows),),
                notes=tuple(notes),
            ),
        ),
        command="train ppo",
        generated=False,
    )
