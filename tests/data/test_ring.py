"""Ring roads: positions that begin anew with every lap are unrolled, and everybody has a leader."""

import shlex

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.problems import BadRecordingError
from rearl_jax.data.recordings import data_id
from rearl_jax.data.survey.task import run
from tests.data.table_files import read_table
from tests.refusal import refused

LAP = 230.0
N_VEHICLES = 12


def ring(seconds=90.0, rate=10.0):
    """Vehicles at equal distances of a lap whose speed swings, counted from an origin in every lap."""
    frame = np.arange(round(seconds * rate))
    time = frame / rate
    parts = []
    for k in range(N_VEHICLES):
        phase = 2.0 * np.pi * k / N_VEHICLES
        along = LAP * k / N_VEHICLES + 8.0 * time + 2.0 * np.sin(0.3 * time + phase)
        columns = {"track_id": k + 1, "time": time, "speed": 8.0 + 0.6 * np.cos(0.3 * time + phase)}
        parts.append(pd.DataFrame(columns | {"along": along, "position": np.mod(along, LAP)}))
    return pd.concat(parts, ignore_index=True)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "ring.csv"
    ring().drop(columns="along").to_csv(path, index=False)
    return path


def test_everybody_has_a_leader_at_the_true_distance(file):
    table = read_table(file, ring=LAP).table
    assert table["track_id"].nunique() == N_VEHICLES + 1
    drivers = table[table["track_id"] <= N_VEHICLES].sort_values(["frame", "position"])
    steps = table.groupby("track_id")["position"].diff().dropna()
    assert (0.0 < steps).all()
    assert (steps < 1.0).all()
    copy = table[table["track_id"] > N_VEHICLES].set_index("frame")
    last = drivers.groupby("frame").last()
    first = drivers.groupby("frame").first()
    np.testing.assert_allclose(copy["position"], first["position"] + LAP, atol=1e-6)
    truth = ring().set_index(["track_id", "time"])["along"]
    for frame in (0, 450):
        time = frame / 10.0
        places = np.sort([truth[k + 1, time] % LAP for k in range(N_VEHICLES)])
        gaps = np.diff(np.r_[places, places[0] + LAP])
        ours = np.r_[drivers[drivers["frame"] == frame]["position"], copy["position"][frame]]
        assert len(ours) == N_VEHICLES + 1
        np.testing.assert_allclose(np.sort(np.diff(ours)), np.sort(gaps), atol=1e-3)
    assert (last["position"] < copy["position"]).all()
    assert table["lane"].eq(0).all()


def test_positions_that_grow_from_lap_to_lap_are_read_alike(file, tmp_path):
    whole = tmp_path / "whole.csv"
    ring().drop(columns="position").rename(columns={"along": "position"}).to_csv(whole, index=False)
    ours, theirs = (read_table(path, ring=LAP).table for path in (file, whole))
    np.testing.assert_allclose(np.diff(ours["position"]), np.diff(theirs["position"]), atol=1e-6)


def test_a_vehicle_that_is_seen_later_has_its_place(tmp_path):
    rows = ring()
    path = tmp_path / "later.csv"
    rows[(rows["track_id"] != 3) | (rows["time"] > 40.0)].drop(columns="along").to_csv(path, index=False)
    table = read_table(path, ring=LAP).table
    late = table[(table["track_id"] <= N_VEHICLES) & (table["frame"] == 500)]
    assert np.ptp(late["position"]) < LAP
    np.testing.assert_allclose(np.diff(np.sort(late["position"])), LAP / N_VEHICLES, atol=2.5)


def test_stated_leaders_are_those_of_the_order(tmp_path):
    path = tmp_path / "stated.csv"
    rows = ring().drop(columns="along")
    rows.assign(leader_id=rows["track_id"] % N_VEHICLES + 1).to_csv(path, index=False)
    table = read_table(path, ring=LAP).table
    assert table["leader_id"].isna().all()


def test_a_ring_and_a_road_with_two_ends_are_not_the_same_data(file):
    ids = {data_id(DataConfig(DataFormat.table, str(file), ring=lap)) for lap in (None, LAP, LAP + 1.0)}
    assert len(ids) == 3


def test_the_circumference_is_found_and_said_in_the_command(file, capsys):
    record = run(str(file))
    words = dict(word.partition("=")[::2] for word in shlex.split(record["command"]) if "=" in word)
    assert float(words["data.ring"]) == pytest.approx(LAP, abs=0.1)
    assert record["dropped"] == {}
    assert record["recordings"][0]["vehicles"] == N_VEHICLES + 1


def test_a_road_with_two_ends_is_no_ring(tmp_path, capsys):
    path = tmp_path / "road.csv"
    rows = ring().drop(columns="position").rename(columns={"along": "position"})
    rows.loc[rows["track_id"].eq(2) & rows["time"].between(30.0, 31.0), "position"] -= 90.0
    rows.to_csv(path, index=False)
    assert "data.ring" not in run(str(path))["command"]


@pytest.mark.parametrize(("lap", "code"), [(150.0, "ring-overtaken"), (300.0, "jump")])
def test_another_lap_is_refused(file, lap, code):
    with refused(code, BadRecordingError, column="position"):
        read_table(file, ring=lap)


def test_a_vehicle_that_overtakes_is_refused(tmp_path):
    path = tmp_path / "overtaking.csv"
    rows = ring().drop(columns="position").rename(columns={"along": "position"})
    fast = rows["track_id"].eq(5)
    rows.loc[fast, "position"] += 3.0 * rows.loc[fast, "time"]
    rows.loc[fast, "speed"] += 3.0
    rows.to_csv(path, index=False)
    with refused("ring-overtaken", BadRecordingError, column="position"):
        read_table(path, ring=LAP)


def test_several_lanes_are_refused_and_unknown_ones_are_no_lane(tmp_path):
    path = tmp_path / "lanes.csv"
    rows = ring().drop(columns="along")
    rows.assign(lane=rows["track_id"] % 2).to_csv(path, index=False)
    with refused("ring-lanes", BadRecordingError, column="lane"):
        read_table(path, ring=LAP)
    rows.assign(lane=np.where(rows["track_id"] == 2, np.nan, 0.0)).to_csv(path, index=False)
    assert read_table(path, ring=LAP).table["lane"].eq(0).all()
