"""What is left for decisions on better traffic, as sentences computed from the figures alone."""

import numpy as np
import pandas as pd

from rearl_jax.config.decision import PolicyName
from rearl_jax.config.evaluation import EvaluationConfig
from rearl_jax.evaluation.scores import REAL_VS_REAL
from rearl_jax.evaluation.tables import HEADINGS
from rearl_jax.study.budget.figures import figures_of
from rearl_jax.study.findings import Difference
from rearl_jax.study.traffic.tables import PREFIX, TITLES_OF_KINDS, TITLES_OF_POLICIES, name_of, scene_figures


def findings_of(rows: pd.DataFrame, eval: EvaluationConfig, mape: str) -> list[str]:
    """One paragraph per error: what REARL changes on every kind of traffic, and what choosing actions adds to keeping
    speed and lane.

    Args:
        rows: Scene by scene, see `rows`.
        eval: Resamples, confidence and seed of the intervals.
        mape: The spacing error that decides.
    """
    return [_paragraph(rows, figure, eval) for figure in ("h", mape)]


def _paragraph(rows: pd.DataFrame, figure: str, eval: EvaluationConfig) -> str:
    of_rows, asked, changed = (scene_figures(rows, name) for name in (figure, "interventions", "changes"))
    sentences, best = [], None
    for kind, title in TITLES_OF_KINDS.items():
        alone = of_rows.get(name_of(kind, None))
        if alone is None:
            continue
        policies = [policy for policy in TITLES_OF_POLICIES if policy is not None and name_of(kind, policy) in of_rows]
        parts = []
        for policy in policies:
            name = name_of(kind, policy)
            change = _difference(of_rows[name], alone, eval)
            rates = f"{np.nanmean(asked[name]):.1f} interventions per vehicle and minute"
            if policy is not PolicyName.idle:
                rates += f", {np.nanmean(changed[name]):.1f} of them changing speed or lane"
            parts.append(f"{TITLES_OF_POLICIES[policy]} {change} ({rates})")
        sentences.append(f"{title} {np.nanmean(alone):.3f}" + (f", {'; '.join(parts)}" if parts else ""))
        best = (kind, title, policies)
    text = f"{HEADINGS[figure]} without REARL and its changes: {'. '.join(sentences)}."
    real = of_rows.get(PREFIX + REAL_VS_REAL)
    if real is not None and np.isfinite(real).any():
        text += f" Between two recorded scenes it is {np.nanmean(real):.3f}."
    if best is None or not {PolicyName.idle, PolicyName.matcher} <= set(best[2]):
        return text
    return f"{text} {_left(of_rows, best[0], best[1], eval)}"


def _left(of_rows: dict[str, np.ndarray], kind: str, title: str, eval: EvaluationConfig) -> str:
    """What choices add to keeping speed and lane on the best traffic."""
    gain = _difference(of_rows[name_of(kind, PolicyName.matcher)], of_rows[name_of(kind, PolicyName.idle)], eval)
    if gain.sign < 0:
        end = "so choices still gain there"
    elif gain.sign > 0:
        end = "so choices do worse there than keeping speed and lane"
    else:
        end = "which cannot be distinguished from nothing: no choice is shown to be left there"
    return f"On the last of these ({title}) the matcher differs from idle by {gain}, {end}."


def _difference(first: np.ndarray, second: np.ndarray, eval: EvaluationConfig) -> Difference:
    """Mean difference over scenes, with its interval."""
    ((value, low, high),) = figures_of([first - second], eval)
    return Difference(value, low, high)
