"""SUMO as a second source."""

import numpy as np
import pandas as pd
import pytest

from rearl_jax.blind import sumo
from rearl_jax.blind.cases import SUMO_MODELS
from rearl_jax.blind.traffic import Scenario
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.data.recordings import iterate_recordings

SHORT = Scenario(4, n_recordings=1, duration=15.0)


def rows(folder, variant):
    sumo.write_sumo_dataset(folder, SHORT, variant)
    (recording,) = iterate_recordings(DataConfig(format=DataFormat.table, root=str(folder)))
    return recording.table


def test_every_variant_has_its_truth():
    assert set(sumo.TRUTHS) == set(SUMO_MODELS)
    assert sumo.sumo_truth("idm")["planted"] == []
    assert sumo.sumo_truth("idm_limit")["planted"][0]["parameters"]["limit"] == sumo.LIMIT


def test_a_missing_sumo_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setattr(sumo, "find_spec", lambda name: None)
    with pytest.raises(ModuleNotFoundError, match=r"rearl-jax\[bench\].*blind.sumo=false"):
        sumo.write_sumo_dataset(tmp_path, SHORT, "idm")


def test_all_vehicles_stay_and_follow_the_first(tmp_path):
    pytest.importorskip("libsumo")
    table = rows(tmp_path, "idm")
    assert table.groupby("track_id").size().eq(151).all()
    assert table["track_id"].nunique() == 39
    moved = table.groupby("track_id")["position"].diff().dropna() / 0.1
    assert (moved - table["speed"].loc[moved.index]).abs().median() < 1.0
    for _, lane in table[table["frame"] == 100].groupby("lane", observed=True):
        ordered = lane.sort_values("position")
        assert (np.diff(ordered["position"]) > ordered["length"].iloc[1:] / 2).all()


def test_rules_of_sumo_make_a_difference(tmp_path):
    pytest.importorskip("libsumo")
    free, bound = (rows(tmp_path / name, name) for name in ("idm", "idm_no_passing_right"))
    same = ["track_id", "frame", "vehicle_class"]
    pd.testing.assert_frame_equal(free[same], bound[same])
    assert bound["speed"].mean() < free["speed"].mean() - 0.2
