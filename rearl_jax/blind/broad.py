"""Data sets drawn from broad priors, from the generator of this package or from SUMO.

A data set that is not plausible traffic (see `traffic.plausibility`), or in which the hidden effect does not act, is
drawn again; the truth, the record of what is hidden in a data set, contains how often and why.
"""

from collections import Counter
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rearl_jax.blind.cases import Case
from rearl_jax.blind.sumo import EFFECTS, LIMIT, MODELS, TRUTHS, Rules, simulate_sumo
from rearl_jax.blind.traffic.chain import release
from rearl_jax.blind.traffic.dataset import hidden_truth, write_tables
from rearl_jax.blind.traffic.drawing import SUMO_BASES, draw_scenario
from rearl_jax.blind.traffic.plausibility import REASONS, fault_of
from rearl_jax.blind.traffic.priors import PRIORS
from rearl_jax.blind.traffic.scenario import Scenario
from rearl_jax.blind.traffic.simulation import Events, simulate

MOST_ATTEMPTS = 60
"""Attempts after which a data set is given up."""

MANY_CHANGES = 0.8
"""Lane changes per follower and minute from which a data set has many."""


@dataclass(frozen=True)
class Drawn:
    """A data set that is plausible traffic.

    Attributes:
        scenario: Its scenario.
        events: Its motion.
        rules: Rules of SUMO; None with the generator's own models.
        redraws: Number of rejected attempts by reason.
    """

    scenario: Scenario
    events: Events
    rules: Rules | None
    redraws: dict[str, int]


def draw_traffic(case: Case) -> Drawn:
    """The first plausible traffic drawn for a data set.

    Raises:
        ModuleNotFoundError: libsumo is not installed.
        RuntimeError: No attempt was plausible.
    """
    priors, redraws = PRIORS.widened(case.width), Counter[str]()
    fixed = {name: case.changes.get(name) for name in ("followers", "duration")}
    for attempt in range(MOST_ATTEMPTS):
        scenario = draw_scenario(priors, case.planted, case.base, case.seed, attempt, **fixed)  # type: ignore[arg-type]
        is_sumo = case.base in SUMO_BASES
        events, rules = _by_sumo(case, scenario) if is_sumo else (simulate(scenario), None)
        fault = fault_of(scenario, events)
        if fault is None:
            return Drawn(scenario, events, rules, {reason: redraws[reason] for reason in REASONS})
        redraws[fault] += 1
    raise RuntimeError(f"data set {case.name}: no traffic in {MOST_ATTEMPTS} attempts ({dict(redraws)})")


def write_broad(case: Case, folder: Path) -> None:
    """Writes one canonical table per recording."""
    drawn = draw_traffic(case)
    assert drawn.scenario.chain is not None
    write_tables(folder, drawn.scenario, drawn.events, release(drawn.scenario, drawn.scenario.chain, drawn.events))


def broad_truth(case: Case) -> dict[str, Any]:
    """The truth of a data set: hidden effect, car-following model, drivers, measurement, traffic."""
    drawn = draw_traffic(case)
    scenario, events = drawn.scenario, drawn.events
    if drawn.rules is None:
        truth = hidden_truth(scenario, events)
    else:
        planted = [_planted_in_sumo(item.name, drawn.rules) for item in scenario.planted]
        # Vehicles of SUMO have one lane each here; interventions against collisions are not counted.
        truth = {"planted": planted, "n_lane_changes": 0, "n_emergencies": 0}
    followers = events.fleet.rank > 0
    is_recorded = (events.time >= 0.0) & (events.time <= scenario.duration)
    lane_steps = np.diff(events.lane[is_recorded], axis=0)[:, followers]
    changes = float(np.count_nonzero(lane_steps) / (np.count_nonzero(followers) * scenario.duration / 60.0))
    scenario_fields = asdict(scenario)
    del scenario_fields["planted"], scenario_fields["base"]
    return truth | {
        "base": case.base,
        "width": case.width,
        "is_smoothed": scenario.chain is not None and scenario.chain.kernel != "none",
        "lane_changes_per_minute": changes,
        "has_many_changes": changes >= MANY_CHANGES,
        "mean_speed": float(events.speed[is_recorded][:, followers].mean()),
        "effect_size": events.effect_size,
        "redraws": drawn.redraws,
        "scenario": scenario_fields,
    }


def _by_sumo(case: Case, scenario: Scenario) -> tuple[Events, Rules]:
    """The traffic, and the rules in force. The size of an effect is here the root mean square difference [m/s^2] of the
    accelerations with and without the rule, so that it contains how far the two simulations drift apart; it is not
    comparable with sizes in traffic of the project's own generator.
    """
    names = {item.name for item in case.planted}
    rules = Rules(
        MODELS[case.base.removeprefix("sumo_")],
        overtake_right=0 if "no_undertaking" in names else 1,
        limit=LIMIT if "speed_limit" in names else None,
    )
    events, in_force = simulate_sumo(replace(scenario, planted=()), rules, is_moved=True)
    if names:
        without_effect, _ = simulate_sumo(replace(scenario, planted=()), Rules(rules.model))
        is_recorded = (events.time >= 0.0) & (events.time <= scenario.duration)
        difference = (events.acceleration - without_effect.acceleration)[is_recorded][:, events.fleet.rank > 0]
        events = replace(events, effect_size=float(np.sqrt(np.mean(difference**2))))
    return events, in_force


def _planted_in_sumo(name: str, rules: Rules) -> dict[str, Any]:
    """Entry of the truth for an effect that a rule of SUMO causes."""
    entry = {"name": name, "strength": 1.0, "variables": [], "parameters": {}} | TRUTHS[EFFECTS[name]]
    if rules.limit is not None:
        start, end = rules.section
        entry["parameters"] = {"limit": rules.limit, "start": start, "end": end}
    return entry
