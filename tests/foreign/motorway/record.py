"""One recording from a seed: scenario, simulation, measurement, truth, and a summary with checks of plausibility.

Sources
-------
Treiber & Kesting (2013), Traffic Flow Dynamics: flows of 1200 to 2200 vehicles per hour and lane, waves that travel
    upstream at 15 to 20 km/h. Knospe et al. (2002), Phys. Rev. E 65: time headways on motorways, median 1.5 to 3 s.
Kerner (2004), The Physics of Traffic: moving jams from a bottleneck of varying strength.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd

from .camera import Chain, draw_chain, measure
from .effects import EFFECTS, Grade
from .models import MODELS
from .traffic import Setting, Traffic


def draw_setting(
    rng: np.random.Generator, model: str | None, duration: float | None, length: float | None, warm_up: float | None
) -> Setting:
    """Scenario: road, demand and the bottleneck, whose speed falls and recovers every few minutes."""
    fps = int(rng.choice([10, 12, 20, 25]))
    drawn_model = str(rng.choice(list(MODELS)))
    drawn = rng.uniform((800.0, 240.0, 360.0, 1450.0, 0.06, 150.0), (1500.0, 600.0, 480.0, 1750.0, 0.18, 400.0))
    setting = Setting(
        fps=fps,
        length=round(float(length or drawn[0]), -1),
        duration=float(round(duration or drawn[1])),
        warm_up=float(round(drawn[2] if warm_up is None else warm_up)),
        flow=float(drawn[3]) / 3600.0,
        trucks=float(drawn[4]),
        model=model or drawn_model,
        zone_distance=float(drawn[5]),
    )
    at, slow = 0.0, [(0.0, float(rng.uniform(16.0, 22.0)))]
    while at < setting.warm_up + setting.duration:
        at += float(rng.uniform(40.0, 110.0))
        low, high = float(rng.uniform(0.8, 3.5)), float(rng.uniform(12.0, 20.0))
        hold = float(rng.uniform(15.0, 45.0))
        slow += [(at, slow[-1][1]), (at + 12.0, low), (at + 12.0 + hold, low), (at + 30.0 + hold, high)]
        at += 30.0 + hold
    setting.slow = slow
    return setting


def simulate(traffic: Traffic) -> dict[str, np.ndarray]:
    """Run, and note the vehicles whose centre is before the cameras; sorted by vehicle and frame."""
    s = traffic.setting
    for _ in range(round(s.warm_up / s.dt)):
        traffic.step()
    traffic.changes = traffic.guarded = traffic.moved = 0
    seen: dict[str, list[np.ndarray]] = {k: [] for k in ("veh", "frame", "x", "y", "v")}
    for frame in range(0, round(s.duration * s.fps), s.every):
        act = traffic.active
        centre = traffic.x[act] - 0.5 * traffic.drivers.length[act] - s.window_begin
        inside = (centre >= 0.0) & (centre <= s.length)
        who = act[inside]
        seen["veh"].append(who)
        seen["frame"].append(np.full(len(who), frame))
        seen["x"].append(centre[inside])
        seen["y"].append(traffic.y[who])
        seen["v"].append(traffic.v[who])
        traffic.step()
    raw = {k: np.concatenate(v) for k, v in seen.items()}
    order = np.lexsort((raw["frame"], raw["veh"]))
    raw = {k: v[order] for k, v in raw.items()}
    return between(raw, s.dt) if s.every == 2 else raw


def between(raw: dict[str, np.ndarray], dt: float) -> dict[str, np.ndarray]:
    """Add the frame in the middle of each time step `dt` [s], in which the acceleration is constant."""
    here = np.flatnonzero(raw["veh"][1:] == raw["veh"][:-1])
    x, y, v, frame = raw["x"], raw["y"], raw["v"], raw["frame"]
    middle = {
        "veh": raw["veh"][here],
        "frame": frame[here] + 1,
        "x": x[here] + dt * (3.0 * v[here] + v[here + 1]) / 8.0,
        "y": 0.5 * (y[here] + y[here + 1]),
        "v": 0.5 * (v[here] + v[here + 1]),
    }
    full = {k: np.concatenate([raw[k], middle[k]]) for k in raw}
    order = np.lexsort((full["frame"], full["veh"]))
    return {k: v[order] for k, v in full.items()}


def make(
    effect: str,
    seed: int,
    model: str | None = None,
    duration: float | None = None,
    length: float | None = None,
    warm_up: float | None = None,
) -> tuple[pd.DataFrame, dict]:
    """Table and truth. Recordings of one seed have the same drivers, demand and cameras whatever the effect is."""
    scenario, who, noise, own, choice, chain_seed, camera = np.random.SeedSequence([seed, 7919]).spawn(7)
    setting = draw_setting(np.random.default_rng(scenario), model, duration, length, warm_up)
    acts = EFFECTS[effect]()
    traffic = Traffic(setting, acts, [who, noise, own, choice])
    raw = simulate(traffic)
    late = acts.strength if effect == "clock_offset" else 0.0
    chain = draw_chain(np.random.default_rng(chain_seed), setting.length, late)
    d = traffic.drivers
    sizes = pd.DataFrame({"length": d.length, "width": d.width, "truck": d.truck})
    table, vehicles = measure(raw, sizes, setting, chain, camera)
    return table, truth(traffic, chain, vehicles, table, seed)


def truth(traffic: Traffic, chain: Chain, vehicles: np.ndarray, table: pd.DataFrame, seed: int) -> dict:
    """Everything that was put in, and the summary of what came out."""
    s, d, acts = traffic.setting, traffic.drivers, traffic.effect
    names = ("truck", "length", "v0", "time_gap", "s0", "a", "b", "offset", "duration", "threshold", "relaxation")
    drivers = {name: np.round(getattr(d, name)[vehicles].astype(float), 4).tolist() for name in names}
    answer = {
        "seed": seed,
        "effect": acts.name,
        "says": acts.says,
        "strength": acts.strength,
        "unit": acts.unit,
        "model": s.model,
        "fps": s.fps,
        "road_length": s.length,
        "duration": s.duration,
        "demand_per_lane": round(s.flow * 3600.0),
        "trucks": round(s.trucks, 3),
        "lane_width": s.lane_width,
        "bottleneck": {"begins": s.zone_begin - s.window_begin, "length": s.zone},
        "measurement": chain.as_dict(),
        "summary": summary(table, s, traffic),
        "drivers": {"track_id": list(range(1, len(vehicles) + 1)), **drivers},
    }
    if acts.strength and acts.name != "clock_offset":
        answer["drivers"]["strength"] = np.round(acts.of[vehicles], 4).tolist()
    if isinstance(acts, Grade):
        x = np.linspace(0.0, s.length, 101)
        slopes = acts.slope(traffic, x + s.window_begin)
        answer["grade"] = {"position": x.round(1).tolist(), "slope": slopes.round(5).tolist(), "acts": list(acts.acts)}
    return answer


def gaps(table: pd.DataFrame) -> pd.DataFrame:
    """Own speed [m/s] and `gap` [m] from bumper to bumper, of all rows with a vehicle ahead in their lane and frame."""
    frame, lane, x, length, speed = (
        table[name].to_numpy() for name in ("frame", "lane", "position", "length", "speed")
    )
    order = np.lexsort((x, lane, frame))
    one, two = order[:-1], order[1:]
    pair = (frame[one] == frame[two]) & (lane[one] == lane[two])
    one, two = one[pair], two[pair]
    return pd.DataFrame({"gap": x[two] - x[one] - 0.5 * (length[one] + length[two]), "speed": speed[one]})


def summary(table: pd.DataFrame, setting: Setting, traffic: Traffic) -> dict:
    """Figures of plausibility; flow by Edie's definition over road and time."""
    pairs = gaps(table)
    gap, following = pairs["gap"].to_numpy(float), pairs["speed"].to_numpy(float)
    headway = (gap[following > 3.0] + 4.6) / following[following > 3.0]
    speed, acc = table["speed"].to_numpy(float), table["acceleration"].to_numpy(float)
    area = setting.length * setting.duration * setting.lanes
    lane, track = table["lane"].to_numpy(), table["track_id"].to_numpy()
    flips = int(np.sum((np.diff(lane) != 0) & (np.diff(track) == 0)))
    return {
        "rows": len(table),
        "tracks": len(np.unique(track)),
        "flow_per_lane_per_hour": round(float(speed.sum()) / setting.fps / area * 3600.0),
        "density_per_lane_per_km": round(len(table) / setting.fps / area * 1000.0, 1),
        "mean_speed": round(float(speed.mean()), 2),
        "share_below_5": round(float(np.mean(speed < 5.0)), 3),
        "lane_changes": flips,
        "lane_changes_per_km_hour": round(flips / (setting.length / 1000 * setting.duration / 3600)),
        "median_headway": round(float(np.median(headway)), 2),
        "least_gap": round(float(gap.min()), 2),
        "overlapping_rows": int(np.sum(gap < 0)),
        "least_speed": round(float(speed.min()), 2),
        "acceleration_sd": round(float(acc.std()), 2),
        "strongest_braking_1_per_mille": round(float(np.quantile(acc, 0.001)), 2),
        "share_of_emergency_braking": round(traffic.guarded / max(traffic.moved, 1), 5),
    }


def implausible(figures: dict) -> list[str]:
    """Figures of a summary that no motorway shows."""
    limits = {
        "flow_per_lane_per_hour": (400, 2400),
        "mean_speed": (2.0, 35.0),
        "median_headway": (1.0, 4.5),
        "overlapping_rows": (0, 0),
        "least_speed": (0.0, 50.0),
        "share_of_emergency_braking": (0.0, 0.005),
        "lane_changes_per_km_hour": (30, 2500),
    }
    return [
        f"{name} is {figures[name]}, expected {low} to {high}"
        for name, (low, high) in limits.items()
        if not low <= figures[name] <= high
    ]


def write(folder: Path, table: pd.DataFrame, answer: dict) -> tuple[Path, Path]:
    """Write FOLDER/motorway.parquet and, next to the folder, FOLDER.truth.json."""
    folder.mkdir(parents=True, exist_ok=True)
    data, beside = folder / "motorway.parquet", folder.parent / f"{folder.name}.truth.json"
    table.to_parquet(data, index=False)
    beside.write_text(json.dumps(answer, indent=1) + "\n", encoding="utf-8")
    return data, beside
