"""From recordings to what is missing in lane changing: effects are added while other drivers confirm them."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int
from scipy.stats import norm

from rearl_jax.data.records import Recording
from rearl_jax.discovery.lane_changes.candidates import CANDIDATES
from rearl_jax.discovery.lane_changes.findings import (
    Estimate,
    LaneChangeFindings,
    LaneEffect,
    RankedCandidate,
    nothing_seen,
)
from rearl_jax.discovery.lane_changes.hazard import fit
from rearl_jax.discovery.lane_changes.incentives import KnownDrivers
from rearl_jax.discovery.lane_changes.motion import count_changes
from rearl_jax.discovery.lane_changes.opportunities import opportunities
from rearl_jax.discovery.lane_changes.parts import N_PARTS, part_of_rows
from rearl_jax.discovery.lane_changes.trials import Trial, Tried, tried
from rearl_jax.discovery.thresholds import THRESHOLDS

UNSEEN = "choice of the lane: could not have been seen here"

_NEEDED = f"{THRESHOLDS.least_lane_changes} are needed"


def too_few_changes(recordings: Sequence[Recording]) -> LaneChangeFindings | None:
    """That nothing can be seen, where there are fewer changes of any kind than are needed; else None.

    It costs a look at one column, so whoever has to calibrate drivers first asks it before.
    """
    n_changes = sum(count_changes(recording.table) for recording in recordings)
    if n_changes >= THRESHOLDS.least_lane_changes:
        return None
    return nothing_seen(n_changes, 0, f"{UNSEEN}, too few lane changes: {n_changes}, {_NEEDED}")


def lane_change_findings(
    recordings: Sequence[Recording],
    drivers: KnownDrivers | None = None,
    split: Sequence[Int[np.ndarray, " _"]] | None = None,
    confidence: float = 0.9,
    seed: int = 0,
) -> LaneChangeFindings:
    """Influences on the choice of the lane beside the own acceleration.

    Args:
        recordings: Canonical recordings, the same and in the same order as `measure` got them.
        drivers: Calibrated parameters; of all others, and of all with None, they are fitted here, more coarsely.
        split: Vehicles that are fitted, checked and reported, as in `Measured.vehicle`; None for a split by recordings.
        confidence: Of all intervals [-].
        seed: Of the split of drivers it does not know, and of resampling.
    """
    few = too_few_changes(recordings)
    if few is not None:
        return few
    table, why = opportunities(recordings, KnownDrivers.of([]) if drivers is None else drivers)
    n_changes, n = int(table.changes.sum()), len(table.side)
    if n_changes < THRESHOLDS.least_lane_changes:
        words = f"{UNSEEN}: {why}" if why else f"{UNSEEN}, too few lane changes by choice: {n_changes}, {_NEEDED}"
        return nothing_seen(n_changes, n, words)
    part = part_of_rows(table, split, seed)
    fewest = min(int(table.changes[part == number].sum()) for number in range(N_PARTS))
    if fewest < THRESHOLDS.least_lane_changes_in_part:
        words = f"{UNSEEN}, too few lane changes in a third of the drivers: {fewest}, "
        words += f"{THRESHOLDS.least_lane_changes_in_part} are needed"
        return nothing_seen(n_changes, n, words)
    every = Tried(table, part, seed)
    if not _gain_counts(every):
        words = "lane changes do not follow what drivers gain: they are forced, or made for a destination"
        return nothing_seen(n_changes, n, words)
    added, rounds = _selected(every)
    before, after, change = _loss(every, added, confidence)
    names = ", ".join(one.candidate.name.replace("_", " ") for one in added)
    names = names or "nothing beside the own acceleration counts"
    return LaneChangeFindings(
        effects=_effects(every, added, rounds, confidence),
        candidates=_ranked(every, added, rounds),
        n_changes=n_changes,
        n_opportunities=n,
        loss_before=before,
        loss_after=after,
        loss_change=change,
        words=f"choice of the lane, {n_changes} changes: {names}",
    )


def _gain_counts(every: Tried) -> bool:
    """True if drivers are the more likely to change the more they gain."""
    data = every.data.take(every.rows(0, 1))
    line = fit(np.column_stack([np.ones(len(data.gain)), data.gain]), data.taken, data.driver)
    return bool(line.coefficients[1] > THRESHOLDS.own_gain_z_score * np.sqrt(line.covariance[1, 1]))


def _selected(every: Tried) -> tuple[list[Trial], list[list[Trial]]]:
    """Effects that are added, in order, and everything that was tried in each round."""
    added: list[Trial] = []
    rounds: list[list[Trial]] = []
    while len(added) < THRESHOLDS.most_lane_effects:
        rounds.append(tried(every, added))
        least = max(THRESHOLDS.later_lane_total, THRESHOLDS.later_lane_share * added[0].total) if added else 0.0
        held = [one for one in rounds[-1] if one.is_confirmed and one.total > least]
        if not held:
            break
        added.append(max(held, key=lambda one: one.total))
    return added, rounds


def _effects(
    every: Tried, added: Sequence[Trial], rounds: Sequence[Sequence[Trial]], confidence: float
) -> tuple[LaneEffect, ...]:
    """Effects that were added, with strengths from the drivers that were fitted and checked."""
    model = every.fitted(every.effects(added), 0, 1)
    reach = float(norm.ppf(0.5 + confidence / 2))
    found = []
    for number, (one, trials) in enumerate(zip(added, rounds, strict=False)):
        value, half = float(model.strengths[number]), reach * float(np.sqrt(model.covariance[number, number]))
        value, low, high = (
            float(np.clip(end, one.candidate.low, one.candidate.high)) for end in (value, value - half, value + half)
        )
        name, unit = one.candidate.strength
        parameters = {name: Estimate(value, low, high, unit)}
        parameters |= {shape: Estimate(number, None, None, its) for shape, number, its in one.form.shape}
        rivals = np.array([0.0, *(other.total for other in trials if other is not one)])
        share = 1.0 / (1.0 + float(np.exp(np.clip(rivals - one.total, -50, 50)).sum()))
        candidate = one.candidate
        found.append(
            LaneEffect(
                candidate.name,
                candidate.kind,
                parameters,
                candidate.variables,
                min(share, THRESHOLDS.most_confidence),
                one.total,
            )
        )
    return tuple(found)


def _ranked(every: Tried, added: Sequence[Trial], rounds: Sequence[Sequence[Trial]]) -> tuple[RankedCandidate, ...]:
    """All candidates as they were in the first round, and the circumstances that every model holds."""
    named = {one.candidate.key for one in added}
    alike = {
        other.candidate.key
        for one, trials in zip(added, rounds, strict=False)
        for other in trials
        if other.is_confirmed and one.total - other.total < THRESHOLDS.indistinct_lane_total
    } - named
    rows = [
        RankedCandidate(
            one.candidate.name,
            one.candidate.kind,
            one.candidate.variables,
            abs(one.z),
            one.gain,
            one.check,
            one.candidate.key in alike,
        )
        for one in rounds[0]
    ]
    none = every.effects(())
    model = every.fitted(none, 0, 1)
    held = [one for one in CANDIDATES if one.is_circumstance]
    at = len(model.line.coefficients) - len(held)
    for number, one in enumerate(held, at):
        z = abs(model.line.coefficients[number]) / float(np.sqrt(model.line.covariance[number, number]))
        rows.append(RankedCandidate(one.name, one.kind, one.variables, float(z), None, None, False))
    return tuple(sorted(rows, key=lambda row: -row.z_score))


def _loss(every: Tried, added: Sequence[Trial], confidence: float) -> tuple[float, float, Estimate]:
    """Mean log-loss of the reported drivers' opportunities before and after, and the change [nats]."""
    reported, losses = every.rows(2), []
    for effects in (every.effects(()), every.effects(added)):
        losses.append(-every.fitted(effects, 0, 1).log_likelihood(every.data, effects))
    change = losses[1] - losses[0]
    drawn = every.resampled(change, 2) / int(reported.sum())
    low, high = np.quantile(drawn, [0.5 - confidence / 2, 0.5 + confidence / 2])
    before, after = (float(loss[reported].mean()) for loss in losses)
    return before, after, Estimate(float(change[reported].mean()), float(low), float(high), "nats")
