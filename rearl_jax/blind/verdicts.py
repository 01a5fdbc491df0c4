"""Records of discovery's verdicts, read from verdict.json."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

NOTHING, IMPROVED, UNEXPLAINED, FAILED = "nothing", "improved", "unexplained", "failed"

ERRORS = ("before", "after", "change", "floor", "oracle")
"""Keys of the closed-loop error in a verdict: before and after the model was repaired, their difference, the error that
measurement noise alone causes, and the error of the model with the true effect.
"""


@dataclass(frozen=True)
class Interval:
    """A figure and its interval; the bounds are None without one."""

    value: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class NamedEffect:
    """An effect a verdict claims.

    Attributes:
        name: Name of a library effect or an artefact.
        kind: `artefact` for measurement faults, `generic` for a dependence without a library effect, else the kind of
            effect.
        parameters: Parameters by name.
        variables: Variables that a generic effect depends on.
        confidence: Stated probability that the effect is present; None if not stated.
    """

    name: str
    kind: str
    parameters: Mapping[str, Interval]
    variables: frozenset[str]
    confidence: float | None


@dataclass(frozen=True)
class Verdict:
    """A verdict.

    Attributes:
        verdict: `named`, `improved`, `artefact`, `unexplained`, `nothing`; `failed` if discovery stopped with an error.
        effects: Claimed effects, the strongest first.
        alternatives: Names of candidates that explain the data about as well as the claimed effects.
        errors: ERRORS of the simulation behind the measured leader, `change` driver by driver; None if unknown.
        n_drivers: Drivers the error was measured on.
        seconds: Computation time [s].
        message: Message of the error that stopped discovery.
    """

    verdict: str
    effects: tuple[NamedEffect, ...]
    alternatives: frozenset[str]
    errors: Mapping[str, Interval | None]
    n_drivers: int | None
    seconds: float | None
    message: str = ""


def read_verdict(stored: Mapping[str, Any]) -> Verdict:
    """The record of a verdict.json.

    Raises:
        ValueError: A key is missing or has a value of the wrong type.
    """
    try:
        effects = tuple(_effect(item) for item in stored["effects"])
        error = stored["error"] or {}
        return Verdict(
            verdict=str(stored["verdict"]),
            effects=effects,
            alternatives=frozenset(item["name"] for item in stored["candidates"] if item.get("ambiguous", False)),
            errors={name: _interval(error.get(name)) for name in ERRORS},
            n_drivers=error.get("n_drivers"),
            seconds=stored["seconds"],
            message=str(stored.get("message", "")),
        )
    except (KeyError, TypeError, AttributeError) as missing:
        raise ValueError(f"a verdict must have verdict, effects, candidates, error, seconds: {missing!r}") from missing


def failed_verdict(message: str, seconds: float) -> dict[str, Any]:
    """The verdict of a discovery that stopped with an error."""
    nothing: dict[str, Any] = {"effects": [], "candidates": [], "error": None, "data": None}
    return {"verdict": FAILED, **nothing, "seconds": seconds, "message": message}


def _effect(item: Mapping[str, Any]) -> NamedEffect:
    parameters = {name: _interval(value) for name, value in item["parameters"].items()}
    return NamedEffect(
        name=item["name"],
        kind=item["kind"],
        parameters={name: value for name, value in parameters.items() if value is not None},
        variables=frozenset(item.get("variables") or ()),
        confidence=item.get("confidence"),
    )


def _interval(value: Any) -> Interval | None:
    """The interval of a number, or of `value`, `low`, `high`."""
    if value is None:
        return None
    if isinstance(value, Mapping):
        return None if value["value"] is None else Interval(value["value"], value.get("low"), value.get("high"))
    return Interval(float(value), None, None) if isinstance(value, (int, float)) else None
