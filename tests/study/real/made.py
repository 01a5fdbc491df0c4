"""Drivers made by hand, who follow steadily, and verdicts made by hand."""

import dataclasses

import numpy as np

from rearl_jax.discovery.read.measured import Measured, Surroundings
from tests.discovery.made_verdict import VERDICT

SPEED, LENGTH, STEPS = 20.0, 4.0, 300
FIGURE = {"value": 1.5, "low": 1.25, "high": 1.75}


def platoon(cars):
    """Drivers at a constant speed and distance; cars: {car: {setting: time gaps [s], one for each of its tracks}}."""
    tracks = [
        (car, setting, gap) for car, settings in cars.items() for setting, gaps in settings.items() for gap in gaps
    ]
    n = len(tracks)
    gaps = np.array([gap for _, _, gap in tracks])
    dt = 0.1
    place = np.repeat(SPEED * dt * np.arange(STEPS)[:, None], n, axis=1)
    speed = np.full((STEPS, n), SPEED)
    surroundings = {item.name: np.zeros((STEPS, n)) for item in dataclasses.fields(Surroundings)}
    surroundings |= {"has_leader": np.ones((STEPS, n)), "leader_speed": speed.copy()}
    surroundings["leader_rear"] = place + LENGTH / 2 + gaps * SPEED
    whole = np.arange(n)
    return Measured(
        y=place,
        weight=np.ones((STEPS, n)),
        smooth=place,
        smooth_speed=speed,
        surroundings=Surroundings(**surroundings),
        length=np.full(n, LENGTH),
        is_truck=np.zeros(n, bool),
        driver=whole,
        vehicle=whole,
        leader=np.zeros((STEPS, n), int),
        recording=whole,
        identity=np.full(n, -1),
        dt=dt,
        stride=1,
        noise=0.1,
        labels={
            "model": np.array([car for car, _, _ in tracks], object),
            "setting": np.array([setting for _, setting, _ in tracks], object),
        },
    )


def verdict(word="improved", change_share=-0.2, groups=()):
    """A verdict; with groups that of several groups of drivers, whose models differ."""
    protocols = VERDICT["error"]["protocols"]
    mean = protocols["population"]["gap_rmse"]["mean"] | {"change_share": FIGURE | {"value": change_share}}
    worse = protocols["population"] | {"gap_rmse": {"mean": mean}}
    error = VERDICT["error"] | {"protocols": protocols | {"population": worse}}
    base = {"chosen": "idm", "differs": False, "equilibrium_time_gap": {"10": FIGURE, "20": None}}
    failed = [{"test": test, "names": [], "value": 5.0, "limit": 3.5} for test in ("old_decisions", "heavy_tails")]
    one = VERDICT | {"verdict": word, "error": error, "base": base}
    one |= {"failed_tests": failed if word == "unexplained" else []}
    if not groups:
        return one
    row = {"drivers": one["data"]["drivers"], "effects": one["effects"], "error": error, "verdict": word}
    row |= {"failed_tests": one["failed_tests"]}
    rows = [
        row | {"value": group, "base": base | {"chosen": chosen}, "equilibrium_time_gap": base["equilibrium_time_gap"]}
        for group, chosen in groups
    ]
    return one | {"base": None, "groups": rows}
