"""Ten effects of behaviour beyond the car-following model, each at a strength that the literature calls usual.

An effect changes what a driver senses (`sense`), the desired time gap (`time_gap`), the acceleration (`add`), or when
a new acceleration is set (`hold`). Strengths of drivers differ by 15 per cent (lognormal) around the stated one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .drivers import lognormal

if TYPE_CHECKING:
    from .traffic import Traffic, View

SPREAD = 0.15


class Effect:
    """No effect, and the interface of the others. `strength` is in the unit that `unit` names."""

    name = "none"
    strength = 0.0
    unit = ""
    says = "control: the car-following model and lane changes alone"
    remembers = 0.0  # seconds of past positions that the effect needs

    def prepare(self, traffic: Traffic, rng: np.random.Generator) -> None:
        """Draw the strength of each driver."""
        n = len(traffic.drivers)
        self.of = self.strength * lognormal(rng, 1.0, SPREAD, n) if self.strength else np.zeros(n)

    def sense(self, traffic: Traffic, view: View) -> None:
        """Change gap and leader's speed as sensed, in place."""

    def time_gap(self, traffic: Traffic, view: View) -> np.ndarray | float:
        """Factor on the desired time gap."""
        return 1.0

    def add(self, traffic: Traffic, view: View, acc: np.ndarray) -> np.ndarray:
        """Change the acceleration that the car-following model demands."""
        return acc

    def hold(self, traffic: Traffic, who: np.ndarray, acc: np.ndarray) -> np.ndarray:
        """Change the acceleration that is set, after noise of the driver."""
        return acc


class ReactionDelay(Effect):
    """The leader is sensed late, own speed and place at once; drivers take the leader to go on at the speed they saw.

    Treiber, Kesting & Helbing (2006), Delays, inaccuracies and anticipation, Physica A 360; Ahmed (1999): medians of
    0.6 to 1.2 s.
    """

    name, strength, unit = "reaction_delay", 0.6, "s"
    says = "the leader is sensed 0.6 s late, and its place extrapolated at the speed that was sensed"
    remembers = 1.7

    def sense(self, traffic: Traffic, view: View) -> None:
        has = view.lead >= 0
        late = np.minimum(self.of[view.veh[has]], 1.5)
        x_lead, v_lead = traffic.past(view.lead[has], late)
        _, v_before = traffic.past(view.lead[has], late + traffic.setting.dt)
        length = traffic.drivers.length[view.lead[has]]
        view.gap[has] = x_lead + v_lead * late - length - traffic.x[view.veh[has]]
        view.vl[has], view.al[has] = v_lead, (v_lead - v_before) / traffic.setting.dt


class SecondLeader(Effect):
    """Acceleration towards the speed of the second vehicle ahead.

    Hoogendoorn, Ossen & Schreuder (2006), Empirics of multianticipative car-following behavior, TRR 1965; Lenz, Wagner
    & Sollacher (1999), Eur. Phys. J. B 7.
    """

    name, strength, unit = "second_leader", 0.2, "1/s"
    says = "acceleration of 0.2/s times the speed difference to the second leader, if it is within 100 m"

    def add(self, traffic: Traffic, view: View, acc: np.ndarray) -> np.ndarray:
        second = view.ahead(2)
        has = second >= 0
        k = np.where(has, second, 0)
        gap = traffic.x[k] - traffic.drivers.length[k] - traffic.x[view.veh]
        near = has * np.clip((100.0 - gap) / 30.0, 0.0, 1.0)
        return acc + near * self.of[view.veh] * (traffic.v[k] - traffic.v[view.veh])


class Asymmetry(Effect):
    """Closing in is answered more strongly than falling back.

    Newell (1965), Instability in dense highway traffic; Gong, Liu & Wang (2008), Asymmetric full velocity difference
    model, Physica A 387; Yeo & Skabardonis (2009), ISTTT 18.
    """

    name, strength, unit = "asymmetry", 0.3, "1/s"
    says = "within 70 m, acceleration of 0.3/s times the speed difference when closing in, a sixth of it otherwise"

    def add(self, traffic: Traffic, view: View, acc: np.ndarray) -> np.ndarray:
        dv = np.where(view.lead >= 0, view.vl - traffic.v[view.veh], 0.0)
        near = np.clip((70.0 - view.gap) / 30.0, 0.0, 1.0)
        return acc + near * self.of[view.veh] * np.where(dv < 0, dv, dv / 6.0)


class BrakeLights(Effect):
    """The leader's braking itself is answered, before the speeds differ.

    Knospe et al. (2002), Phys. Rev. E 65 (brake lights); Helly (1959) (leader's acceleration in car following).
    """

    name, strength, unit = "brake_lights", 0.4, "-"
    says = "0.4 times the leader's deceleration is added if that exceeds 0.2 m/s^2 within 60 m"

    def add(self, traffic: Traffic, view: View, acc: np.ndarray) -> np.ndarray:
        lit = (view.lead >= 0) & (view.al < -0.2)
        near = np.clip((60.0 - view.gap) / 15.0, 0.0, 1.0)
        return acc + np.where(lit, near * self.of[view.veh] * np.clip(view.al, -4.0, 0.0), 0.0)


class Grade(Effect):
    """An upgrade that drivers compensate for in part only; lorries least.

    Koshi, Kuwahara & Akahane (1992), Capacity of sags and tunnels; Goni-Ros et al. (2014), sag bottlenecks, TRR 2421.
    """

    name, strength, unit = "grade", 0.035, "-"
    says = "upgrade of 3.5 per cent in the middle of the road; 35 per cent of it acts on cars, 80 on lorries"
    acts = (0.35, 0.80)

    def slope(self, traffic: Traffic, x: np.ndarray) -> np.ndarray:
        """Slope [-] at positions `x` [m] of the simulated road."""
        begin, end = traffic.setting.window_begin, traffic.setting.window_end
        third, soft = (end - begin) / 3.0, 60.0
        return self.strength * np.clip(np.minimum(x - begin - third, end - third - x) / soft + 0.5, 0.0, 1.0)

    def add(self, traffic: Traffic, view: View, acc: np.ndarray) -> np.ndarray:
        share = np.where(traffic.drivers.truck[view.veh], self.acts[1], self.acts[0])
        personal = self.of[view.veh] / self.strength
        return acc - 9.81 * share * personal * self.slope(traffic, traffic.x[view.veh])


class VarianceGap(Effect):
    """The time gap grows with the variation of speeds just ahead.

    Treiber, Kesting & Helbing (2006), Understanding widely scattered traffic flows, Phys. Rev. E 74: variance-driven
    time headways.
    """

    name, strength, unit = "variance_gap", 3.0, "-"
    says = "time gap times 1 + 3 x coefficient of variation of the speeds of self and five leaders, at most 2.2"

    def prepare(self, traffic: Traffic, rng: np.random.Generator) -> None:
        super().prepare(traffic, rng)
        self.seen = np.zeros(len(traffic.drivers))

    def time_gap(self, traffic: Traffic, view: View) -> np.ndarray | float:
        speeds = [traffic.v[view.veh]]
        for k in range(1, 6):
            who = view.ahead(k)
            speeds.append(np.where(who >= 0, traffic.v[np.maximum(who, 0)], np.nan))
        block = np.array(speeds)
        count = np.sum(np.isfinite(block), axis=0)
        mean = np.nansum(block, axis=0) / count
        spread = np.sqrt(np.nansum((block - mean) ** 2, axis=0) / count)
        now = np.where(count > 2, spread / np.maximum(mean, 1.5), 0.0)
        self.seen[view.veh] += (now - self.seen[view.veh]) * min(1.0, traffic.setting.dt / 5.0)
        return np.minimum(1.0 + self.of[view.veh] * self.seen[view.veh], 2.2)


class Resignation(Effect):
    """Drivers who have been slow for long keep longer time gaps.

    Treiber & Helbing (2003), Memory effects in microscopic traffic models, Phys. Rev. E 68: the subjective level of
    service is a moving mean of v / v0.
    """

    name, strength, unit = "resignation", 0.7, "-"
    says = "time gap times 1 + 0.7 (1 - level), level = mean of v / v0 over the last 120 s (exponential)"
    tau = 120.0

    def prepare(self, traffic: Traffic, rng: np.random.Generator) -> None:
        super().prepare(traffic, rng)
        self.level = np.full(len(traffic.drivers), np.nan)

    def time_gap(self, traffic: Traffic, view: View) -> np.ndarray | float:
        now = np.clip(traffic.v[view.veh] / traffic.drivers.v0[view.veh], 0.0, 1.0)
        old = np.where(np.isnan(self.level[view.veh]), now, self.level[view.veh])
        self.level[view.veh] = old + (now - old) * traffic.setting.dt / self.tau
        return 1.0 + self.of[view.veh] * (1.0 - self.level[view.veh])


class TruckLeader(Effect):
    """Longer time gaps behind lorries.

    Aghabayk, Sarvi & Young (2012), Heavy vehicles and car following, Transport Policy; Ye & Zhang (2009), Vehicle
    type-specific headway analysis, TRR 2124.
    """

    name, strength, unit = "truck_leader", 0.3, "-"
    says = "time gap times 1.3 behind lorries"

    def time_gap(self, traffic: Traffic, view: View) -> np.ndarray | float:
        behind = (view.lead >= 0) & traffic.drivers.truck[np.maximum(view.lead, 0)]
        return 1.0 + self.of[view.veh] * behind


class LateralOffset(Effect):
    """Shorter time gaps when the leader is not straight ahead.

    Gunay (2007), Car following theory with lateral discomfort, Transp. Res. B 41; Jin et al. (2010), Non-lane-based
    car following, Phys. Lett. A 374.
    """

    name, strength, unit = "lateral_offset", 0.4, "1/m"
    says = "time gap times 1 - 0.4 per metre of lateral distance to the leader, at least 0.6"

    def time_gap(self, traffic: Traffic, view: View) -> np.ndarray | float:
        aside = np.where(view.lead >= 0, np.abs(traffic.y[np.maximum(view.lead, 0)] - traffic.y[view.veh]), 0.0)
        return 1.0 - np.minimum(self.of[view.veh] * np.minimum(aside, 1.0), 0.4)


class ActionPoints(Effect):
    """The acceleration is held until the wanted one differs enough, or until attention returns.

    Todosiev & Barbosa (1963); Wiedemann (1974); Wagner (2012), Analyzing fluctuations in car-following, Transp. Res. B
    46: seconds pass between action points.
    """

    name, strength, unit = "action_points", 0.4, "m/s^2"
    says = "acceleration held until the wanted one differs by 0.4 m/s^2, or for a random time of 3 s on average"
    lapse = 3.0

    def prepare(self, traffic: Traffic, rng: np.random.Generator) -> None:
        super().prepare(traffic, rng)
        self.rng = rng
        self.held = np.full(len(traffic.drivers), np.nan)

    def hold(self, traffic: Traffic, who: np.ndarray, acc: np.ndarray) -> np.ndarray:
        held = self.held[who]
        woken = self.rng.random(len(who)) < traffic.setting.dt / self.lapse
        act = np.isnan(held) | (np.abs(acc - held) > self.of[who]) | woken
        # nobody goes on pulling or braking through standstill or the speed they want
        act |= (traffic.v[who] < 0.5) | ((held > 0) & (traffic.v[who] > traffic.drivers.v0[who] + 1.0))
        self.held[who] = np.where(act, acc, held)
        return self.held[who]


class ClockOffset(Effect):
    """A fault of measurement: every second camera's clock is late. Behaviour is that of the control (`camera.py`)."""

    name, strength, unit = "clock_offset", 0.2, "s"
    says = "every second camera is 0.2 s late"


EFFECTS: dict[str, type[Effect]] = {
    kind.name: kind
    for kind in (
        Effect,
        ReactionDelay,
        SecondLeader,
        Asymmetry,
        BrakeLights,
        Grade,
        VarianceGap,
        Resignation,
        TruckLeader,
        LateralOffset,
        ActionPoints,
        ClockOffset,
    )
}
