"""Tests of the motorway generator: short recordings of a short road."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.foreign.motorway.__main__ import main  # noqa: E402
from tests.foreign.motorway.camera import COLUMNS, coloured, smoothed  # noqa: E402
from tests.foreign.motorway.effects import EFFECTS  # noqa: E402
from tests.foreign.motorway.models import MODELS  # noqa: E402
from tests.foreign.motorway.record import gaps, implausible, make  # noqa: E402

SEED = 5


def short(effect: str, model: str = "iidm", seed: int = SEED) -> tuple[pd.DataFrame, dict]:
    return make(effect, seed, model, duration=15.0, length=600.0, warm_up=20.0)


@pytest.fixture(scope="module")
def control() -> tuple[pd.DataFrame, dict]:
    return short("none")


def test_columns_and_units(control: tuple[pd.DataFrame, dict]) -> None:
    table, answer = control
    assert tuple(table.columns) == COLUMNS
    assert not table.isna().any().any()
    assert not table.duplicated(["track_id", "frame"]).any()
    assert table["lane"].isin([0, 1, 2]).all()
    assert table["speed"].between(0.0, 60.0).all()
    assert table["position"].between(-5.0, answer["road_length"] + 5.0).all()
    assert set(table["vehicle_class"]) <= {"car", "truck"}
    np.testing.assert_allclose(table["time"], table["frame"] / answer["fps"], atol=1e-3)
    # lanes are counted from the left, and lateral positions grow to the right
    assert table.groupby("lane")["lateral"].mean().is_monotonic_increasing
    per_track = table.groupby("track_id")[["length", "width", "vehicle_class"]].nunique()
    assert (per_track == 1).all().all()
    assert (table.groupby("track_id")["frame"].diff().dropna() == 1).all()


@pytest.mark.parametrize("model", MODELS)
def test_no_vehicles_overlap(model: str) -> None:
    table, answer = short("none", model)
    assert gaps(table)["gap"].min() > 0.0
    assert answer["model"] == model
    # few lane changes fit into 15 s, and the first vehicles are placed as no driver would be
    rare = ("lane_changes", "share_of_emergency")
    assert not [line for line in implausible(answer["summary"]) if not line.startswith(rare)]
    assert answer["summary"]["share_of_emergency_braking"] < 0.02


def test_same_seed_same_data(control: tuple[pd.DataFrame, dict]) -> None:
    table, answer = short("none")
    pd.testing.assert_frame_equal(table, control[0])
    assert answer == control[1]
    other, _ = short("none", seed=SEED + 1)
    assert len(other) != len(table) or not np.allclose(other["position"], table["position"])


@pytest.mark.parametrize("effect", [name for name in EFFECTS if name != "none"])
def test_effect_changes_the_data(effect: str, control: tuple[pd.DataFrame, dict]) -> None:
    table, answer = short(effect)
    assert answer["effect"] == effect
    assert answer["strength"] > 0
    both = table.merge(control[0], on=["track_id", "frame"], suffixes=("", "_control"))
    apart = float((both["position"] - both["position_control"]).abs().max())
    assert apart > 0.2
    assert gaps(table)["gap"].min() > 0.0


def test_noise_has_unit_variance_and_smoothing_keeps_lines() -> None:
    noise = coloured(np.random.default_rng(1), 200_000, 1.0, 0.1)
    assert np.std(noise) == pytest.approx(1.0, abs=0.05)
    line = np.linspace(0.0, 100.0, 101)
    for kind in ("none", "exponential", "butterworth", "savgol"):
        np.testing.assert_allclose(smoothed(line, kind, 0.7, 10), line, atol=0.05)


def test_command_line_keeps_the_truth_out_of_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "one"
    words = ["motorway", str(folder), "--effect", "grade", "--seed", "2"]
    monkeypatch.setattr(sys, "argv", [*words, "--duration", "5", "--length", "300", "--warm-up", "3"])
    main()
    assert "grade" in capsys.readouterr().out
    assert [p.name for p in folder.iterdir()] == ["motorway.parquet"]
    answer = json.loads((tmp_path / "one.truth.json").read_text(encoding="utf-8"))
    assert answer["strength"] == 0.035
    assert len(answer["drivers"]["strength"]) == pd.read_parquet(folder / "motorway.parquet")["track_id"].nunique()
