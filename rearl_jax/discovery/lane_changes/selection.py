"""Selection of lane-choice effects: effects are added as long as other drivers confirm them.

Drivers are divided into three parts: 0 fitted drivers and 1 check drivers, to whom models are fitted and on whom they
are checked in turn, and 2 report drivers, whose losses are stated.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Int
from scipy.stats import norm

from rearl_jax.data.records import Recording
from rearl_jax.discovery.claims import Claim, Estimate, share_of
from rearl_jax.discovery.lane_changes.candidates import CANDIDATES, LaneCandidate
from rearl_jax.discovery.lane_changes.findings import LaneChangeFindings, Loss
from rearl_jax.discovery.lane_changes.hazard import fit
from rearl_jax.discovery.lane_changes.incentives import KnownDrivers
from rearl_jax.discovery.lane_changes.motion import count_changes
from rearl_jax.discovery.lane_changes.opportunities import Opportunities, opportunities
from rearl_jax.discovery.lane_changes.prediction import LEAST_CHANGES, prediction
from rearl_jax.discovery.lane_changes.ramps import count_ramp_changes
from rearl_jax.discovery.lane_changes.trials import CandidateColumns, Trial, trials_of
from rearl_jax.discovery.resampling import bounds
from rearl_jax.discovery.thresholds import THRESHOLDS

N_PARTS = 3
"""Number of parts of the drivers."""

UNSEEN = "lane choice: an effect could not have been detected here"
"""Beginning of the summary if there are too few lane changes."""

_NEEDED = f"{THRESHOLDS.least_lane_changes} are needed"


def too_few_changes(recordings: Sequence[Recording]) -> LaneChangeFindings | None:
    """Empty findings if there are fewer changes than a prediction needs; else None.

    This reads one column only, so callers test it before they calibrate drivers.
    """
    n_changes = _recorded(recordings)
    return LaneChangeFindings(n_changes, 0, _too_few(n_changes)) if n_changes < LEAST_CHANGES else None


def lane_change_findings(
    recordings: Sequence[Recording],
    drivers: KnownDrivers | None = None,
    split: Sequence[Int[np.ndarray, " _"]] | None = None,
    confidence: float = 0.9,
    seed: int = 0,
) -> LaneChangeFindings:
    """Influences on lane choice besides the own acceleration, and the accuracy of predicted lane changes.

    Args:
        recordings: Canonical recordings, the same and in the same order as for `measure`.
        drivers: Calibrated parameters; those of other drivers are estimated here, more coarsely. None to estimate all.
        split: Numbers of the fitted, check and report drivers' vehicles, as in `Measured.vehicle`; None for a split by
            recordings.
        confidence: Confidence of all intervals [-].
        seed: Seed of the split of drivers outside `split`, and of resampling.
    """
    if (too_few := too_few_changes(recordings)) is not None:
        return too_few
    table, reason = opportunities(recordings, KnownDrivers.of([]) if drivers is None else drivers)
    n_recorded, n_changes = _recorded(recordings), int(table.changes.sum())
    if not n_changes:
        words = f"{UNSEEN}: {reason}" if reason else f"{UNSEEN}, no lane change by choice, {_NEEDED}"
        return LaneChangeFindings(n_changes, len(table.side), words)
    part = part_of_rows(table, split, seed)
    if not table.changes[part == 0].any():
        return LaneChangeFindings(n_changes, len(table.side), f"{UNSEEN}, {_too_few_in_part(0)}")
    columns = CandidateColumns(table, part, seed)
    reason = why_nothing_is_named(columns, n_recorded)
    findings, added = (None, []) if reason else _named(columns, confidence)
    hazard = columns.fitted(columns.effects(added), 0, 1).chance(columns.data, columns.effects(added))
    predicted = prediction(table, part, hazard, confidence, n_recorded, count_ramp_changes(recordings))
    return replace(findings or LaneChangeFindings(n_changes, len(table.side), reason), prediction=predicted)


def _recorded(recordings: Sequence[Recording]) -> int:
    """Number of recorded lane changes of any kind."""
    return sum(count_changes(recording.table) for recording in recordings)


def _too_few(n_changes: int) -> str:
    return f"{UNSEEN}, too few lane changes: {n_changes}, {_NEEDED}"


def _too_few_in_part(fewest: int) -> str:
    needed = f"{THRESHOLDS.least_lane_changes_in_part} are needed"
    return f"too few lane changes in a third of the drivers: {fewest}, {needed}"


def why_nothing_is_named(columns: CandidateColumns, n_recorded: int) -> str:
    """Reason why no influence can be named, or ""."""
    taken, least = columns.data.taken, THRESHOLDS.least_lane_changes
    if n_recorded < least:
        return _too_few(n_recorded)
    if taken.sum() < least:
        return f"{UNSEEN}, too few lane changes by choice: {int(taken.sum())}, {_NEEDED}"
    fewest = min(int(taken[columns.part == part].sum()) for part in range(N_PARTS))
    if fewest < THRESHOLDS.least_lane_changes_in_part:
        return f"{UNSEEN}, {_too_few_in_part(fewest)}"
    if not _gain_counts(columns):
        return "lane changes do not depend on the gain of drivers: they are forced, or made for a destination"
    return ""


def _named(columns: CandidateColumns, confidence: float) -> tuple[LaneChangeFindings, list[Trial]]:
    """Findings, and the trials that were added."""
    added, rounds = _selected(columns)
    names = ", ".join(trial.candidate.name.replace("_", " ") for trial in added)
    names = names or "only the own acceleration counts"
    n_changes = int(columns.data.taken.sum())
    findings = LaneChangeFindings(
        n_changes,
        len(columns.part),
        words=f"lane choice, {n_changes} changes: {names}",
        effects=_effects(columns, added, rounds, confidence),
        candidates=_ranked(columns, added, rounds),
        loss=_loss(columns, added, confidence),
    )
    return findings, added


def part_of_rows(
    table: Opportunities, split: Sequence[Int[np.ndarray, " _"]] | None, seed: int
) -> Int[np.ndarray, " rows"]:
    """Part of each opportunity, 0 to 2; no driver is in two parts.

    `split` are the numbers of the vehicles of each part, as in `Measured.vehicle`; None if there is no split yet.
    Drivers outside it (those who do not follow a leader long enough) join the part that contains their whole recording,
    or else a random part.
    """
    recordings = np.unique(table.recording)
    home = {}
    if split is None and len(recordings) >= N_PARTS:
        # Whole recordings, in decreasing order of changes, each to the part with the fewest changes so far.
        changes = {int(name): int(table.changes[table.recording == name].sum()) for name in recordings}
        filled = [0] * N_PARTS
        for recording in sorted(changes, key=lambda key: (-changes[key], key)):
            home[recording] = int(np.argmin(filled))
            filled[home[recording]] += changes[recording] + 1
    vehicles, first, row = np.unique(table.vehicle, return_index=True, return_inverse=True)
    known = np.full(len(vehicles), -1)
    for part_number, members in enumerate(split or ()):
        known[np.isin(vehicles, members)] = part_number
    of_recording = table.recording[first]
    for recording in recordings:
        parts = np.unique(known[(of_recording == recording) & (known >= 0)])
        if len(parts) == 1:
            home[int(recording)] = int(parts[0])
    at_random = np.random.default_rng(seed).integers(0, N_PARTS, len(vehicles))
    stay = np.array([home.get(int(recording), -1) for recording in of_recording], int)
    return np.where(known >= 0, known, np.where(stay >= 0, stay, at_random))[row]


def _gain_counts(columns: CandidateColumns) -> bool:
    """True if the chance of a change grows with the own gain, all circumstances being equal: a gap that is accepted
    because it is long is a gain as well, but no reason.
    """
    data = columns.data.take(columns.rows(0, 1))
    line = fit(np.column_stack([np.ones(len(data.gain)), data.gain, data.others]), data.taken, data.driver)
    return bool(line.coefficients[1] > THRESHOLDS.own_gain_z_score * np.sqrt(line.covariance[1, 1]))


def _selected(columns: CandidateColumns) -> tuple[list[Trial], list[list[Trial]]]:
    """Added effects in order, and all trials of each round."""
    added: list[Trial] = []
    rounds: list[list[Trial]] = []
    while len(added) < THRESHOLDS.most_lane_effects:
        rounds.append(trials_of(columns, added))
        least = max(THRESHOLDS.later_lane_total, THRESHOLDS.later_lane_share * added[0].total) if added else 0.0
        confirmed = [trial for trial in rounds[-1] if trial.is_confirmed and trial.total > least]
        if not confirmed:
            break
        added.append(max(confirmed, key=lambda trial: trial.total))
    return added, rounds


def _effects(
    columns: CandidateColumns, added: Sequence[Trial], rounds: Sequence[Sequence[Trial]], confidence: float
) -> tuple[Claim, ...]:
    """Claims on the added effects, with strengths estimated on the fitted and check drivers."""
    model = columns.fitted(columns.effects(added), 0, 1)
    n_deviations = float(norm.ppf(0.5 + confidence / 2))
    claims = []
    for position, (trial, trials) in enumerate(zip(added, rounds, strict=False)):  # the last round may add nothing
        candidate, value = trial.candidate, float(model.strengths[position])
        half_width = n_deviations * float(np.sqrt(model.covariance[position, position]))
        bounds = candidate.low, candidate.high
        value, low, high = np.clip([value, value - half_width, value + half_width], *bounds).tolist()
        name, unit = candidate.strength
        parameters = {name: Estimate(value, low, high, unit)}
        parameters |= {name: Estimate(value, None, None, unit) for name, value, unit in trial.form.shape}
        share = share_of(trial.total, [other.total for other in trials if other is not trial])
        probability = min(share, THRESHOLDS.most_confidence)
        claims.append(Claim(candidate.name, candidate.kind, parameters, candidate.variables, probability, trial.total))
    return tuple(claims)


def _ranked(
    columns: CandidateColumns, added: Sequence[Trial], rounds: Sequence[Sequence[Trial]]
) -> tuple[dict[str, Any], ...]:
    """All candidates as in the first round, and the circumstances that every model contains: entries of a verdict."""
    # Candidates about as good as the one that was added in their round; `zip` leaves out a last round without one.
    alike = {
        other.candidate.key
        for trial, trials in zip(added, rounds, strict=False)
        for other in trials
        if other.is_confirmed and trial.total - other.total < THRESHOLDS.indistinct_lane_total
    } - {trial.candidate.key for trial in added}

    def row(candidate: LaneCandidate, z: float, gain: float | None, check: float | None) -> dict[str, Any]:
        is_alike = candidate.key in alike
        return {
            "name": candidate.name,
            "kind": candidate.kind,
            "variables": list(candidate.variables),
            "evidence": 0.5 * z**2,
            "z_score": z,
            "gain": gain,
            "check": check,
            "ambiguous": is_alike,
            "told_apart_by": "changes in which the two would choose differently" if is_alike else None,
        }

    rows = [row(trial.candidate, abs(trial.z), trial.gain, trial.check) for trial in rounds[0]]
    line = columns.fitted(columns.effects(()), 0, 1).line
    held = [candidate for candidate in CANDIDATES if candidate.is_circumstance]
    of_held = slice(-len(held), None)  # they are the last columns of the model
    z_scores = np.abs(line.coefficients[of_held]) / np.sqrt(np.diag(line.covariance)[of_held])
    rows += [row(candidate, float(z), None, None) for candidate, z in zip(held, z_scores, strict=True)]
    return tuple(sorted(rows, key=lambda ranked: -ranked["z_score"]))


def _loss(columns: CandidateColumns, added: Sequence[Trial], confidence: float) -> Loss:
    """Mean log-loss per opportunity of the report drivers without and with the added effects, and its change [nats]."""
    reported, losses = columns.rows(2), []
    for effects in (columns.effects(()), columns.effects(added)):
        losses.append(-columns.fitted(effects, 0, 1).log_likelihood(columns.data, effects))
    change = losses[1] - losses[0]
    drawn = columns.resampled(change, 2) / columns.resampled(np.ones(len(change)), 2)
    low, high = bounds(drawn, confidence).tolist()
    before, after = (float(loss[reported].mean()) for loss in losses)
    return Loss(before, after, Estimate(float(change[reported].mean()), low, high, "nats"))
