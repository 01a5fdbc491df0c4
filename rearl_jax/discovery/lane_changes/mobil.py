"""MOBIL as a choice model: its rule accepts or refuses a change, and accepted and refused changes each have a rate.

If the rule accepts a change, the driver decides every `delay` seconds at an unknown instant, so the probability of a
change within one opportunity is its period / delay. If the rule refuses a change, drivers still change at a small rate,
for reasons outside MOBIL; with a rate of zero, one such change would give the rule a likelihood of zero.

Source: Kesting, Treiber & Helbing, Transp. Res. Rec. 1999 (2007) 86. As in the simulation, the own safety is not
tested; as in the paper, the gains of other drivers are computed with their own parameters. Probability per decision:
Toledo, Koutsopoulos & Ben-Akiva, Transp. Res. Rec. 1857 (2003) 30.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from rearl_jax.config.mobil import MobilConfig
from rearl_jax.discovery.claims import Estimate
from rearl_jax.discovery.lane_changes.opportunities import PERIOD, Opportunities

POLITENESS = np.round(np.arange(0.0, 1.05, 0.1), 2)
"""Tested values of politeness [-]. Source: Kesting et al. (2007): 0 selfish, 1 as much for others as for oneself."""

GAIN_THRESHOLD = np.round(np.arange(-0.5, 2.025, 0.05), 3) + 0.0
"""Tested gain thresholds [m/s^2]; adding 0.0 turns -0.0 into 0.0."""

SAFE_DECEL = np.array([0.25, 0.5, 1.0, 1.5, 2.0])
"""Tested safe decelerations [m/s^2]; changes that require more are not opportunities."""

BIAS = np.round(np.arange(-1.0, 1.05, 0.1), 2) + 0.0
"""Tested biases to the right lane [m/s^2]."""

SPREAD = {"politeness": 0.3, "gain_threshold": 0.3, "safe_decel": 1.0, "bias": 0.3}
"""Prior standard deviation of a parameter around its default [unit of the parameter]; without information in the data
the default is kept. Source: the scales of the effects `politeness` and `keep_right`; the range of published thresholds
is .1 to .6 m/s^2.
"""

UNITS = {"politeness": "-", "gain_threshold": "m/s^2", "safe_decel": "m/s^2", "bias": "m/s^2", "delay": "s"}
"""Units of the parameters."""

LONGEST_DELAY = 3600.0
"""Bound of the time between two decisions [s], as in model files."""

_USUAL = MobilConfig()


@dataclass(frozen=True)
class MobilRule:
    """MOBIL with the rates of accepted and refused changes.

    Attributes:
        politeness: Weight of the followers' gain [-].
        gain_threshold: Least gain of a change [m/s^2].
        safe_decel: Largest deceleration of the new follower [m/s^2].
        bias: Gain of the right lane, loss of the left one [m/s^2].
        delay: Time between two decisions [s].
        refused_chance: Probability within one opportunity of a change that the rule refuses [-].
    """

    politeness: float = _USUAL.politeness
    gain_threshold: float = _USUAL.gain_threshold
    safe_decel: float = _USUAL.safe_decel
    bias: float = 0.0
    delay: float = _USUAL.delay
    refused_chance: float = 0.0

    def accepts(self, table: Opportunities) -> Bool[np.ndarray, " rows"]:
        """True if the rule accepts the change at an opportunity."""
        gain = _gain(table, self.politeness, self.bias)
        return (gain >= self.gain_threshold) & (table.rear_after >= -self.safe_decel)

    def chance(self, table: Opportunities) -> Float[np.ndarray, " rows"]:
        """Probability of a change within one opportunity [-]."""
        return np.where(self.accepts(table), np.minimum(table.period / self.delay, 1.0), self.refused_chance)

    def with_rates(self, table: Opportunities) -> "MobilRule":
        """The rule with the rates observed in these opportunities."""
        accepted = self.accepts(table)
        chance = rate(float(table.changes[accepted].sum()), float(accepted.sum()))
        period = float(table.period.mean()) if len(table.period) else PERIOD
        delay = float(np.clip(period / chance, period, LONGEST_DELAY))
        return replace(self, delay=delay).with_refused(table)

    def with_refused(self, table: Opportunities) -> "MobilRule":
        """The rule and its delay, with the observed probability of refused changes."""
        refused = ~self.accepts(table)
        return replace(self, refused_chance=float(rate(float(table.changes[refused].sum()), float(refused.sum()))))


@dataclass(frozen=True)
class CalibratedMobil:
    """MOBIL calibrated to measured lane changes: the maximum a posteriori rule, and its parameters with intervals, by
    name; the delay has no interval.
    """

    rule: MobilRule
    estimates: dict[str, Estimate]


def calibrated_mobil(table: Opportunities, confidence: float) -> CalibratedMobil:
    """MOBIL calibrated to opportunities: a grid search over its parameters, with the most likely rates at each grid
    point.

    An accepted change must be more likely than a refused one; if no rule on the grid achieves this, the default rule is
    kept. Intervals come from the posterior on the grid at the given confidence. They are somewhat too narrow because
    opportunities of one driver are treated as independent.
    """
    taken, grids = table.changes, (POLITENESS, BIAS, SAFE_DECEL, GAIN_THRESHOLD)
    posterior = np.full([len(grid) for grid in grids], -np.inf)
    for i, politeness in enumerate(POLITENESS):
        for j, bias in enumerate(BIAS):
            gain = _gain(table, float(politeness), float(bias))
            n_thresholds = np.searchsorted(GAIN_THRESHOLD, gain, side="right")  # thresholds that the gain reaches
            for k, safe_decel in enumerate(SAFE_DECEL):
                reached = np.where(table.rear_after >= -safe_decel, n_thresholds, 0)
                posterior[i, j, k] = _likelihood(reached, taken)
    axes = dict(zip(("politeness", "bias", "safe_decel", "gain_threshold"), grids, strict=True))
    prior_mean = MobilRule()
    for axis_number, (name, values) in enumerate(axes.items()):
        prior = -0.5 * ((values - getattr(prior_mean, name)) / SPREAD[name]) ** 2
        posterior += prior.reshape([-1 if axis == axis_number else 1 for axis in range(len(axes))])
    if not np.isfinite(posterior).any():
        rule = prior_mean.with_rates(table)
        return CalibratedMobil(rule, {name: Estimate(getattr(rule, name), None, None, UNITS[name]) for name in UNITS})
    best = np.unravel_index(int(np.argmax(posterior)), posterior.shape)
    values = {name: float(grid[place]) for (name, grid), place in zip(axes.items(), best, strict=True)}
    rule = replace(prior_mean, **values).with_rates(table)
    weight = np.exp(posterior - posterior.max())
    estimates = {}
    for axis_number, (name, grid) in enumerate(axes.items()):
        marginal = weight.sum(axis=tuple(axis for axis in range(len(axes)) if axis != axis_number))
        share = np.cumsum(marginal) / marginal.sum()
        cells = np.concatenate([grid[:1], (grid[1:] + grid[:-1]) / 2, grid[-1:]])  # no interval is finer than the grid
        first, last = (min(int(np.searchsorted(share, (1 + sign * confidence) / 2)), len(grid) - 1) for sign in (-1, 1))
        estimates[name] = Estimate(values[name], float(cells[first]), float(cells[last + 1]), UNITS[name])
    estimates["delay"] = Estimate(rule.delay, None, None, UNITS["delay"])
    return CalibratedMobil(rule, {name: estimates[name] for name in UNITS})


def _gain(table: Opportunities, politeness: float, bias: float) -> Float[np.ndarray, " rows"]:
    """Gain of a change, to be compared with the threshold [m/s^2]."""
    return table.incentive + politeness * (table.rear_gain + table.follower_gain) + bias * table.side


def _likelihood(reached: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """Log-likelihood under each of GAIN_THRESHOLD, ascending [nats]; -inf if accepted changes are not more frequent
    than refused ones. `reached` is the number of thresholds that each opportunity's gain reaches.
    """
    size = len(GAIN_THRESHOLD) + 1
    # A gain that reaches n thresholds is accepted under the first n of them, so sums run from the largest n down.
    n_accepted = np.bincount(reached, minlength=size)[::-1].cumsum()[::-1][1:]
    taken_accepted = np.bincount(reached, taken, size)[::-1].cumsum()[::-1][1:]
    n_refused, taken_refused = len(taken) - n_accepted, taken.sum() - taken_accepted
    often, seldom = rate(taken_accepted, n_accepted), rate(taken_refused, n_refused)
    value = taken_accepted * np.log(often) + (n_accepted - taken_accepted) * np.log1p(-often)
    value += taken_refused * np.log(seldom) + (n_refused - taken_refused) * np.log1p(-seldom)
    return np.where((often > seldom) & (taken_accepted > 0), value, -np.inf)


def rate(changes: np.ndarray | float, opportunities: np.ndarray | float) -> np.ndarray | float:
    """Estimated probability of a change [-] under Jeffreys' prior; never 0 or 1."""
    return (changes + 0.5) / (opportunities + 1.0)
