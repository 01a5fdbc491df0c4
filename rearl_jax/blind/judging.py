"""One verdict beside the truth of its data set: what was recognised, what was said without being there."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rearl_jax.blind.verdicts import FAILED, NOTHING, UNEXPLAINED, Interval, NamedEffect, Verdict

SAME_THING = {"speed_scale": {"position_scale"}, "position_scale": {"speed_scale"}}
"""Artefacts that no data tell apart: speeds too large by a share, or positions too small."""

DEPENDS_ON = {
    "weather": {"time"},
    "grade": {"position"},
    "speed_limit": {"position"},
    "bend": {"position"},
    "lane_desired_speed": {"lane"},
}
"""What a named effect says about its variable, for hidden ones without a name."""

OUTCOMES = ("right", "more", "part", "ambiguous", "unexplained", "nothing", "wrong", "failed")
"""All of it named; all and something else; one of two; not named but among the alternatives; something is said to be
there that has no name; nothing found; something else named; discovery stopped with an error. Whether something was said
that is not there is asked on its own (`Judgement.false_names`), for it may stand beside what is right."""


@dataclass(frozen=True)
class Judgement:
    """What a verdict is worth.

    Attributes:
        outcome: One of OUTCOMES; in a control `right` is nothing found.
        shown: What the verdict says in one word, for the confusion matrix: the first name, or the verdict.
        n_hidden, n_recognised: Effects hidden, and those of them that are named.
        in_set: Whether each hidden effect is named or among the alternatives.
        alone: Whether it is named and no alternative is left.
        is_flagged: Whether the verdict says that something remains unexplained, or names a generic dependence.
        false_names: Names claimed that are not there, also those beside a right one; a curve counts as a name.
        false_kinds: Their kinds.
        claims: For every claimed effect with a stated confidence: the confidence, and whether it is there.
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
    """A parameter that means the same in generator and library."""

    effect: str
    parameter: str
    truth: float
    found: Interval

    @property
    def is_covered(self) -> bool | None:
        """True if the interval holds the truth; None without interval."""
        low, high = self.found.low, self.found.high
        return None if low is None or high is None else low <= self.truth <= high


def judge(truth: Mapping[str, Any], verdict: Verdict) -> Judgement:
    """The judgement on one data set, by its entry in the sealed file."""
    hidden = truth["planted"]
    recognised = [any(is_it(item, effect) for effect in verdict.effects) for item in hidden]
    in_set = [
        known or bool(names_of(item) & verdict.alternatives) for item, known in zip(hidden, recognised, strict=True)
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
    """What a verdict says in one word."""
    if is_flagged and not n_recognised:
        return UNEXPLAINED
    return verdict.effects[0].name if verdict.effects else verdict.verdict


def is_alone(hidden: Sequence[Mapping[str, Any]], verdict: Verdict, n_recognised: int) -> bool:
    """True if all that is hidden is named and no alternative to it is left."""
    return n_recognised == len(hidden) and not verdict.alternatives - set().union(*map(names_of, hidden))


def recoveries(truth: Mapping[str, Any], verdict: Verdict) -> Iterator[Recovery]:
    """Parameters of recognised effects beside their true values, where no other effect has a share in them."""
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
    """True if a claimed effect is a hidden one: by its name, or by the variable it depends on."""
    variables = effect.variables | DEPENDS_ON.get(effect.name, set())
    return effect.name in names_of(item) or bool(variables & set(item["variables"]))


def names_of(item: Mapping[str, Any]) -> set[str]:
    """Every name under which a hidden effect is right."""
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
    # What nothing measured explains need not be named, but noticed.
    if any(item["kind"] == "unlisted" and not item["variables"] for item in hidden):
        return "unexplained" if is_flagged else "wrong" if has_false else "nothing"
    if any(recognised):
        return "part"
    if in_set:
        return "ambiguous"
    if verdict.verdict == UNEXPLAINED:
        return "unexplained"
    return "wrong" if has_false else "nothing"
