"""The verdict in sentences, the same in terminal, page and notes."""

from typing import Any

from rearl_jax.core.effects import EFFECTS


def verdict_words(verdict: dict[str, Any]) -> str:
    """The verdict in one line."""
    names = " and ".join(described(effect) for effect in verdict["effects"])
    word = verdict["verdict"]
    if word == "named":
        return f"missing in the model: {names}"
    if word == "artefact":
        return f"fault of the measurement: {names}"
    if word == "unexplained":
        variables = sorted({name for effect in verdict["effects"] for name in effect["variables"]})
        return f"unexplained, depends on {', '.join(variables)}" if variables else "unexplained"
    return "nothing significant is missing"


def described(effect: dict[str, Any]) -> str:
    """Name of an effect as people say it."""
    name = effect["name"].replace("_", " ")
    return f"{name} on {', '.join(effect['variables'])}" if effect["kind"] == "generic" else name


def effect_words(effect: dict[str, Any]) -> str:
    """An effect with its numbers and how sure it is."""
    numbers = [
        f"{name} {value['value']:.3g}{_range(value)} {value['unit']}".rstrip(" -")
        for name, value in effect["parameters"].items()
    ]
    shown = "; ".join(numbers) if len(numbers) <= 5 else f"a curve through {len(numbers)} values"
    equation = EFFECTS[effect["name"]].equation if effect["name"] in EFFECTS else ""
    parts = [f"{described(effect)}: {shown}", equation, f"confidence {effect['confidence']:.2f}"]
    return "; ".join(part for part in parts if part)


def error_words(error: dict[str, Any]) -> str:
    """Error before and after, with intervals, beside the floor."""

    def figure(value: dict[str, float]) -> str:
        return f"{value['value']:.2f} ({value['low']:.2f} to {value['high']:.2f}) m"

    text = f"closed-loop gap error of {error['n_drivers']} other drivers: {figure(error['before'])}"
    if error["after"] is not None and error["after"]["value"] != error["before"]["value"]:
        change = error["change"]
        text += f" before, {figure(error['after'])} after, change {change['value']:+.2f} "
        text += f"({change['low']:+.2f} to {change['high']:+.2f}) m"
    if error["oracle"] is not None:
        text += f", {figure(error['oracle'])} for the oracle"
    return f"{text}; drivers' own noise alone makes {figure(error['floor'])}"


def _range(value: dict[str, float | None]) -> str:
    return "" if value["low"] is None else f" ({value['low']:.3g} to {value['high']:.3g})"
