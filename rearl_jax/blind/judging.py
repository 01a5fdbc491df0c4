"""Comparison of a verdict with the truth, the effects (items) hidden in a data set: recognised effects, false names."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rearl_jax.blind.verdicts import FAILED, NOTHING, UNEXPLAINED, Interval, NamedEffect, Verdict

SAME_THING = {"speed_scale": {"position_scale"}, "position_scale": {"speed_scale"}}
"""Equivalent artefacts: speeds too large or positions too small by the same factor."""

DEPENDS_ON = {
    "weather": {"time"},
    "grade": {"position"},
    "speed_limit": {"position"},
    "bend": {"position"},
    "lane_desired_speed": {"lane"},
}
"""Variables of library effects; a hidden effect without a name counts as recognised by its variable."""

OUTCOMES = ("right", "more", "part", "ambiguous", "unexplained", "nothing", "wrong", "failed")
"""Outcomes: all hidden effects named; all named and a false name; one of two named; not named but among the
alternatives; an effect without a name reported; nothing found; only false names; discovery stopped with an error. False
names are also counted separately (`Judgement.false_names`), because they may accompany correct ones.
"""


@dataclass(frozen=True)
class Judgement:
    """Comparison of a verdict with the truth.

    Attributes:
        outcome: One of OUTCOMES; in a control `right` means that nothing was found.
        shown: Column of the confusion matrix: the first name, or the verdict.
        n_hidden, n_recognised: Number of hidden effects, and of those that are named.
        in_set: Whether each hidden effect is named or among the alternatives.
        alone: Whether the effect is named without alternatives.
        is_flagged: Whether the verdict states an unexplained remainder or a generic dependence.
        false_names: Claimed names that are not hidden in the data, also those together with a correct name; a curve
            counts as a name.
        false_kinds: Kinds of the false names.
        claims: Stated confidence of each claimed effect, and whether the claim is correct.
    """

    outcome: str
    shown: str
    n_hidden: int
    n_recognised: int
    in_set: bool
    alone: bool
    is_flagged: bool
    false_names: tuple[str, ...]
    false_kinds: tuple[str, ...]
    claims: tuple[tuple[float, bool], ...]


@dataclass(frozen=True)
class Recovery:
    """A parameter with the same meaning in generator and library."""

    effect: str
    parameter: str
    truth: float
    found: Interval

    @property
    def is_covered(self) -> bool | None:
        """True if the interval contains the true value; None without interval."""
        low, high = self.found.low, self.found.high
        return None if low is None or high is None else low <= self.truth <= high


def judge(truth: Mapping[str, Any], verdict: Verdict) -> Judgement:
    """The judgement on one data set, by its entry in the sealed file."""
    hidden = truth["planted"]
    recognised = [any(is_it(item, effect) for effect in verdict.effects) for item in hidden]
    in_set = [
        is_named or bool(names_of(item) & verdict.alternatives)
        for item, is_named in zip(hidden, recognised, strict=True)
    ]
    false = [effect for effect in verdict.effects if not any(is_it(item, effect) for item in hidden)]
    is_flagged = verdict.verdict == UNEXPLAINED or any(effect.kind == "generic" for effect in verdict.effects)
    return Judgement(
        outcome=_outcome(hidden, verdict, recognised, all(in_set), bool(false), is_flagged),
        shown=shown_of(verdict, sum(recognised), is_flagged),
        n_hidden=len(hidden),
        n_recognised=sum(recognised),
        in_set=all(in_set),
        alone=is_alone(hidden, verdict, sum(recognised)),
        is_flagged=is_flagged,
        false_names=tuple(effect.name for effect in false),
        false_kinds=tuple(effect.kind for effect in false),
        claims=tuple(
            (effect.confidence, effect not in false) for effect in verdict.effects if effect.confidence is not None
        ),
    )


def shown_of(verdict: Verdict, n_recognised: int, is_flagged: bool) -> str:
    """The column of a verdict in the confusion matrix."""
    if is_flagged and not n_recognised:
        return UNEXPLAINED
    return verdict.effects[0].name if verdict.effects else verdict.verdict


def is_alone(hidden: Sequence[Mapping[str, Any]], verdict: Verdict, n_recognised: int) -> bool:
    """True if all hidden effects are named without alternatives."""
    return n_recognised == len(hidden) and not verdict.alternatives - set().union(*map(names_of, hidden))


def recoveries(truth: Mapping[str, Any], verdict: Verdict) -> Iterator[Recovery]:
    """Parameters of recognised effects with their true values, unless another effect also influences them."""
    for item in truth["planted"]:
        if any(set(item["truths"]) & set(other["truths"]) for other in truth["planted"] if other is not item):
            continue
        for effect in verdict.effects:
            if effect.name not in item["truths"][:1]:
                continue
            for name, value in item["parameters"].items():
                if name in effect.parameters:
                    yield Recovery(effect.name, name, value, effect.parameters[name])


def is_it(item: Mapping[str, Any], effect: NamedEffect) -> bool:
    """True if a claimed effect matches a hidden one, by its name or by the variable it depends on."""
    variables = effect.variables | DEPENDS_ON.get(effect.name, set())
    return effect.name in names_of(item) or bool(variables & set(item["variables"]))


def names_of(item: Mapping[str, Any]) -> set[str]:
    """All correct names of a hidden effect."""
    names = set(item["truths"])
    return names.union(*(SAME_THING.get(name, set()) for name in names))


def _outcome(
    hidden: Sequence[Mapping[str, Any]],
    verdict: Verdict,
    recognised: Sequence[bool],
    in_set: bool,
    has_false: bool,
    is_flagged: bool,
) -> str:
    if verdict.verdict == FAILED:
        return "failed"
    if not hidden:
        return "wrong" if has_false else "right" if verdict.verdict == NOTHING else "unexplained"
    if all(recognised):
        return "more" if has_false else "right"
    # An effect that no measured variable explains cannot be named; it only has to be noticed.
    if any(item["kind"] == "unlisted" and not item["variables"] for item in hidden):
        return "unexplained" if is_flagged else "wrong" if has_false else "nothing"
    if any(recognised):
        return "part"
    if in_set:
        return "ambiguous"
    if verdict.verdict == UNEXPLAINED:
        return "unexplained"
    return "wrong" if has_false else "nothing"
