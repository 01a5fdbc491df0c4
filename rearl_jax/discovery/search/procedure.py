"""From measured drivers to what the model lacks: calibrate, screen, fit, check on other drivers, and again."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from itertools import takewhile

import numpy as np

from rearl_jax.discovery.observe.candidates import Layout, Term
from rearl_jax.discovery.observe.clocks import CLOCK_OFFSET, Clocks
from rearl_jax.discovery.observe.fit import Fit, on_others, with_others
from rearl_jax.discovery.observe.noise import calibrate
from rearl_jax.discovery.observe.solver import Solver, World
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.clock_check import ClockCheck, check_clocks, put_right
from rearl_jax.discovery.search.decision import Trial, believed, not_told_apart, trial
from rearl_jax.discovery.search.families import are_kin, with_families
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.search.refit import rebased, refit
from rearl_jax.discovery.search.screen import Score, clock_evidence, evidences, scores
from rearl_jax.discovery.thresholds import THRESHOLDS

UNDERSTATED = frozenset({Term("reaction_delay")})
"""What is fitted wherever it fires: drivers who were calibrated without a delay have taken most of it in, and
the score, which looks at delays close to none, sees little.
"""


Report = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Round:
    """One turn of the loop.

    Attributes:
        base: The model at its beginning.
        evidence: Of every candidate [nats].
        excess: Above the null's mean [nats].
        surprise: The same in standard deviations of the null [-].
        firing: Candidates that fire, with their families.
        trials: All that were fitted.
        held: Those that are believed, the best first.
        clock_surprise: As `surprise`, of clocks that differ.
    """

    base: Fit
    evidence: dict[Term, float]
    excess: dict[Term, float]
    surprise: dict[Term, float]
    firing: frozenset[Term]
    trials: list[Trial]
    held: list[Trial]
    clock_surprise: float = 0.0

    @property
    def chosen(self) -> Trial | None:
        """What is added."""
        return self.held[0] if self.held else None

    @property
    def is_beaten(self) -> bool:
        """Whether something that is not believed fares better than what is added."""
        chosen = self.chosen
        return chosen is not None and any(
            one.beats(chosen) and _is_significant(one, self.firing) for one in self.trials
        )

    @property
    def alternatives(self) -> list[Trial]:
        """What cannot be told apart from it."""
        return not_told_apart(self.held)[1:] if self.held else []


@dataclass
class Search:
    """Everything that was found, round by round.

    Attributes:
        layout: What was looked for.
        null: Evidence where nothing is missing.
        first_scores: Of the calibrated model.
        checked: The other drivers as the final model takes them, see `in_time`.
        clocks: Differences between clocks, where the data were corrected for them.
        rounds: One per effect that was added, and the last one, which added none.
        rejected: What had been added, and made the simulation of other drivers worse.
        excluded: Candidates, or clocks, that are not looked for.
    """

    layout: Layout
    null: Null
    first_scores: dict[Term, Score]
    checked: Measured
    clocks: ClockCheck | None = None
    rounds: list[Round] = field(default_factory=list)
    rejected: list[Trial] = field(default_factory=list)
    excluded: frozenset[Term] = frozenset()

    @property
    def before(self) -> Fit:
        """The calibrated model on the data as they were."""
        return self.first if self.clocks is None else self.clocks.base

    @property
    def first(self) -> Fit:
        """The calibrated model without additions."""
        return self.rounds[0].base

    @property
    def last(self) -> Fit:
        """The model with all that was added."""
        chosen = self.rounds[-1].chosen
        return chosen.fit if chosen is not None else self.rounds[-1].base

    @property
    def added(self) -> list[Trial]:
        """What was added, in order."""
        return [one.chosen for one in self.rounds if one.chosen is not None]

    @property
    def is_contradicted(self) -> bool:
        """Whether an effect or artefact that the drivers' moments ask for makes their simulation worse."""
        return any(not is_free(one) for one in self.rejected)

    def is_doubtful(self, one: Trial) -> bool:
        """Whether a named effect is beaten by what is not believed, comes before what simulations contradict or after a
        free curve, whose remainder it may be, or leaves a dependence on what it acts by, which then is another one than
        it says.
        """
        if self.is_contradicted or any(turn.is_beaten for turn in self.rounds if turn.chosen is one):
            return True
        earlier = takewhile(lambda other: other is not one, self.added)
        if not is_free(one) and any(is_free(other) for other in earlier):
            return True
        curves = [other.candidate for other in (*self.added, *self.rejected) if is_free(other)]
        return any(set(curve.variables) & set(one.candidate.variables) for curve in curves if curve != one.candidate)


def is_free(one: Trial) -> bool:
    """Whether it is a free curve, which approximates whatever there is, and fits what any other form has left."""
    return one.candidate.kind == "generic"


def search(
    solver: Solver,
    fitted: Measured,
    checked: Measured,
    null_for: Callable[[Fit], Null],
    report: Report,
    *,
    excluded: frozenset[Term] = frozenset(),
) -> Search:
    """The loop: until nothing more fires, or nothing that fires is believed.

    Args:
        solver: Fits.
        fitted: Drivers everything is fitted to.
        checked: Other drivers, for the check.
        null_for: The null of the calibrated model.
        report: Called with what is being done, and how far it is.
        excluded: Candidates, or clocks, that are not looked for.
    """
    report("calibrating drivers", 0, 1)
    world, noise = calibrate(solver, fitted)
    base = Fit(None, world, noise)
    everybody = with_others(solver, base, checked)
    null = null_for(everybody)
    (seen,) = scores(solver, [everybody.world])
    found = Search(solver.layout, null, seen, checked, excluded=excluded)
    clocks = None
    of_clocks = null.surprise({CLOCK_OFFSET: clock_evidence(everybody.world, seen)})[CLOCK_OFFSET]
    if CLOCK_OFFSET not in excluded and of_clocks > THRESHOLDS.candidate_z_score:
        report("comparing clocks", 0, 1)
        clocks = check_clocks(solver, base, checked)
    while len(found.added) <= THRESHOLDS.most_effects:
        one = _round(solver, base, everybody.world, seen, found, report)
        if clocks is not None and not found.rounds and (one.chosen is None or clocks.total > one.chosen.total):
            # The data are put right, and the loop begins again.
            found.clocks, found.checked = clocks, clocks.checked
            world, noise = calibrate(solver, clocks.fitted)
            clocks = None
            base = Fit(None, world, noise)
        else:
            found.rounds.append(one)
            if one.chosen is None:
                break
            base = one.chosen.fit
        everybody = with_others(solver, base, found.checked)
        (seen,) = scores(solver, [everybody.world])
    return found


def in_time(solver: Solver, found: Search, data: Measured) -> Measured:
    """Drivers as the final model takes them: with their clocks put right where the fitted ones' were."""
    return data if found.clocks is None else put_right(solver, Clocks(data), found.clocks.base).data


def _round(
    solver: Solver, base: Fit, everybody: World, seen: dict[Term, Score], found: Search, report: Report
) -> Round:
    """The next turn from a model and its scores."""
    layout, null, added = solver.layout, found.null, found.added
    report(f"looking for effects, round {len(added) + 1}", 0, 1)
    left = {CLOCK_OFFSET, *layout.candidates} - {*base.world.active, *found.excluded - {CLOCK_OFFSET}}
    evidence = {term: value for term, value in evidences(everybody, seen, layout).items() if term in left}
    fires = {term for term, surprise in null.surprise(evidence).items() if surprise > THRESHOLDS.candidate_z_score}
    clock_surprise = null.surprise({CLOCK_OFFSET: evidence.pop(CLOCK_OFFSET)})[CLOCK_OFFSET]
    excess, surprise, known = null.excess(evidence), null.surprise(evidence), set(evidence)
    if len(added) == THRESHOLDS.most_effects or not fires:
        return Round(base, evidence, excess, surprise, frozenset(fires & known), [], [], clock_surprise)
    order = sorted(evidence, key=lambda term: -excess[term])
    firing = with_families(fires, known) & known
    tried = {term for term in order[: THRESHOLDS.leading_fitted] if excess[term] > THRESHOLDS.fitting_excess}
    tried |= with_families({term for term in order[:2] if term in tried} | fires & {CLOCK_OFFSET}, known) & known
    tried |= fires & UNDERSTATED & known
    fits: dict[Term, Fit] = {}
    while True:
        new = [layout.candidates[term] for term in order if term in tried - fits.keys()]
        fits |= refit(solver, base, new, seen, lambda k, n: report("fitting candidates", k, n))
        base = rebased(solver, base, fits)
        report("checking on other drivers", 0, 1)
        trials = _trials(solver, base, fits, found)
        held = believed([one for one in trials if _is_significant(one, firing) and _is_news(one, added)])
        # Nothing is added before all that it is easily taken for have been tried as well.
        tried = with_families({one.candidate.term for one in held[:1]}, known)
        if tried <= fits.keys():
            surprise |= {one.candidate.term: 0.0 for one in trials if _is_of_numerics(one)}
            return Round(base, evidence, excess, surprise, frozenset(firing), trials, held, clock_surprise)


def _trials(solver: Solver, base: Fit, fits: dict[Term, Fit], found: Search) -> list[Trial]:
    """How every candidate that was fitted fared."""
    other_base, *others = on_others(solver, found.checked, [base, *fits.values()])
    return [
        trial(solver, fit, base.world, other, other_base, found.null.luck(term))
        for (term, fit), other in zip(fits.items(), others, strict=True)
    ]


def _is_significant(one: Trial, firing: Collection[Term]) -> bool:
    """Whether a candidate fires, or is so much better in full than at a glance that it needs not."""
    return not _is_of_numerics(one) and (one.candidate.term in firing or one.total > THRESHOLDS.total_below_z_score)


def _is_of_numerics(one: Trial) -> bool:
    """Whether it is a reaction delay of less than a moment, which is not of the driver."""
    if one.candidate.term != Term("reaction_delay"):
        return False
    (place,) = one.candidate.free
    return bool(abs(one.fit.world.theta[place]) < one.fit.world.data.dt)


def _is_news(one: Trial, added: list[Trial]) -> bool:
    """Whether an effect is more than what another form of an earlier one would have taken in."""
    if added and one.total < THRESHOLDS.later_share * max(other.total for other in added):
        return False

    def may_be_remainder(other: Trial) -> bool:
        return is_free(one) or is_free(other) or are_kin(one.candidate.term, other.candidate.term)

    return all(one.total > THRESHOLDS.confounded_share * other.total for other in added if may_be_remainder(other))


def split_drivers(data: Measured, shares: tuple[float, ...], seed: int) -> list[Measured]:
    """Parts of the data that share no driver: whole recordings where they are alike in size, else drivers at random.

    Args:
        data: All drivers.
        shares: Of each part; they sum to 1.
        seed: Of the order of drivers.
    """
    owner = np.full(len(data.driver), -1)
    numbers, sizes = np.unique(data.recording, return_counts=True)
    filled = np.zeros(len(shares))
    for one in np.argsort(-sizes, kind="stable"):
        part = int(np.argmin(filled / np.array(shares)))
        owner[data.recording == numbers[one]] = part
        filled[part] += sizes[one]
    if (filled < THRESHOLDS.least_part_filled * np.array(shares) * sizes.sum()).any():
        rng = np.random.default_rng(seed)
        order = rng.permutation(data.n_drivers)
        edges = np.round(np.cumsum(shares) * data.n_drivers).astype(int)
        part_of = np.searchsorted(edges, np.argsort(order), side="right")
        owner = part_of[data.driver]
    return [data.select(np.flatnonzero(owner == part)) for part in range(len(shares))]
