"""Detections and decisions of all rollouts, as a table, as keys of the summary and as one sentence."""

from dataclasses import dataclass

import jax
import numpy as np
import pandas as pd
from jaxtyping import Int, Shaped

from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.decision.loop import Decisions
from rearl_jax.decision.situation import ACTION_NAMES
from rearl_jax.evaluation.extras import Extra, Figures
from rearl_jax.evaluation.scores import title_of


@dataclass(frozen=True)
class DecisionLog:
    """Detections and decisions in every rollout of a row.

    Attributes:
        scene: Index of the scene whose initial state a rollout has.
        run: Run of each rollout.
        decisions: Second by second, `[seconds, rollouts]`.
    """

    scene: Int[np.ndarray, " rollouts"]
    run: Int[np.ndarray, " rollouts"]
    decisions: Decisions


def intervention_extra(scenes: SceneSet, log: DecisionLog, window: int) -> Extra:
    """Table, note and keys of the summary; arguments as in `decision_table`."""
    table = decision_table(scenes, log, window)
    return Extra({"decisions": table}, (intervention_note(log),), intervention_figures(log))


def variants_extra(scenes: SceneSet, logs: dict[str, DecisionLog], window: int, n_vehicles: int) -> Extra:
    """Decisions of several rows in one table, whose column `method` names the row, and one sentence per row.

    Arguments as in `decision_table` and `intervention_rates`; the logs are given by row.
    """
    tables, notes = [], []
    for name, log in logs.items():
        table = decision_table(scenes, log, window)
        table.insert(0, "method", pd.Categorical([name], list(logs)).repeat(len(table)))
        tables.append(table)
        rate = intervention_rates(log, n_vehicles)["interventions_per_vehicle_minute"]
        notes.append(f"{title_of(name)}: {rate:.2f} interventions per vehicle and minute; {intervention_note(log)}")
    return Extra({"decisions": pd.concat(tables, ignore_index=True)}, tuple(notes))


def decision_table(scenes: SceneSet, log: DecisionLog, window: int) -> pd.DataFrame:
    """One row per rollout and second: `scene_id`, `run`, `frame` (that of `frames.parquet` at the end of the second);
    results of the detection in this frame: `reference`, `h`, `mape`, `triggered`; counts of vehicles in the second:
    `asked`, the followed actions `left`, `keep`, `right`, `faster`, `slower`, and the rejected answers `inadmissible`,
    `invalid`.

    Args:
        scenes: All scenes.
        log: Detections and decisions of the row.
        window: Length of the window of h [s]; h is missing before the first full one.
    """
    decisions = log.decisions
    n_seconds, n_rollouts = decisions.reference.shape
    # Rollouts among replayed traffic have a frame at the start too, before which no second is simulated.
    frame = np.arange(scenes.seconds - n_seconds, scenes.seconds, dtype=np.int16)
    columns = {
        "scene_id": scenes.scene_id[log.scene].astype(np.int32).repeat(n_seconds),
        "run": log.run.astype(np.int32).repeat(n_seconds),
        "frame": np.tile(frame, n_rollouts),
        "reference": _long(decisions.reference).astype(np.int16),
        "h": pd.arrays.FloatingArray(
            _long(decisions.hellinger).astype(np.float32), np.tile(np.arange(n_seconds) < window - 1, n_rollouts)
        ),
        "mape": _long(decisions.mape).astype(np.float32),
        "triggered": _long(decisions.triggered),
        "asked": _long(decisions.n_asked).astype(np.int16),
    }
    for action, name in enumerate(ACTION_NAMES):
        columns[name] = _long(decisions.n_accepted[:, action]).astype(np.int16)
    for name in ("inadmissible", "invalid"):
        columns[name] = _long(getattr(decisions, f"n_{name}")).astype(np.int16)
    return pd.DataFrame(columns)


def _long(values: Shaped[np.ndarray | jax.Array, "seconds rollouts"]) -> Shaped[np.ndarray, " rows"]:
    """Values as one column, rollout after rollout."""
    return np.asarray(values).T.reshape(-1)


def intervention_figures(log: DecisionLog) -> dict[str, int | float]:
    """Figures of a method that intervenes: `trigger_rate` (share of the seconds of all rollouts in which the detection
    triggered), `decisions` (vehicles asked, summed over seconds), `inadmissible` and `invalid` (answers not followed),
    `main_reference` (the reference at which most rollouts end) and `main_reference_share` (share of these rollouts).
    """
    decisions = log.decisions
    n_ending = np.bincount(np.asarray(decisions.reference)[-1])
    return {
        "trigger_rate": float(np.mean(decisions.triggered, dtype=np.float64)),
        "decisions": int(np.sum(decisions.n_asked, dtype=np.int64)),
        "inadmissible": int(np.sum(decisions.n_inadmissible, dtype=np.int64)),
        "invalid": int(np.sum(decisions.n_invalid, dtype=np.int64)),
        "main_reference": int(n_ending.argmax()),
        "main_reference_share": float(n_ending.max() / n_ending.sum()),
    }


def intervention_rates(log: DecisionLog, n_vehicles: int) -> Figures:
    """Figures of one of several rows with interventions: those of `intervention_figures`, `triggered_seconds` (summed
    over all rollouts), `interventions` (seconds in which a vehicle followed an action, summed over vehicles) and
    `interventions_per_vehicle_minute`.
    """
    decisions = log.decisions
    accepted = int(np.sum(decisions.n_accepted, dtype=np.int64))
    vehicle_minutes = decisions.triggered.size * n_vehicles / 60
    return intervention_figures(log) | {
        "triggered_seconds": int(np.sum(decisions.triggered, dtype=np.int64)),
        "interventions": accepted,
        "interventions_per_vehicle_minute": accepted / vehicle_minutes,
    }


def intervention_note(log: DecisionLog) -> str:
    """One sentence about the interventions."""
    figures = intervention_figures(log)
    n_rollouts = log.decisions.reference.shape[1]
    return (
        f"triggered in {100 * figures['trigger_rate']:.0f} % of the seconds; {figures['decisions']} decisions in "
        f"{n_rollouts} rollouts, {figures['inadmissible']} not admissible, {figures['invalid']} invalid; "
        f"{100 * figures['main_reference_share']:.0f} % of the rollouts end at reference {figures['main_reference']}"
    )
