"""One HTML page that a person reads in two minutes: what was missing, how we know, what it changes, how sure."""

from collections.abc import Mapping
from typing import Any

from rearl_jax.config import DiscoverTask
from rearl_jax.discovery.report.words import (
    described,
    effect_words,
    error_words,
    is_claimed,
    is_lane_choice,
    lane_choice_words,
    verdict_words,
)
from rearl_jax.discovery.search.atlas import Atlas
from rearl_jax.discovery.search.finder import Selected
from rearl_jax.discovery.search.reactions import title_of
from rearl_jax.discovery.thresholds import THRESHOLDS, meanings
from rearl_jax.evaluation.layout import render_page

CANDIDATES, VARIABLES = 8, 5
"""Rows of the tables."""

MEASURES = {
    "gap_rmse": ("closed-loop gap error", "m"),
    "speed_rmse": ("closed-loop speed error", "m/s"),
    "one_step": ("error in predicting the next position", "m"),
    "energy_score": ("energy score of noisy simulations", "m"),
}
"""Measures of the verdict that are shown, with their titles and units."""

CAPTIONS = {
    "maps": "Acceleration that the model leaves, as a function of what a driver or a road could react to, drivers' own "
    "means and parameters taken out; bands from resampling drivers. Red: calibrated model. Blue: with what was added. "
    "Dotted: what was added. Flat within the band means nothing is left to see.",
    "planes": "The same over two variables. Grey: too few moments.",
    "evidence": "Evidence of the candidates. Grey: what chance makes of it where nothing is missing, up to the "
    "threshold. A candidate is believed if it gains where it was fitted and on other drivers.",
    "closed_loop": "Gap error of each report driver, simulated behind its measured leader, before and after, and the "
    "error that the drivers' own noise makes where the model is right.",
    "innovations": "What the observer fails to predict: of a right model it is white and normal.",
    "example": "One report driver: gap measured and simulated with the parameters that predict best from one moment to "
    "the next; below, the acceleration that the model leaves.",
    "parameters": "Own parameters of the fitted drivers (squares: trucks), lines: medians. What is missing from a "
    "model pulls them away from their values.",
}


def write_page(
    config: DiscoverTask,
    verdict: Mapping[str, Any],
    atlases: Mapping[str, Atlas],
    figures: Mapping[str, bytes],
    sources: list[dict[str, object]],
) -> str:
    """HTML text.

    Args:
        config: The task.
        verdict: As in verdict.json.
        atlases: `before`, and `after` where something was added.
        figures: PNG files by name.
        sources: Data sets as of `layout.data_sources`.
    """
    data, word = verdict["data"], verdict_words(verdict)
    drivers = data["drivers"]
    return render_page(
        "page.html.j2",
        package="rearl_jax.discovery.report",
        words="discover",
        config=config,
        figures=figures,
        captions=CAPTIONS,
        data_id=data["id"],
        title="What the traffic model lacks",
        generated=data["generated"],
        verdict=word[:1].upper() + word[1:],
        effects=[effect_words(effect) for effect in verdict["effects"]],
        findings=data["findings"],
        change=_sentence(error_words(verdict["error"])) + _explained(verdict["error"]),
        errors=_errors(verdict["error"]),
        how=_how(verdict),
        candidates=_candidates(verdict, of_lanes=False)[:CANDIDATES],
        lane_choice=_sentence(lane_choice_words(verdict["lane_choice"])),
        lane_candidates=_candidates(verdict, of_lanes=True),
        finder=_finder(atlases),
        variables=[_variable(one, atlases["before"]) for one in _shown(atlases["before"])],
        doubts=_doubts(verdict, atlases),
        unseen=[_least(row) for row in verdict["unseen"]],
        thresholds=_thresholds(verdict),
        definitions=_definitions(verdict, config),
        data={
            "summary": f"{data['recordings']} recordings, {data['driver_seconds'] / 60:.0f} driver-minutes of "
            f"{sum(drivers.values())} drivers who follow somebody, one moment every {data['step']:.2g} s, positions "
            f"with {data['position_noise']:.2f} m of noise. {' '.join(_sentence(note) for note in data['notes'])}",
            "sources": sources,
        },
    )


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:].rstrip(".") + "."


def _explained(error: Mapping[str, Any]) -> str:
    share = error["explained_share"]
    if share is None or error["after"] is None or error["after"]["value"] == error["before"]["value"]:
        return ""
    return f" That is {100 * share:.0f} % of the squared error beyond the drivers' own noise."


def _errors(error: Mapping[str, Any]) -> list[dict[str, Any]]:
    rows = []
    for name, (title, unit) in MEASURES.items():
        found = error["all"][name]
        cells = [_cell(found[column], "+" if column == "change" else "") for column in ("before", "after", "change")]
        rows.append({"title": f"{title} [{unit}]", "cells": cells})
    own = {"title": "the drivers' own noise alone makes [m]", "cells": [_cell(error["floor"]), *[_NOTHING] * 2]}
    return [rows[0], own, *rows[1:]]


_NOTHING = {"figure": "", "interval": ""}


def _cell(value: Mapping[str, float], sign: str = "") -> dict[str, str]:
    return {
        "figure": f"{value['value']:{sign}.2f}",
        "interval": f"{value['low']:{sign}.2f} to {value['high']:{sign}.2f}",
    }


def _how(verdict: Mapping[str, Any]) -> str:
    drivers = verdict["data"]["drivers"]
    return (
        f"Every driver of a first group ({drivers['fitted']}) was calibrated, with the car-following model "
        f"{verdict['data'].get('car_following', 'idm')}. What the model then fails to predict was "
        "compared with what each candidate would leave behind, and with what is left where nothing is missing. "
        "Candidates that stand out were fitted and had to gain on a second group "
        f"({drivers['checked']}). The errors above are those of a third one ({drivers['reported']}), "
        "which took no part."
    )


def _candidates(verdict: Mapping[str, Any], *, of_lanes: bool) -> list[dict[str, str]]:
    return [_candidate(row, verdict) for row in verdict["candidates"] if is_lane_choice(row) == of_lanes]


def _candidate(row: Mapping[str, Any], verdict: Mapping[str, Any]) -> dict[str, str]:
    mark = "not told apart" if row["ambiguous"] else "added" if is_claimed(row, verdict) else ""
    figures = {name: "-" if row[name] is None else f"{row[name]:.1f}" for name in ("surprise", "gain", "check")}
    return {"title": described(row), "mark": mark, **figures}


def _shown(atlas: Atlas) -> list[Selected]:
    by_gain = sorted(atlas.selected, key=lambda one: (-one.frequency, -atlas.curves[one.variable].gain))
    return by_gain[:VARIABLES]


def _variable(one: Selected, atlas: Atlas) -> dict[str, str]:
    curve = atlas.curves[one.variable]
    words = atlas.shapes[one.variable] + ("; as a time gap it carries further" if curve.acts_on == "time_gap" else "")
    return {
        "title": title_of(one.variable),
        "selected": f"{100 * one.frequency:.0f} %",
        "share": f"{100 * max(curve.share, 0.0):.0f}",
        "words": words,
    }


def _finder(atlases: Mapping[str, Atlas]) -> str:
    stable = {model: _stable(atlas) for model, atlas in atlases.items()}
    text = "Without any list of effects, sparse regression over curves of every variable "
    text += f"finds that the residual depends on {stable['before']}." if stable["before"] else "finds nothing."
    if "after" in stable:
        text += f" After the repair {'it still finds ' + stable['after'] if stable['after'] else 'it finds nothing'}."
    return text


def _stable(atlas: Atlas) -> str:
    return ", ".join(title_of(one.variable) for one in atlas.selected if one.frequency >= THRESHOLDS.stable_share)


def _doubts(verdict: Mapping[str, Any], atlases: Mapping[str, Atlas]) -> list[str]:
    lines = [
        f"{_sentence(described(effect))[:-1]}: confidence {effect['confidence']:.2f}, if it is one of the "
        "candidates at all."
        for effect in verdict["effects"]
    ]
    for row in verdict["candidates"]:
        if row["ambiguous"]:
            lines.append(
                f"{_sentence(described(row))[:-1]} explains the data as well. To tell them apart: "
                f"{row['told_apart_by']}."
            )
    left = verdict["adequacy"]
    if left is not None:
        name = left["remaining"]["name"].replace("_", " ").replace(".", " on ")
        lines.append(
            f"Left behind: innovations one moment apart correlate by {left['autocorrelation']:+.3f}, their excess "
            f"kurtosis is {left['kurtosis']:+.2f} (both 0 for a right model); the most surprising candidate left is "
            f"{name} at {left['remaining']['surprise']:.1f} σ."
        )
    best = max(atlases["after" if "after" in atlases else "before"].curves.values(), key=lambda one: one.gain)
    lines.append(
        f"What any one variable still predicts of the acceleration that is left, on other drivers: at most "
        f"{100 * max(best.share, 0.0):.0f} % ({best.basis.variable.title})."
    )
    return lines


def _thresholds(verdict: Mapping[str, Any]) -> list[dict[str, str]]:
    """Thresholds of a verdict with their meanings; none where it does not hold them."""
    texts = meanings()
    return [
        {"title": name.replace("_", " "), "figure": f"{value:g}", "words": texts.get(name, "")}
        for name, value in verdict.get("thresholds", {}).items()
    ]


def _least(row: Mapping[str, Any]) -> dict[str, str]:
    unit = "" if row["unit"] == "-" else f" {row['unit']}"
    return {
        "title": row["name"].replace("_", " "),
        "figure": f"{row['parameter'].replace('_', ' ')} {row['strength']:.2g}{unit}",
    }


def _definitions(verdict: Mapping[str, Any], config: DiscoverTask) -> list[str]:
    percent = f"{100 * config.discover.confidence:g} %"
    return [
        "Closed-loop gap error: the driver, with the own parameters that fit its gap best, is simulated behind the "
        "measured leader; root mean square over moments and drivers.",
        f"Intervals: {percent}, from resampling drivers.",
        "Surprise: evidence above its mean where nothing is missing, in standard deviations of that; in the choice of "
        "the lane, the slope of the likelihood in standard deviations between drivers.",
        "Gain: log-likelihood of the fitted drivers less the price of freedom; on others: that of drivers whose own "
        "parameters alone were fitted anew.",
        f"Selected: share of random halves of the drivers in which sparse regression takes the variable in; from "
        f"{100 * THRESHOLDS.stable_share:.0f} % on it is taken to matter.",
        "Share: of the variance of the acceleration left, on drivers the curve was not fitted to.",
    ]
