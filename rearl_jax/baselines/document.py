"""Document of a PPO training: some updates of its learning curve, and the command that evaluates the weights."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from rearl_jax.config import TrainPpoTask
from rearl_jax.decision.situation import ACTION_NAMES
from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import table_of

_SHOWN_UPDATES = 10
"""Number of updates in the table; `curve.parquet` has all updates."""


def document_of(config: TrainPpoTask, curve: pd.DataFrame, summary: Mapping[str, Any], weights: str) -> Document:
    """The document of a training.

    Args:
        config: The task.
        curve: The table `curve.parquet`.
        summary: The figures of `summary.json`.
        weights: File of the weights.
    """
    columns = {"car_steps": "vehicle-seconds", "return": "return", "crashed": "crashed", "speed": "speed [m/s]"}
    shown = np.unique(np.linspace(0, len(curve) - 1, _SHOWN_UPDATES).round().astype(int))
    title = f"PPO: {len(curve)} updates of {config.ppo.batch(config.core.n_vehicles):,} vehicle-seconds each"
    updates = table_of(title, curve.iloc[shown], columns | {name: name for name in ACTION_NAMES})
    notes = [
        f"return: rewards of a vehicle until it crashes, {config.ppo.horizon} at most; actions are drawn in "
        "training, most probable in an evaluation"
    ]
    if (rate := summary["car_steps_per_s"]) is not None:
        notes.append(
            f"trained for {summary['seconds']:.0f} s, {rate:,.0f} vehicle-seconds per second; compiled in "
            f"{summary['compile_s']:.0f} s"
        )
    notes.append(f"command to evaluate the policy: rearl evaluate method=ppo ppo.weights={weights}")
    return Document(
        title="Training of PPO",
        verdict=f"From the first to the last of {len(curve)} updates the return of a vehicle went from "
        f"{summary['return_first']:.2f} to {summary['return_last']:.2f}.",
        sections=(
            Section(
                "Learning curve",
                tables=(updates,),
                notes=tuple(notes),
            ),
        ),
        command="train ppo",
        generated=False,
    )
