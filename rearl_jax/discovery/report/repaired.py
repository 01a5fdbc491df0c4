"""The repaired model, in the format that every task can load."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rearl_jax.code_version import __version__
from rearl_jax.core.effects import EFFECTS
from rearl_jax.discovery.claims import Claim
from rearl_jax.discovery.lane_changes import LaneChangeFindings
from rearl_jax.discovery.lane_changes.prediction import Prediction
from rearl_jax.discovery.observe.candidates import EARLY_LEADER, Candidate, Layout
from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.fit import Fit
from rearl_jax.discovery.read.measured import Measured
from rearl_jax.discovery.search.decision import Trial
from rearl_jax.discovery.search.headway import CONSTANT_TIME_GAP, TimeGapVariation
from rearl_jax.discovery.thresholds import THRESHOLDS
from rearl_jax.models.record import (
    CAR,
    LANE_CHANGE_BOUNDS,
    TRUCK,
    DriverClass,
    EffectValues,
    LaneChangeValues,
    RepairedModel,
    Source,
)


def repaired_model(
    *,
    calibrated: Fit,
    repaired: Fit,
    data: Measured,
    layout: Layout,
    data_id: str,
    study: str,
    lane_changes: Sequence[Trial] = (),
    added: Sequence[Trial] = (),
    lane_choice: LaneChangeFindings | None = None,
    variation: TimeGapVariation = CONSTANT_TIME_GAP,
) -> RepairedModel:
    """The driver model without (`calibrated`) and with (`repaired`) the identified effects (`added`).

    The model also contains the confirmed effects of lane changes (`lane_changes`) and MOBIL if it was calibrated
    (`lane_choice`; None if lane choice was not analysed). Artefacts and lane-choice dependences without a library
    effect are not part of a model. The acceleration residual is divided into noise and time-gap variation according to
    `variation`.
    """
    effects = [
        effect_values(trial.candidate, repaired.state.theta, layout)
        for trial in (*lane_changes, *added)
        if trial.candidate.kind != "artefact"
    ]
    prediction = None if lane_choice is None else lane_choice.prediction
    claims = () if lane_choice is None else lane_choice.effects
    effects += [lane_effect_values(effect) for effect in claims if effect.name in EFFECTS]
    if variation.sd:
        values = {"sd": variation.sd, "time": variation.time, "start_share": variation.start_share}
        effects.append(EffectValues("time_gap_variation", values))
    noise = replace(repaired.noise, acceleration=variation.noise_share * repaired.noise.acceleration)
    return RepairedModel(
        source=Source(data_id, study, __version__),
        population=population(replace(repaired, noise=noise), data, layout.prior),
        baseline=population(calibrated, data, layout.prior),
        effects=tuple(effects),
        car_following=layout.prior.name,
        lane_changing=None if prediction is None else lane_change_values(prediction),
    )


def population(fit: Fit, data: Measured, prior: Prior) -> dict[str, DriverClass]:
    """Drivers by class, with the mean and standard deviation of the calibrated drivers."""
    state, truck, classes = fit.state, fit.state.truck, {}
    lengths = np.zeros(data.n_drivers)
    lengths[data.driver] = data.length
    unit, spread = prior.spread, prior.spread * state.spread
    for number, (name, median) in enumerate(zip((CAR, TRUCK), prior.usual, strict=True)):
        members = truck == number
        share = float(members.mean())
        if share < THRESHOLDS.least_truck_share:
            continue
        away = state.away[members] * unit
        # Parameters with little information scatter less than drivers do, so the missing variance is taken from the
        # prior.
        own = away.T @ away / max(members.sum(), 1)
        covariance = own + np.diag(np.maximum(spread**2 - np.diag(own), 0.0)) * _unknown(fit, members)
        classes[name] = DriverClass(
            share=share,
            log_mean=dict(zip(prior.names, (np.log(median) + unit * state.mean[number]).tolist(), strict=True)),
            log_covariance=((covariance + covariance.T) / 2).tolist(),
            noise_sd=fit.noise.acceleration,
            noise_time=fit.noise.time,
            length=float(lengths[members].mean()),
            length_sd=float(lengths[members].std()),
        )
    total = sum(members.share for members in classes.values())
    return {name: replace(members, share=members.share / total) for name, members in classes.items()}


def _unknown(fit: Fit, members: np.ndarray) -> np.ndarray:
    """Mean share of each parameter's prior variance that remains after the data [-]."""
    assert fit.state.sums is not None
    n_own = fit.state.z.shape[1]
    gram = fit.state.sums.gram[members][:, :n_own, :n_own] / fit.state.variances[members, None, None]
    remaining = np.einsum("dii->di", np.linalg.inv(gram + fit.state.precision)) / fit.state.spread**2
    return np.clip(remaining.mean(axis=0), 0.0, 1.0)


def effect_values(candidate: Candidate, theta: np.ndarray, layout: Layout) -> EffectValues:
    """The library effect equivalent to a candidate; `early_response` replaces `early_leader`."""
    effect = candidate.term.effect
    if candidate.term == EARLY_LEADER:
        parameters = {parameter.name: parameter.off for parameter in EFFECTS["early_response"].parameters}
        for name in ("of_changer", "of_follower"):
            parameters[name] = float(np.clip(theta[layout.places[f"early_leader.{name}"][0]], 0.0, 1.0))
        return EffectValues("early_response", parameters)
    if candidate.term.is_effect:
        names = [parameter.name for parameter in EFFECTS[effect].parameters]
        return EffectValues(effect, dict(zip(names, (float(theta[p]) for p in candidate.free), strict=True)))
    (variable,) = candidate.variables
    values = theta[list(candidate.free)]
    if variable == "position":
        knots, centre = layout.knots.position, np.zeros(len(values))
    else:
        knots, centre = layout.knots.curve[variable], layout.knots.centre[variable]
    # Weights sum to 1, so a curve less its mean is the curve of the values less that mean.
    values = values - values @ np.asarray(centre)
    parameters = {"values": values.tolist(), "knots": np.asarray(knots).tolist()}
    return EffectValues(effect, parameters, variable)


def lane_change_values(prediction: Prediction) -> LaneChangeValues:
    """Calibrated parameters of MOBIL, without the rate of refused changes."""
    rule = prediction.mobil.rule
    return LaneChangeValues(**{name: float(getattr(rule, name)) for name in LANE_CHANGE_BOUNDS})


def lane_effect_values(effect: Claim) -> EffectValues:
    """The library effect of a lane-choice claim, within its bounds; defaults for parameters not estimated."""
    values = {}
    for known in EFFECTS[effect.name].parameters:
        value = effect.parameters[known.name].value if known.name in effect.parameters else known.off
        values[known.name] = float(np.clip(value, known.low, known.high))
    return EffectValues(effect.name, values)
