"""Lane-change probabilities of several models at every opportunity of held-out drivers. The hazard is the probability
that depends on the own gain and on the effects found (`strengths.IncentiveModel`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from rearl_jax.discovery.lane_changes.mobil import CalibratedMobil, MobilRule, calibrated_mobil, rate
from rearl_jax.discovery.lane_changes.opportunities import Opportunities

BASE_RATE, ORIGINAL, ORIGINAL_RULE, CALIBRATED, HAZARD = (
    "base_rate",
    "mobil",
    "mobil_rates",
    "mobil_calibrated",
    "hazard",
)

PREDICTORS = {
    BASE_RATE: "constant rate of each side",
    ORIGINAL: "original MOBIL",
    ORIGINAL_RULE: "original rule at the drivers' rates",
    CALIBRATED: "calibrated MOBIL",
    HAZARD: "calibrated hazard",
}
"""Titles of the compared models, from the simplest on. `mobil` has MOBIL's default parameters; only the probability of
refused changes, which the original rule excludes, is fitted to other drivers; in `mobil_rates` also the rate of
accepted changes.
"""

LEAST_CHANGES = 30
"""Recorded lane changes below which no prediction is scored and MOBIL is not calibrated."""

LEAST_IN_PART = 8
"""Smallest number of discretionary changes that the fitted drivers, and the held-out drivers, must make."""

LEAST_PROBABILITY = 1e-9
"""Lower bound of all probabilities and of their complements [-], because no model justifies more certainty. Log losses
are therefore finite, also those of the original MOBIL if its delay is as short as the time between two opportunities.
"""

LARGE_ADVANTAGE = 10 / 3.6
"""Speed advantage of the target lane [m/s] above which it counts as large: 10 km/h, a convention of this package."""


@dataclass(frozen=True)
class Prediction:
    """Opportunities of held-out drivers with the lane-change probabilities of the models; one row per opportunity.

    Attributes:
        table: The opportunities; `table.changes` is the recorded choice.
        chance: Probability of a change within the opportunity [-], by the names of PREDICTORS.
        is_predicted: Whether a change counts as predicted. MOBIL predicts the changes that its rule accepts; the hazard
            predicts a change if its probability is above the constant rate of the side.
        mobil: The calibrated MOBIL.
        n_fitted_drivers, n_fitted_changes: Number of fitted drivers and of their changes.
        n_recorded: All lane changes in the recordings.
        n_ramp: Lane changes from or to a ramp lane, which are mandatory and not scored.
    """

    table: Opportunities
    chance: dict[str, Float[np.ndarray, " rows"]]
    is_predicted: dict[str, Bool[np.ndarray, " rows"]]
    mobil: CalibratedMobil
    n_fitted_drivers: int
    n_fitted_changes: int
    n_recorded: int
    n_ramp: int

    def strata(self) -> dict[str, Bool[np.ndarray, " rows"]]:
        """Opportunities by side and by urgency.

        Urgency is estimated from the recordings. For discretionary changes it is the speed advantage of the target
        lane, its leader's speed less that of the own leader, with which their rate grows (Laval & Daganzo, Transp. Res.
        B 40 (2006) 251). Changes towards a ramp lane that the driver reaches later are mandatory. Destinations beyond
        the recording are unknown, so mandatory changes of drivers who leave the road later count as discretionary.
        """
        forced, advantage = self.table.is_mandatory, self.table.side_leader_speed - self.table.leader_speed
        return {
            "left": self.table.side < 0,
            "right": self.table.side > 0,
            "no_advantage": ~forced & (advantage <= 0),
            "small_advantage": ~forced & (advantage > 0) & (advantage < LARGE_ADVANTAGE),
            "large_advantage": ~forced & (advantage >= LARGE_ADVANTAGE),
            "mandatory": forced,
        }


def log_loss(chance: Float[np.ndarray, " rows"], changes: Bool[np.ndarray, " rows"]) -> Float[np.ndarray, " rows"]:
    """Negative log-likelihood of each recorded choice [nats]; inf if the model excludes it."""
    with np.errstate(divide="ignore"):
        return -np.where(changes, np.log(chance), np.log1p(-chance))


def seconds_at_risk(table: Opportunities) -> Float[np.ndarray, " rows"]:
    """Time represented by each opportunity [s]; two sides in the same frame share it."""
    moment = np.stack([table.vehicle, table.recording, table.frame])
    _, index, count = np.unique(moment, axis=1, return_inverse=True, return_counts=True)
    return table.period / count[index.ravel()]


def prediction(
    table: Opportunities,
    part: Int[np.ndarray, " rows"],
    hazard: Float[np.ndarray, " rows"],
    confidence: float,
    n_recorded: int,
    n_ramp: int,
) -> Prediction | None:
    """Predictions for the third part of the drivers; None if the fitted or the held-out drivers have too few changes.

    `part` is the part of each opportunity's driver, 0 to 2; drivers of parts 0 and 1 are fitted. `hazard` is the
    probability of a change under the calibrated hazard [-], `confidence` that of the intervals of MOBIL's parameters;
    `n_recorded` and `n_ramp` are as in `Prediction`.
    """
    fitted, held_out = table.take(part < 2), table.take(part == 2)
    if min(fitted.changes.sum(), held_out.changes.sum()) < LEAST_IN_PART:
        return None
    sides = [fitted.changes[fitted.side == side] for side in (-1, 1)]
    left_rate, right_rate = (rate(float(taken.sum()), float(len(taken))) for taken in sides)
    constant = np.where(held_out.side < 0, left_rate, right_rate)
    mobil, original = calibrated_mobil(fitted, confidence), MobilRule()
    chance = {
        BASE_RATE: constant,
        ORIGINAL: original.with_refused(fitted).chance(held_out),
        ORIGINAL_RULE: original.with_rates(fitted).chance(held_out),
        CALIBRATED: mobil.rule.chance(held_out),
        HAZARD: hazard[part == 2],
    }
    chance = {name: np.clip(values, LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY) for name, values in chance.items()}
    return Prediction(
        table=held_out,
        chance=chance,
        is_predicted={
            BASE_RATE: np.zeros(len(constant), bool),
            ORIGINAL: original.accepts(held_out),
            ORIGINAL_RULE: original.accepts(held_out),
            CALIBRATED: mobil.rule.accepts(held_out),
            HAZARD: chance[HAZARD] > constant,
        },
        mobil=mobil,
        n_fitted_drivers=len(np.unique(fitted.vehicle)),
        n_fitted_changes=int(fitted.changes.sum()),
        n_recorded=n_recorded,
        n_ramp=n_ramp,
    )
