"""The verdict in sentences. `driver` is the car-following model of the configuration."""

from collections.abc import Mapping, Sequence
from typing import Any

from rearl_jax.core.effects import EFFECTS
from rearl_jax.discovery.lane_changes.candidates import LANE_CHOICE_DEPENDENCE
from rearl_jax.discovery.report.protocols import IN_SAMPLE, PROTOCOLS
from rearl_jax.document.table import spoken


def verdict_words(verdict: Mapping[str, Any]) -> str:
    """The verdict in one line, or a line per group. It names the car-following model if it differs from that of
    `driver`, then the missing effects, then findings on lane choice.
    """
    if len(verdict.get("groups", ())) > 1:
        return "; ".join(f"{row['value']}: {verdict_words(row)}" for row in verdict["groups"])
    following = [effect for effect in verdict["effects"] if not is_lane_choice(effect)]
    lanes = [effect for effect in verdict["effects"] if is_lane_choice(effect)]
    findings = [base_words(verdict["base"])] if verdict.get("base") and verdict["base"]["differs"] else []
    if following or not lanes or verdict["verdict"] == "unexplained":
        findings.append(_following_words(verdict["verdict"], following))
        tests = dict.fromkeys(spoken(failed["test"]) for failed in verdict.get("failed_tests", ()))
        if verdict["verdict"] == "unexplained" and tests:
            findings[-1] += f" (failed tests: {', '.join(tests)})"
    if lanes:
        findings.append(f"missing in lane choice: {_names(lanes)}")
    return "; ".join(findings)


def _following_words(word: str, effects: Sequence[Mapping[str, Any]]) -> str:
    if word == "named" and not effects:
        return "the given effect was fitted, and no other was searched for"  # with `discover.oracle`
    if word == "named":
        return f"missing in the model: {_names(effects)}"
    if word == "artefact":
        return f"fault of the measurement: {_names(effects)}"
    if word == "improved":
        return "other drivers are predicted better with " + (_names(effects) or "a curve without a name")
    if word == "unexplained":
        variables = sorted({name for effect in effects for name in effect["variables"]})
        return f"unexplained, depends on {', '.join(variables)}" if variables else "unexplained"
    return "nothing significant is missing"


def base_words(base: Mapping[str, Any]) -> str:
    """Sentence on the difference between the model of `driver` and the chosen model; empty if they are equal."""
    if not base["differs"]:
        return ""
    (gain,) = (row["gain"] for row in base["compared"] if row["name"] == base["chosen"])
    return (
        f"the car-following model {spoken(base['chosen'])} predicts better than {spoken(base['driver'])}, "
        f"{with_interval(gain, '+.0f')} nats on {base['drivers']['checked']} other drivers"
    )


def _names(effects: Sequence[Mapping[str, Any]]) -> str:
    return " and ".join(described(effect) + _dependence(effect) for effect in effects)


def _dependence(effect: Mapping[str, Any]) -> str:
    """Phrase on car-following models under which an effect is not found."""
    models = effect.get("depends_on_base")
    return (
        f" (depends on the car-following model: not found with {' and '.join(map(spoken, models))})" if models else ""
    )


def is_lane_choice(row: Mapping[str, Any]) -> bool:
    """True if an effect or candidate of a verdict acts on lane choice, not on car following."""
    name = row["name"]
    return name == LANE_CHOICE_DEPENDENCE or (name in EFFECTS and EFFECTS[name].kind == "lane_change")


def lane_choice_words(lanes: Mapping[str, Any]) -> str:
    """Sentence on the data about lane choice, and on the improvement of predictions for other drivers."""
    text, loss = f"{lanes['changes']} changes by choice in {lanes['opportunities']} opportunities", lanes["loss"]
    if loss is None or loss["after"] == loss["before"]:
        return text
    return (
        f"{text}; log-loss of other drivers' choices {loss['before']:.4f} before, {loss['after']:.4f} after, "
        f"change {with_interval(loss['change'], '+.4f')} nats"
    )


def is_claimed(row: Mapping[str, Any], verdict: Mapping[str, Any]) -> bool:
    """True if a candidate is among the effects."""
    claimed = [(effect["name"], *effect["variables"]) for effect in verdict["effects"]]
    return (row["name"], *row["variables"]) in claimed


def described(effect: Mapping[str, Any]) -> str:
    """Readable name of an effect."""
    name = effect["name"].replace("_", " ")
    if effect["kind"] == "generic":
        name = f"{name} on {', '.join(effect['variables'])}"
    return f"{name} ({effect['group']})" if "group" in effect else name


def with_unit(name: str, unit: str) -> str:
    """Readable name of a parameter with its unit, if it has one."""
    return spoken(name) if unit == "-" else f"{spoken(name)} [{unit}]"


def error_words(error: Mapping[str, Any]) -> str:
    """Sentence on the closed-loop gap error before and after, with intervals, and on the error from noise alone."""
    words = f"closed-loop gap error of {error['n_drivers']} other drivers, {PROTOCOLS[IN_SAMPLE]}: "
    words += f"{with_interval(error['before'], '.2f')} m"
    if _is_changed(error):
        after, change = with_interval(error["after"], ".2f"), with_interval(error["change"], "+.2f")
        words += f" before, {after} m after, change {change} m"
    if error["oracle"] is not None:
        words += f", {with_interval(error['oracle'], '.2f')} m for the oracle"
    return f"{words}; drivers' own noise alone gives {with_interval(error['noise_alone'], '.2f')} m"


def share_words(error: Mapping[str, Any]) -> str:
    """Sentence on the explained share of the removable error; empty without added effects or if it is unknown."""
    share = error["explained_share"]
    if share is None or not _is_changed(error):
        return ""
    return f" That is {100 * share:.0f} % of the squared error beyond the drivers' own noise."


def response_words(error: Mapping[str, Any]) -> str:
    """Sentence on response times before and after; empty if none is identified."""
    times = error["response_time"]
    models = ("before", "after") if _is_changed(error) else ("before",)
    figures = [f"{with_interval(times[model], '+.2f', ' s')} {model}" for model in models if times[model] is not None]
    return f" Response time beyond the model's: {', '.join(figures)}." if figures else ""


def with_interval(figure: Mapping[str, Any], form: str, unit: str = "") -> str:
    """A figure of the verdict with its interval, such as 1.2 (1.0 to 1.4); `form` is that of every number."""
    value, low, high = (format(figure[name], form) for name in ("value", "low", "high"))
    return f"{value}{unit} ({low} to {high})"


def _is_changed(error: Mapping[str, Any]) -> bool:
    return error["after"] is not None and error["after"]["value"] != error["before"]["value"]
