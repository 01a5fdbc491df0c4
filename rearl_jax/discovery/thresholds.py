"""Thresholds of discovery: every number that decides what is claimed, in one record.

The record is written into verdict.json, and its hash into the protocol of a blind study, so that no threshold can be
tuned to data without notice. Constants of the computation that decide no claim (knots, iterations, search grids) are
defined where they are used.
"""

import ast
import hashlib
import json
from dataclasses import asdict, dataclass
from inspect import getsource


@dataclass(frozen=True)
class Thresholds:
    """Limits for reading, fitting, accepting and claiming; chosen by this project where no source is given."""

    shortest_record: float = 6.0
    """Shortest piece (uninterrupted part of a track) that is used [s]."""

    least_used_time: float = 4.0
    """Smallest usable time behind a leader in a piece [s]."""

    least_drivers: int = 9
    """Smallest number of drivers, because models are fitted, checked and reported on different drivers."""

    least_part_filled: float = 0.7
    """Smallest size of a part of the drivers, as a share of its target, for a split by whole persons, cars or
    recordings [-].
    """

    columns_z_score: float = 5.0
    """Standard deviations of a lag or scale error between positions and speeds, above which they disagree [-]."""

    least_lag: float = 0.15
    """Smallest lag between positions and speeds that is reported [s]."""

    least_scale_error: float = 0.015
    """Smallest relative difference between speeds and the derivative of positions that is reported [-]."""

    sensor_roughness: float = 0.5
    """Standard deviation of the high-frequency part of integrated speeds, as a share of that of positions, up to which
    speeds are the better measurement of motion within seconds [-].
    """
    sensor_own_share: float = 0.5
    """Share of the variance of the high-frequency part of integrated speeds that no filter of the positions explains,
    above which speeds count as measured independently [-].
    """
    noisy_positions: float = 0.25
    """Standard deviation of positions [m] above which they are reported as noisy; cameras over motorways reach 0.1 to
    0.2 or better (highD, pNEUMA).
    """

    kernel_evidence: float = 15.0
    """Gain of log-likelihood of the spectrum, relative to the misfit that is left, above which a smoothing kernel is
    assumed [nats]. In 23 generated data sets without a kernel the gain was at most 4.
    """

    least_spectrum_windows: int = 10
    """Smallest number of windows from which the spectrum of the accelerations is computed."""

    lasting_noise_gain: float = 5.0
    """Gain of log-likelihood [nats] above which position errors are modelled as correlated in time."""

    independent_observations: float = 60.0
    """Typical number of independent observations of one parameter; half its logarithm is the complexity penalty of a
    parameter with an uninformative prior. Source: Schwarz, Ann. Stat. 6 (1978) 461.
    """

    least_null_mean: float = -3.0
    """Lower bound of the mean of the evidence for a candidate if no effect is missing (null distribution) [nats]."""

    least_null_spread: float = 1.0
    """Lower bound of the standard deviation of this evidence [nats]: few replicates could otherwise give too small a
    spread.
    """

    base_confidence: float = 0.99
    """Share of resamples of drivers [-] in which a car-following model must be more likely than that of the key
    `driver` to replace it, and in which its error must exceed `base_error_share` for simulations to reject it. Several
    models are compared with the best one under up to three protocols, so 0.95 would often reject one by chance.
    """

    least_base_gain: float = 16.0
    """Gain of log-likelihood of the check drivers [nats] that a replacing model must exceed, because few drivers may
    agree by chance.
    """

    doubtless_base_gain: float = 5.0
    """Gain, in standard deviations over resamples of drivers, beyond which a model replaces that of the key `driver`
    although its simulations are probably worse [-].
    """

    base_error_share: float = 0.05
    """Relative amount by which the mean gap error of a replacing model, with parameters of the population or of the
    first half of a drive, may exceed that of the best model [-].
    """

    candidate_z_score: float = 4.5
    """Standard deviations above the null mean at which the evidence for a candidate exceeds chance [-]."""

    fitting_excess: float = 2.0
    """Excess (evidence above the null mean) [nats] at which a leading candidate is fitted even below
    `candidate_z_score`.
    """

    leading_fitted: int = 5
    """Number of candidates with the largest excess that are fitted, if it is above `fitting_excess`."""

    most_effects: int = 3
    """Largest number of car-following effects that are added one after the other."""

    most_from_one_driver: float = 12.0
    """Bound of one driver's contribution to a gain per minute [nats], so that no single driver decides; drives under a
    minute have the bound of a minute.
    """

    least_gain: float = 3.0
    """Gain of the fitted drivers, less the complexity penalty, that a candidate must exceed [nats]."""

    least_total: float = 16.0
    """Total (gains of fitted and check drivers, less penalty and null mean) that a candidate must exceed [nats]."""

    worst_check: float = -3.0
    """Gain of the check drivers that a candidate must exceed [nats]; at lower values they contradict it."""

    total_below_z_score: float = 25.0
    """Total [nats] above which a candidate is accepted although its evidence is below `candidate_z_score`."""

    indistinct_total: float = 5.0
    """Difference of totals [nats] within which candidates of car following count as indistinguishable."""

    freedom_price: float = 3.0
    """Additional penalty of free curves, and of artefacts with one parameter per vehicle, for their flexibility [nats].
    """

    later_share: float = 0.05
    """Smallest total of an effect added after other ones, as a share of the largest total of these [-], because every
    approximate form leaves a remainder.
    """

    confounded_share: float = 0.25
    """Smallest total of an effect that may be a remainder of another one, as a share of the other's total [-]."""

    clock_lead: float = -5.0
    """Gain of clock offsets minus the gain of independent shifts of every leader-follower pair, all drivers together,
    that must be exceeded [nats]. In eight generated data sets with clock offsets the difference was -3 to 75; where
    wrong leader lengths or SUMO's CACC look like clock offsets it was -7 and -12.
    """

    borne_growth: float = 0.02
    """Tolerated growth of the squared closed-loop error by a candidate [-], 1 % of the error."""
    contradiction_share: float = 0.8
    """Share of resamples of drivers in which simulations must become worse to contradict a candidate [-]."""

    rejection_share: float = 0.95
    """Share of resamples of drivers in which the closed-loop error must be larger for an addition to be rejected
    [-].
    """

    prediction_share: float = 0.95
    """Share of resamples of check drivers [-] in which the mean gap error must become smaller under the only protocol
    that predicts; with several, a higher share under one of them. It is required of added effects if they do not
    explain the drivers.
    """

    variation_z_score: float = 2.0
    """Standard errors by which a time gap that varies within a driver must lower the logarithm of the energy score [-];
    otherwise time gaps are constant.
    """

    widest_response_time: float = 1.0
    """Width of the interval of a response time above which it is not identified [s]."""

    simulated_memory: float = 15.0
    """Time after which errors of a simulation are independent of earlier ones [s]."""

    leading_simulated: int = 5
    """Number of supported candidates, those with the largest totals, that are simulated."""

    most_kurtosis: float = 0.1
    """Excess kurtosis of the innovations above which discontinuous behaviour remains [-]."""

    kurtosis_z_score: float = 4.5
    """Limit of the same in standard deviations of the kurtosis of normal innovations [-]; the larger limit holds."""

    kurtosis_left: float = 0.6
    """Share of the excess kurtosis that may remain after effects are added [-]; a correct effect removes most of it, a
    wrong one does not.
    """

    growth_z_score: float = 3.5
    """Standard deviations above which noise grows with the response to a misjudged gap or an old decision [-]. On 26
    generated data sets with neither, values up to 3.3 occurred, the largest with free lane changes; on ten data sets
    with one of them, 5.3 or more with 72 drivers and 3.7 or more with 24.
    """

    growth_per_root_minute: float = 0.25
    """Limit of the same growth divided by the root of the driver-minutes [1/min^0.5], because with enough data any
    small difference becomes significant; the larger limit holds. A modelled delay leaves 0.2 with 138 drivers of 5 min;
    distraction, the weakest effect to be flagged, leaves 0.41 to 0.53.
    """

    growth_beside_clocks: float = 1.75
    """Limit of the same growth after clock offsets were corrected, which old decisions can imitate [-]. Eleven
    generated data sets with clock offsets left up to 0.8; distraction, SUMO's CACC and SUMO's Krauss model, mistaken
    for clock offsets, left 2.4 to 5.
    """

    most_autocorrelation: float = 0.1
    """Difference between the correlation of neighbouring innovations and that by noise alone, above which the model
    does not describe the drives [-]. Of 66 generated data sets without smoothing, where noise alone gives none, 65 were
    between -0.04 and 0.04; in the other, drivers do not react to their leader. Smoothing by 0.2 to 0.7 s alone gives a
    correlation of 0.14 to 0.3.
    """

    whole_acceleration: float = 1.0
    """Share of the leader's acceleration [-]: if drivers seem to add this share or more to their own acceleration at
    once, the cause is taken to be an error that the positions of both vehicles share.
    """

    unexplained_z_score: float = 8.0
    """Standard deviations above the null mean at which an effect is missing even if no candidate fits it [-]."""

    doubtful_confidence: float = 0.5
    """Upper bound of the confidence in an effect if a dependence on its variables, or more than noise, remains [-].
    """

    least_confidence: float = 0.05
    """Lowest confidence of a stated effect [-]; with a lower one, another candidate is far more likely."""

    most_confidence: float = 0.98
    """Upper bound of a stated confidence [-], as reached by the procedure on generated data."""

    interval_stretch: float = 1.75
    """Factor by which intervals of parameters are widened [-], because errors of the driver model also shift
    parameters. Of 59 true values in generated data, 83 % were inside 90 % intervals with a factor of 1.5, and two
    thirds of 46 with a factor of 1.
    """

    vehicle_lag: float = 0.3
    """Lag that pedals, engine and brakes may cause [s]: a delay that is not longer is not claimed as a reaction time.
    Drivers need at least twice as long (Green, Transp. Human Factors 2 (2000) 195: 0.7 s when they expect to brake).
    """

    least_delay: float = 2.0
    """Shortest reaction delay that is claimed [time steps], because a decision that is carried out one time step later
    looks like a delay.
    """

    delay_deviation: float = 0.15
    """Standard deviation of a delay from time discretisation alone [time steps]; with time steps of 0.1 s, delays of
    0.35 and 0.7 s were estimated 0.01 to 0.04 s too short.
    """

    finder_evidence: float = 3.0
    """Evidence [nats] above the logarithm of the number of curves at which the open-ended finder selects a curve."""

    stable_share: float = 0.8
    """Share of the halves of the drivers above which a variable counts as influential [-]."""

    least_kinds_gain: float = 10.0
    """Evidence [nats] above that for one kind of driver at which several kinds are stated. Among generated single-kind
    populations, only skewed or heavy-tailed ones exceeded 9.
    """

    most_kinds_chance: float = 0.05
    """Largest share of simulated single-kind data sets with as much evidence for several kinds [-]."""

    least_distinctness: float = 0.9
    """Smallest share of the drivers of a kind who would be assigned to it if their parameters were known exactly [-];
    two parts of one wide or skewed population reach less.
    """

    least_membership: float = 0.8
    """Probability of belonging to a kind above which a driver is assigned to it [-]."""

    least_truck_share: float = 0.02
    """Smallest share of trucks that form a separate class in the repaired model [-]."""

    least_identified: float = 0.2
    """Share of the variance between drivers that one driver's data must remove for a parameter to count as identified
    [-].
    """
    most_at_bound: float = 0.1
    """Share of drivers at a bound of a parameter above which its values are reported as determined by the bound [-]."""
    least_leader_changes: int = 10
    """Changes of leader at which early response to the next leader and relaxation become part of the calibrated model.
    """

    least_lane_changes: int = 150
    """Lane changes below which lane choice is not analysed."""

    least_lane_changes_in_part: int = 25
    """Lane changes in each part of the drivers (fitted, check, report) below which lane choice is not analysed."""

    own_gain_z_score: float = 3.0
    """Standard deviations by which the acceleration that drivers gain by a change must raise its probability [-];
    otherwise changes do not count as discretionary.
    """

    lane_false_rate: float = 0.01
    """Probability that any candidate of lane choice passes the score test if none has an influence [-] (Bonferroni)."""

    lane_check_quantile: float = 0.05
    """Quantile of the resampled gain on held-out drivers that must be above 0 [-]."""

    most_lane_effects: int = 3
    """Largest number of lane-choice effects that are added."""

    later_lane_total: float = 12.0
    """Smallest total of a further lane-choice effect, added after the first one [nats]."""

    later_lane_share: float = 0.1
    """Smallest total of a further lane-choice effect as a share of the first one's total [-]."""

    indistinct_lane_total: float = 5.0
    """Difference of totals [nats] within which candidates of lane choice count as indistinguishable."""

    def plain(self) -> dict[str, float]:
        """Name and value of every threshold, as in verdict.json."""
        return asdict(self)

    def fingerprint(self) -> str:
        """Hash of all names and values, the first 16 hexadecimal digits of SHA-256."""
        return hashlib.sha256(json.dumps(self.plain(), sort_keys=True).encode()).hexdigest()[:16]


THRESHOLDS = Thresholds()
"""The thresholds in use."""


def meanings() -> dict[str, str]:
    """Meaning of every threshold, from the text below its field."""
    (record,) = ast.parse(getsource(Thresholds)).body
    assert isinstance(record, ast.ClassDef)
    texts = {}
    for statement, below in zip(record.body, record.body[1:], strict=False):  # nothing is below the last statement
        if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            assert isinstance(below, ast.Expr)
            assert isinstance(below.value, ast.Constant)
            texts[statement.target.id] = " ".join(str(below.value.value).split())
    return texts
