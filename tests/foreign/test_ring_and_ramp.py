"""Quick tests of the ring_and_ramp generator on short recordings."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.foreign import ring_and_ramp as rr
from tests.foreign.ring_and_ramp.__main__ import main
from tests.foreign.ring_and_ramp.sensors import Flight, Sensor
from tests.foreign.ring_and_ramp.signs import DIRECTION, sign
from tests.foreign.ring_and_ramp.traffic import Run, Scene

KINDS = {
    "track_id": "i",
    "frame": "i",
    "time": "f",
    "position": "f",
    "lateral": "f",
    "lane": "i",
    "speed": "f",
    "length": "f",
    "width": "f",
    "recording": "i",
}
RING = Scene("ring", "helly", 700.0, 15.0, 30.0)
_plan = rr.plan


def short_plan(seed: int) -> tuple[Scene, Sensor, list[Flight]]:
    """A 20 s recording at the ramp in place of the drawn one."""
    scene, sensor, flights = _plan(seed)
    scene = replace(scene, site="ramp", model="fvd", warm_up=20.0, duration=20.0)
    return scene, sensor, [replace(flights[0], begin=20.0, end=40.0, start=1600.0, half=450.0)]


@pytest.fixture(scope="module")
def control() -> Run:
    """True control traffic on the ring."""
    return rr.simulate("control", 3, RING)


@pytest.mark.parametrize("seed", [3, 8])
def test_table(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Columns, units, no overlaps, and the same table for the same seed."""
    monkeypatch.setattr(rr, "plan", short_plan)
    table, truth = rr.make("control", seed)
    assert all(table[name].dtype.kind == kind for name, kind in KINDS.items())
    assert set(table["vehicle_class"]) <= {"car", "van", "truck"}
    assert not table.isna().any().any()
    assert table["speed"].between(0.0, 45.0).all()
    assert table["length"].between(3.0, 20.0).all()
    assert table["lane"].between(0, 2).all()
    assert (table["lateral"] - 3.6 * table["lane"]).between(-1.5, 5.1).all()
    rate = truth["sensor"]["rate"]
    assert rate >= 10.0
    assert np.allclose(table["time"], table["frame"] / rate)
    grouped = table.sort_values(["track_id", "frame"]).groupby("track_id")
    assert (grouped["frame"].diff().dropna() == 1).all()
    moved, driven = grouped["position"].agg(np.ptp).sum(), grouped["speed"].sum().sum() / rate
    assert abs(moved / driven - 1.0) < 0.02
    for _, now in table.groupby(["frame", "lane"]):
        now = now.sort_values("position")
        assert (np.diff(now["position"]) > now["length"].to_numpy()[1:]).all()
    assert truth["traffic"]["contacts"] == 0
    assert "effect" not in " ".join(table.columns)
    pd.testing.assert_frame_equal(table, rr.make("control", seed)[0])


@pytest.mark.parametrize("effect", rr.EFFECTS[1:])
def test_effect(effect: str, control: Run) -> None:
    """Same drivers and start, other traffic, and a change in the direction of the source."""
    run = rr.simulate(effect, 3, RING)
    assert np.array_equal(run.fleet.v0, control.fleet.v0)
    assert np.array_equal(run.fleet.length, control.fleet.length)
    assert run.contacts == 0
    assert not np.array_equal(run.x, control.x)
    change = (sign(run, effect) - sign(control, effect)) * DIRECTION[effect]
    assert change > 0.0


def test_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files per recording, and the truth next to the folder."""
    monkeypatch.setattr(rr, "plan", short_plan)
    monkeypatch.setattr(sys, "argv", ["ring_and_ramp", str(tmp_path / "set"), "--effect", "sag", "--seed", "4"])
    main()
    table = pd.read_parquet(tmp_path / "set" / "recording_01.parquet")
    truth = json.loads((tmp_path / "set.truth.json").read_text())
    assert truth["effect"] == "sag"
    assert set(map(str, table["track_id"])) == set(truth["drivers"])
