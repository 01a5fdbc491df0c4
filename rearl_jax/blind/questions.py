"""The rates of a blind study: data sets, criterion, and the goal set in advance."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rearl_jax.blind.cases import BROAD, BROAD_CONTROL
from rearl_jax.blind.judging import Judgement, Recovery
from rearl_jax.blind.verdicts import IMPROVED, Verdict

NAMED = ("right", "more")
"""Outcomes in which all hidden effects are named; in `more` a false effect is reported as well."""


@dataclass(frozen=True)
class Judged:
    """A data set with its truth, verdict and judgement; intervals of parameters, and how many contain the truth."""

    name: str
    truth: Mapping[str, Any]
    verdict: Verdict
    judgement: Judgement
    recoveries: tuple[Recovery, ...]
    n_intervals: int = 0
    n_covered: int = 0

    @property
    def group(self) -> str:
        """The group that the data set belongs to, a set of cases.py; `named` is one effect at its usual strength."""
        return self.truth["group"]

    @property
    def is_sumo(self) -> bool:
        """True if SUMO generated the data set."""
        return self.truth["source"] == "sumo"

    @property
    def hidden_kind(self) -> str:
        """Kind of the (first) hidden effect: `control`, `listed`, `unlisted` or `artefact`."""
        return self.truth["planted"][0]["kind"] if self.truth["planted"] else "control"

    @property
    def is_named(self) -> bool:
        """True if all hidden effects are named, whatever the group; false effects may be reported as well."""
        return self.judgement.outcome in NAMED

    @property
    def is_listed(self) -> bool:
        """True if all hidden effects are in the library; not for SUMO's own variants."""
        planted = self.truth["planted"]
        return bool(planted) and not self.is_sumo and all(item["kind"] == "listed" for item in planted)


@dataclass(frozen=True)
class Question:
    """A rate with its goal: among the data sets that it applies to, the share of those that count as a hit.

    Attributes:
        name: Name in tables.
        title: Title in documents.
        applies: Whether a data set counts in the rate at all.
        is_hit: Whether a data set that counts is a hit.
        goal: The least share that meets the goal [-]; with `at_most` the largest.
        at_most: Whether the share should be small.
        needs: Column of cases.parquet that is necessary to compute the rate from a kept study; empty for none.
    """

    name: str
    title: str
    applies: Callable[[Judged], bool]
    is_hit: Callable[[Judged], bool]
    goal: float
    at_most: bool = False
    needs: str = ""


def _in(*groups: str) -> Callable[[Judged], bool]:
    """Criterion: the data set belongs to one of the groups, and the generator made it."""
    return lambda case: case.group in groups and not case.is_sumo


def _in_sumo(*kinds: str) -> Callable[[Judged], bool]:
    """Criterion: SUMO made the data set, and the hidden effect is of one of the kinds."""
    return lambda case: case.is_sumo and case.hidden_kind in kinds


def _unlisted(*, has_variable: bool) -> Callable[[Judged], bool]:
    """Criterion: the hidden effect is outside the library, and a measured variable causes it or none does."""
    return lambda case: case.group == "unlisted" and bool(case.truth["planted"][0]["variables"]) == has_variable


def _has(*outcomes: str) -> Callable[[Judged], bool]:
    """Criterion: the data set has one of the outcomes."""
    return lambda case: case.judgement.outcome in outcomes


def _has_false_driver_or_road_effect(case: Judged) -> bool:
    """True if an effect of drivers or road is reported that is not hidden; a false artefact does not count."""
    return any(kind != "artefact" for kind in case.judgement.false_kinds)


def _has_false_name(case: Judged) -> bool:
    """True if an effect is reported that is not hidden, alone or together with a correct one."""
    return bool(case.judgement.false_names)


def _is_named_without_alternatives(case: Judged) -> bool:
    return case.judgement.alone


def _is_named_or_alternative(case: Judged) -> bool:
    """True if each hidden effect is named or among the alternatives."""
    return case.judgement.in_set


def _is_flagged_or_named(case: Judged) -> bool:
    """True if the verdict reports something unexplained, or names all hidden effects."""
    return case.judgement.is_flagged or case.is_named


def _both_or_flagged(case: Judged) -> bool:
    """True if all hidden effects are named, or one is and the rest is reported as unexplained."""
    judgement = case.judgement
    return judgement.n_recognised == judgement.n_hidden or (judgement.n_recognised > 0 and judgement.is_flagged)


def changes_the_model(case: Judged) -> bool:
    """True if an effect or a curve was added to the model, not only a measurement fault."""
    return any(effect.kind != "artefact" for effect in case.verdict.effects)


def _is_named_at_usual_strength(case: Judged) -> bool:
    return _in("named")(case) and case.is_named


def _is_repaired_sumo_model(case: Judged) -> bool:
    """True for data sets of SUMO's other driver models and of its action steps for which the model was changed."""
    return _in_sumo("unlisted")(case) and changes_the_model(case)


def claims_anything(case: Judged) -> bool:
    """True if an effect, an artefact or a curve is named, or the verdict is `improved`."""
    return bool(case.verdict.effects) or case.verdict.verdict == IMPROVED


def error_surely_rose(case: Judged) -> bool:
    """True if the error of other drivers is significantly larger after the repair."""
    return _change("low", +1)(case)


def _error_fell(case: Judged) -> bool:
    """True if the whole interval of the error after repair is below the error before."""
    before, after = case.verdict.errors["before"], case.verdict.errors["after"]
    return before is not None and after is not None and after.high is not None and after.high < before.value


def _change(end: str, sign: int) -> Callable[[Judged], bool]:
    """Criterion: the `end` of the error's change, driver by driver, is below zero (sign -1) or above (+1).

    `end` is `value`, or a bound of the interval, `low` or `high`.
    """

    def is_beyond(case: Judged) -> bool:
        value = getattr(case.verdict.errors["change"], end, None)
        return value is not None and sign * value > 0.0

    return is_beyond


QUESTIONS = (
    # Name, title, data sets, criterion, goal; True if the goal is an upper limit; necessary column.
    Question("identified", "effects of the library named, usual strength", _in("named"), _has(*NAMED), 0.95),
    Question("in_set", "effects of the library named, or among the alternatives",
             _in("named"), _is_named_or_alternative, 0.95),
    Question("wrong_name", "a false effect, usual strength", _in("named"), _has_false_name, 0.02, True),
    Question("half_identified", "named at half strength", _in("half"), _has(*NAMED), 0.6),
    Question("half_wrong", "a false effect, half strength", _in("half"), _has_false_name, 0.0, True),
    Question("half_4x_identified", "half strength, four times the data", _in("half_four_times"), _has(*NAMED), 0.9),
    Question("short_identified", "named in records of 14 s", _in("short"), _has(*NAMED), 0.8),
    Question("control_false", "controls with an effect named",
             _in("control"), _has_false_driver_or_road_effect, 1 / 30, True),
    Question("control_clean", "controls in which nothing was found", _in("control"), _has("right"), 0.95),
    Question("artefact_identified", "artefacts named", _in("artefact"), _has(*NAMED), 0.9),
    Question("artefact_as_effect", "artefacts reported as an effect",
             _in("artefact"), _has_false_driver_or_road_effect, 0.0, True),
    Question("confusable_in_set", "similar effects: true one named, or among the alternatives",
             _in("confusable"), _is_named_or_alternative, 1.0),
    Question("confusable_alone", "similar effects: only the true one named",
             _in("confusable"), _is_named_without_alternatives, 0.8),
    Question("cancelling_false", "cancelling effects: a false effect", _in("cancelling"), _has_false_name, 0.0, True),
    Question("variable", "unlisted effects, measured cause: right variable",
             _unlisted(has_variable=True), _has(*NAMED), 0.9),
    Question("flagged", "unlisted effects, no measured cause: unexplained",
             _unlisted(has_variable=False), _is_flagged_or_named, 0.8),
    Question("both_named", "two effects: both named", _in("two"), _has(*NAMED), 0.8),
    Question("one_and_flagged", "two effects: both, or one and an unexplained rest", _in("two"), _both_or_flagged, 1.0),
    Question("lane_choice_identified", "effects on lane choice named", _in("lane_choice"), _has(*NAMED), 0.9),
    Question("lane_choice_false", "free lane changes without effects: an effect named",
             _in("lane_choice_control"), _has_false_driver_or_road_effect, 0.0, True),
    Question("sumo_family", "SUMO: effects of the library named, or among the alternatives",
             _in_sumo("listed"), _has(*NAMED, "ambiguous"), 0.8),
    Question("sumo_other", "SUMO: other models and action steps, unexplained or correct",
             _in_sumo("unlisted"), _is_flagged_or_named, 0.8),
    Question("sumo_control", "SUMO: controls with an effect named",
             _in_sumo("control"), _has_false_driver_or_road_effect, 1 / 30, True),
    Question("error_fell", "named effects: interval of the error after repair below the error before",
             _is_named_at_usual_strength, _error_fell, 0.8, False, "after_high"),
    Question("error_surely_fell", "named effects: significantly lower error, driver by driver",
             _is_named_at_usual_strength, _change("high", -1), 0.8, False, "change_high"),
    Question("sumo_error", "SUMO's other models and action steps: lower error after repair",
             _is_repaired_sumo_model, _change("value", -1), 0.95),
    Question("error_rose", "repaired models: significantly higher error, driver by driver",
             changes_the_model, error_surely_rose, 0.0, True, "change_low"),
    Question("broad_identified", "broad priors: effects of the library named", _in(BROAD), _has(*NAMED), 0.95),
    Question("broad_wrong", "broad priors: a false name", _in(BROAD, BROAD_CONTROL), _has_false_name, 0.02, True),
    Question("broad_control", "broad priors: controls with a name or an improvement",
             _in(BROAD_CONTROL), claims_anything, 0.02, True),
    Question("failed", "data sets on which discovery stopped with an error", lambda _: True, _has("failed"), 0.0, True),
)  # fmt: skip
"""All rates of a study, in display order."""
