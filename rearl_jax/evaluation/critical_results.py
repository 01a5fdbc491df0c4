"""Results of the search for the shares of the driver classes: table, note, figure and keys of the summary."""

import pandas as pd

from rearl_jax.baselines.critical.adaptation import START, Adaptation
from rearl_jax.config import EvaluateTask
from rearl_jax.config.core import InitialSource
from rearl_jax.config.critical import Proposer
from rearl_jax.evaluation.extras import Extra
from rearl_jax.evaluation.language_model import request_counts, request_figures
from rearl_jax.llm.records import Cause
from rearl_jax.metrics import METRICS


def adaptation_extra(config: EvaluateTask, adaptation: Adaptation, n_scenes: int, *, generated: bool) -> Extra:
    """Table of the trials, note, keys of the summary and figure; `n_scenes` counts the threshold scenes."""
    mixture = adaptation.mixture
    summary = {
        **{f"ratio_{name}": share for name, share in mixture._asdict().items()},
        "proposer": adaptation.proposer,
        "rounds": adaptation.n_rounds,
    }
    note = f"drivers: {mixture.written()}; {_origin_note(config, adaptation, n_scenes)}"
    if not adaptation.trials:
        return Extra(notes=(note,), summary=summary)

    def draw() -> bytes:
        from rearl_jax.baselines.critical.figure import draw_adaptation

        return draw_adaptation(adaptation, METRICS[config.mape.column].title, generated=generated)

    return Extra({"rounds": rounds_table(adaptation)}, (note,), summary, {"critical": draw})


def rounds_table(adaptation: Adaptation) -> pd.DataFrame:
    """One row per mixture tried out.

    Columns: `round`, shares `aggressive`, `defensive`, `truck`, mean errors `h` and `mape`, share `crashed`,
    `near_misses` (vehicle-seconds), `n_vehicles`, `proposer`, `attempts`, `cause`, `is_kept`.
    """
    rows = [
        {
            "round": trial.number,
            **trial.mixture._asdict(),
            "h": trial.assessment.h,
            "mape": trial.assessment.mape,
            "crashed": trial.assessment.crashed_share,
            "near_misses": trial.assessment.near_misses,
            "n_vehicles": trial.assessment.n_vehicles,
            "proposer": adaptation.proposer,
            "attempts": trial.attempts,
            "cause": trial.cause,
            "is_kept": number == adaptation.selected,
        }
        for number, trial in enumerate(adaptation.trials)
    ]
    return pd.DataFrame(rows)


def _origin_note(config: EvaluateTask, adaptation: Adaptation, n_scenes: int) -> str:
    """Origin of the shares, and their errors on the threshold scenes."""
    if not adaptation.trials:
        return "set by critical.ratios"
    kept = adaptation.trials[adaptation.selected].assessment
    n_rollouts = kept.n_vehicles // config.core.n_vehicles
    against = "each against its own of" if config.init.source is InitialSource.scene else "against"
    errors = (
        f"{n_rollouts} rollouts {against} {n_scenes} threshold scenes: H {kept.h:.3f}, "
        f"MAPE {config.mape.definition.name} {kept.mape:.3f}"
    )
    if adaptation.proposer == Proposer.stats.name:
        return f"as in the recordings (the same in every round, so proposed and simulated once); {errors}"
    if adaptation.proposer == Proposer.search.name:
        return f"the best of {len(adaptation.trials)} mixtures by H + MAPE; {errors}"
    first = next(trial for trial in adaptation.trials if trial.cause == START).assessment
    return (
        f"the last valid proposal of a language model in {adaptation.n_rounds} rounds; {errors}; at the start "
        f"{first.h:.3f} and {first.mape:.3f}"
    )


def answer_extra(adaptation: Adaptation, requests: pd.DataFrame) -> Extra:
    """Table, note and keys of the summary on the questions to a language model."""
    figures = request_figures(requests)
    failed = [trial.cause for trial in adaptation.trials if trial.cause not in (START, Cause.answered.name)]
    causes = ", ".join(f"{cause} {failed.count(cause)}" for cause in dict.fromkeys(failed)) or "none"
    return Extra({"requests": requests}, (f"{request_counts(figures)}; rounds without new shares: {causes}",), figures)
