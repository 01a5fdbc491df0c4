"""A repaired model side by side: base and rearl, each on the calibrated drivers without and with the effects.

All four rows start from the same initial states, with the same quantiles of drivers and the same thresholds, so that
the number of interventions can be compared.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pandas as pd

from rearl_jax.baselines.critical.mixture import Mixture
from rearl_jax.config import EvaluateTask
from rearl_jax.config.evaluation import Method, Variant
from rearl_jax.data.scene_set import SceneSet
from rearl_jax.detection.references import References
from rearl_jax.evaluation.extras import Extra, Figures
from rearl_jax.evaluation.interventions import DecisionLog, decision_table, intervention_figures, intervention_note
from rearl_jax.evaluation.outside import MakePolicy
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.runner import Evaluation, example_scene, make_scorer, reference_rows, simulated_row
from rearl_jax.evaluation.scores import REAL, WITH_EFFECT, title_of, with_realism
from rearl_jax.evaluation.simulators import NEVER
from rearl_jax.evaluation.traffic import WITH_MODEL

_ROWS = tuple((method, variant) for method in WITH_MODEL for variant in (Variant.calibrated, Variant.repaired))

_SECONDS_PER_MINUTE = 60


def compares_variants(config: EvaluateTask) -> bool:
    """Whether base and rearl are evaluated without and with the effects of a model."""
    return config.model is not None and config.variant is Variant.all


def evaluate_variants(
    config: EvaluateTask,
    scenes: SceneSet,
    held_out: np.ndarray,
    progress: Callable[[int, int], None] = lambda done, total: None,
    references: References | None = None,
    thresholds: tuple[float, float] = NEVER,
    outside: MakePolicy | None = None,
    mixture: Mixture | None = None,
) -> Evaluation:
    """The four rows and the reference rows; arguments as of `runner.evaluate`, a mixture means nothing here."""
    scorer, width = make_scorer(config, scenes, config.eval.n_runs * len(held_out))
    example = example_scene(scenes, held_out, config.eval.example)
    rows, logs, sample = [], {}, None
    with ThreadPoolExecutor(1) as beside:
        reference = beside.submit(reference_rows, config, scenes, held_out, scorer)
        for method, variant in _ROWS:
            one = replace(config, method=method, variant=variant)
            rollouts = Rollouts(one, scenes, held_out, references, [thresholds], outside)
            row, sample, log = simulated_row(one, rollouts, scorer, held_out, width, example, progress)
            name = row.row + (WITH_EFFECT if variant is Variant.repaired else "")
            rows.append(replace(row, row=name))
            if log is not None:
                logs[name] = log
        rows += reference.result()
    assert sample is not None  # of the last row
    rows = with_realism(rows, next(row for row in rows if row.row == REAL), config.realism)
    main = f"{Method.rearl.name}{WITH_EFFECT}"
    n_vehicles = config.core.n_vehicles
    figures = {name: intervention_rates(log, n_vehicles) for name, log in logs.items()}
    extra = intervention_extra(scenes.scene_id, logs, config.hist.window, n_vehicles)
    return Evaluation(scenes, held_out, rows, sample, logs[main], (extra,), figures, main)


def intervention_rates(log: DecisionLog, n_vehicles: int) -> Figures:
    """Figures of a row in which was intervened: those of `intervention_figures`, `triggered_seconds` (of all rollouts
    together), `interventions` (seconds in which a vehicle followed an action, summed over vehicles) and
    `interventions_per_vehicle_minute`.
    """
    decisions = log.decisions
    accepted = int(np.sum(decisions.n_accepted, dtype=np.int64))
    vehicle_minutes = decisions.triggered.size * n_vehicles / _SECONDS_PER_MINUTE
    return intervention_figures(log) | {
        "triggered_seconds": int(np.sum(decisions.triggered, dtype=np.int64)),
        "interventions": accepted,
        "interventions_per_vehicle_minute": accepted / vehicle_minutes,
    }


def intervention_extra(scene_id: np.ndarray, logs: dict[str, DecisionLog], window: int, n_vehicles: int) -> Extra:
    """The table of all decisions, with the row under `method`, and one sentence per row.

    Args:
        scene_id: Number of every scene.
        logs: What was detected and decided, by row.
        window: Length of the window of the Hellinger distance [s].
        n_vehicles: Vehicles in each rollout.
    """
    tables, notes = [], []
    for name, log in logs.items():
        table = decision_table(scene_id, log, window)
        table.insert(0, "method", pd.Categorical([name], list(logs)).repeat(len(table)))
        tables.append(table)
        rate = intervention_rates(log, n_vehicles)["interventions_per_vehicle_minute"]
        notes.append(f"{title_of(name)}: {rate:.2f} interventions per vehicle and minute; {intervention_note(log)}")
    return Extra({"decisions": pd.concat(tables, ignore_index=True)}, tuple(notes))
