"""Sentences on the use of decisions on improved traffic, of the kinds in `tables`, computed from the figures alone."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from rearl_jax.config.decision import PolicyName
from rearl_jax.config.evaluation import EvaluationConfig
from rearl_jax.evaluation.estimates import means_with_intervals
from rearl_jax.evaluation.scores import REAL_VS_REAL
from rearl_jax.evaluation.tables import HEADINGS
from rearl_jax.study.budget.figures import scene_figures
from rearl_jax.study.findings import Difference
from rearl_jax.study.traffic.tables import PREFIX, TITLES_OF_POLICIES, name_of, titles_of_kinds


def findings_of(rows: pd.DataFrame, eval: EvaluationConfig, mape: str, *, has_found: bool) -> list[str]:
    """A paragraph for each of the two main errors, and the matcher's interventions on the first and the last traffic.

    Args:
        rows: Figures of the rows of `table1.traffic`, scene by scene.
        eval: Resamples, confidence and seed of the intervals.
        mape: The spacing error that decides.
        has_found: Whether the drivers have effects that discovery found.
    """
    titles = titles_of_kinds(has_found=has_found)
    paragraphs = [_paragraph(scene_figures(rows, figure), HEADINGS[figure], titles, eval) for figure in ("h", mape)]
    interventions, changes = scene_figures(rows, "interventions"), scene_figures(rows, "changes")
    kinds = [kind for kind in titles if name_of(kind, PolicyName.matcher) in interventions]
    parts = []
    for kind in dict.fromkeys((*kinds[:1], *kinds[-1:])):
        name = name_of(kind, PolicyName.matcher)
        rates = f"{np.nanmean(interventions[name]):.1f}", f"{np.nanmean(changes[name]):.1f}"
        parts.append(f"{rates[0]} ({titles[kind]}), {rates[1]} of them changing speed or lane")
    if parts:
        paragraphs.append(f"Interventions of the matcher per vehicle and minute: {'; '.join(parts)}.")
    return paragraphs


def _paragraph(
    of_rows: Mapping[str, np.ndarray], heading: str, titles: Mapping[str, str], eval: EvaluationConfig
) -> str:
    """Paragraph on the change by REARL on every kind of traffic, and on the last kind."""
    parts, last_kind = [], None
    for kind, title in titles.items():
        alone = of_rows.get(name_of(kind, None))
        if alone is None:
            continue
        changes = {
            policy: _difference(of_rows[name_of(kind, policy)], alone, eval)
            for policy in TITLES_OF_POLICIES
            if policy is not None and name_of(kind, policy) in of_rows
        }
        text = "; ".join(f"{TITLES_OF_POLICIES[policy]} {change}" for policy, change in changes.items())
        parts.append(f"{title} {np.nanmean(alone):.3f}" + (f" ({text})" if text else ""))
        last_kind = kind, changes.get(PolicyName.matcher)
    text = f"{heading} without REARL, and how REARL changes it: {'; '.join(parts)}."
    real = of_rows.get(PREFIX + REAL_VS_REAL)
    if real is not None and np.isfinite(real).any():
        text += f" Between two recorded scenes it is {np.nanmean(real):.3f}."
    kind, change = ("", None) if last_kind is None else last_kind
    if change is None:
        return text
    choices = _difference(of_rows[name_of(kind, PolicyName.matcher)], of_rows[name_of(kind, PolicyName.idle)], eval)
    return f"{text} On the last traffic, {titles[kind]}, {_use_of_decisions(change, choices)}."


def _use_of_decisions(change: Difference, choices: Difference) -> str:
    """Sentence on the use of decisions on the last kind of traffic.

    `change` is the matcher less traffic without REARL, `choices` the matcher less idle.
    """
    comparison = {
        -1: "its choices are closer than",
        0: "its choices are not distinguished from",
        1: "its choices are farther than",
    }
    idle = f"{comparison[choices.sign]} keeping speed and lane ({choices})"
    if change.sign > 0:
        return f"the matcher moves the traffic away from the recording, so its decisions are of no use here; {idle}"
    if change.sign == 0:
        return f"the matcher is not distinguished from traffic without REARL, so no use of decisions is shown; {idle}"
    return f"the matcher still brings traffic closer to the recording; {idle}"


def _difference(first: np.ndarray, second: np.ndarray, eval: EvaluationConfig) -> Difference:
    """Mean difference over scenes, with its interval."""
    return Difference(*means_with_intervals([first - second], eval)[0])
