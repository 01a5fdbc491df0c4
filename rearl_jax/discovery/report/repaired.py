"""The repaired model (with the missing effects added), in the format of model.yaml, which every task can load."""

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
    """The driver model as content of model.yaml. Artefacts of the measurement, and lane-choice dependences without an
    effect in the library (`core.effects`), are not part of a model.

    Args:
        calibrated: The model without the effects found by the search.
        repaired: The model with them.
        data: The drivers to whom both were fitted.
        layout: Layout of the candidates' parameters.
        data_id: Identity of the data.
        study: Name of the study.
        lane_changes: Confirmed effects of lane changes, part of both models.
        added: Effects found by the search.
        lane_choice: Findings on lane choice, with MOBIL if it was calibrated; None if lane choice was not analysed.
        variation: Division of the acceleration residual into noise and variation of the time gap.
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
    """Drivers by class, with the mean and covariance of the calibrated drivers.

    The covariance is that of the estimates plus the mean variance of their errors, because parameters with little
    information are shrunk to the mean and scatter less than drivers do. Source: law of total variance.
    """
    state, truck, classes = fit.state, fit.state.truck, {}
    lengths = data.driver_values(data.length)
    unit = prior.spread
    for class_number, (name, median) in enumerate(zip((CAR, TRUCK), prior.usual, strict=True)):
        members = truck == class_number
        share = float(members.mean())
        if share < THRESHOLDS.least_truck_share:
            continue
        away = state.away[members] * unit
        covariance = away.T @ away / members.sum() + np.diag(state.own_variance[members].mean(axis=0) * unit**2)
        classes[name] = DriverClass(
            share=share,
            log_mean=dict(zip(prior.names, (np.log(median) + unit * state.mean[class_number]).tolist(), strict=True)),
            log_covariance=((covariance + covariance.T) / 2).tolist(),
            noise_sd=fit.noise.acceleration,
            noise_time=fit.noise.time,
            length=float(lengths[members].mean()),
            length_sd=float(lengths[members].std()),
        )
    total = sum(members.share for members in classes.values())
    return {name: replace(members, share=members.share / total) for name, members in classes.items()}


def effect_values(candidate: Candidate, theta: np.ndarray, layout: Layout) -> EffectValues:
    """The library effect equivalent to a candidate, with its elements of `theta` (parameters of all candidates).
    `early_response` replaces `early_leader`, which needs the future of a recording.
    """
    effect = candidate.term.effect
    if candidate.term == EARLY_LEADER:
        names = {"of_changer": "of_changer", "of_follower": "of_follower", "limit": "braking_limit"}
        parameters = {
            each.name: float(np.clip(theta[layout.places[f"early_leader.{names[each.name]}"][0]], each.low, each.high))
            for each in EFFECTS["early_response"].parameters
        }
        return EffectValues("early_response", parameters)
    if candidate.term.is_effect:
        names = [parameter.name for parameter in EFFECTS[effect].parameters]
        return EffectValues(effect, dict(zip(names, (float(theta[place]) for place in candidate.free), strict=True)))
    (variable,) = candidate.variables
    values = theta[list(candidate.free)]
    if variable == "position":
        knots, centre = layout.knots.position, layout.knots.position_centre
    else:
        knots, centre = layout.knots.curve[variable], layout.knots.centre[variable]
    # The weights of the knots sum to 1, so a curve less its mean is the curve of the values less that mean.
    values = values - values @ np.asarray(centre)
    parameters = {"values": values.tolist(), "knots": np.asarray(knots).tolist()}
    return EffectValues(effect, parameters, variable)


def lane_change_values(prediction: Prediction) -> LaneChangeValues:
    """Calibrated parameters of MOBIL, without the rate of refused changes."""
    rule = prediction.mobil.rule
    return LaneChangeValues(**{name: float(getattr(rule, name)) for name in LANE_CHANGE_BOUNDS})


def lane_effect_values(effect: Claim) -> EffectValues:
    """The library effect of a lane-choice claim, within the effect's bounds; parameters not estimated have their
    defaults.
    """
    values = {}
    for parameter in EFFECTS[effect.name].parameters:
        is_estimated = parameter.name in effect.parameters
        value = effect.parameters[parameter.name].value if is_estimated else parameter.off
        values[parameter.name] = float(np.clip(value, parameter.low, parameter.high))
    return EffectValues(effect.name, values)
