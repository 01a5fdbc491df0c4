"""The verdict in sentences."""

from collections.abc import Mapping, Sequence
from typing import Any

from rearl_jax.core.effects import EFFECTS
from rearl_jax.discovery.lane_changes.candidates import LANE_CHOICE_DEPENDENCE


def verdict_words(verdict: Mapping[str, Any]) -> str:
    """The verdict in one line, of each group where there are several: on car following, then on the choice of the lane
    where something was found there.
    """
    if len(verdict.get("groups", ())) > 1:
        return "; ".join(f"{row['value']}: {verdict_words(row)}" for row in verdict["groups"])
    following = [effect for effect in verdict["effects"] if not is_lane_choice(effect)]
    lanes = [effect for effect in verdict["effects"] if is_lane_choice(effect)]
    words = []
    if following or not lanes or verdict["verdict"] == "unexplained":
        words.append(_following_words(verdict["verdict"], following))
    if lanes:
        words.append(f"missing in the choice of the lane: {_names(lanes)}")
    return "; ".join(words)


def _following_words(word: str, effects: Sequence[Mapping[str, Any]]) -> str:
    if word == "named" and not effects:
        return "an effect was told, and nothing looked for"  # the oracle
    if word == "named":
        return f"missing in the model: {_names(effects)}"
    if word == "artefact":
        return f"fault of the measurement: {_names(effects)}"
    if word == "unexplained":
        variables = sorted({name for effect in effects for name in effect["variables"]})
        return f"unexplained, depends on {', '.join(variables)}" if variables else "unexplained"
    return "nothing significant is missing"


def _names(effects: Sequence[Mapping[str, Any]]) -> str:
    return " and ".join(described(effect) for effect in effects)


def is_lane_choice(row: Mapping[str, Any]) -> bool:
    """True if an effect or a candidate of a verdict acts on the choice of the lane, not on car following."""
    name = row["name"]
    return name == LANE_CHOICE_DEPENDENCE or (name in EFFECTS and EFFECTS[name].kind == "lane_change")


def lane_choice_words(lanes: Mapping[str, Any]) -> str:
    """Data on the choice of the lane, and how much better other drivers' choices are predicted."""
    text, loss = f"{lanes['changes']} changes by choice in {lanes['opportunities']} opportunities", lanes["loss"]
    if loss is None or loss["after"] == loss["before"]:
        return text
    change = loss["change"]
    return (
        f"{text}; log-loss of other drivers' choices {loss['before']:.4f} before, {loss['after']:.4f} after, "
        f"change {change['value']:+.4f} ({change['low']:+.4f} to {change['high']:+.4f}) nats"
    )


def is_claimed(row: Mapping[str, Any], verdict: Mapping[str, Any]) -> bool:
    """True if a candidate is among the effects."""
    claimed = [(effect["name"], *effect["variables"]) for effect in verdict["effects"]]
    return (row["name"], *row["variables"]) in claimed


def described(effect: Mapping[str, Any]) -> str:
    """Name of an effect as people say it."""
    name = effect["name"].replace("_", " ")
    if effect["kind"] == "generic":
        name = f"{name} on {', '.join(effect['variables'])}"
    return f"{name} ({effect['group']})" if "group" in effect else name


def error_words(error: Mapping[str, Any]) -> str:
    """Closed-loop gap error before and after, with intervals, beside what the drivers' own noise makes."""

    def text(value: Mapping[str, float], sign: str = "") -> str:
        return f"{value['value']:{sign}.2f} ({value['low']:{sign}.2f} to {value['high']:{sign}.2f}) m"

    words = f"closed-loop gap error of {error['n_drivers']} other drivers: {text(error['before'])}"
    if error["after"] is not None and error["after"]["value"] != error["before"]["value"]:
        words += f" before, {text(error['after'])} after, change {text(error['change'], '+')}"
    if error["oracle"] is not None:
        words += f", {text(error['oracle'])} for the oracle"
    return f"{words}; drivers' own noise alone makes {text(error['floor'])}"
