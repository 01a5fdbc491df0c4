"""Labels of tracks: read from OpenACC, FHWA's pairs and canonical tables, kept through cuts and files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.checks.labels import track_labels
from rearl_jax.data.formats.openacc_labels import INDEX_FILE, labels_of_run
from rearl_jax.data.recordings import data_id, iterate_recordings, label_of_same
from rearl_jax.data.records import Recording
from rearl_jax.data.tables.canonical import TableFile, write_recording
from rearl_jax.data.tables.in_memory import in_memory
from tests.data.formats.test_openacc import _platoon
from tests.data.made_rows import with_values
from tests.data.table_files import write_table
from tests.refusal import refused

T = np.arange(100) / 10.0
INDEX = """file,date,n_declared,acc,setting,rows
run_1.csv,"['8', '10']",['4'],['1'],['S'],200
run_2.csv,"['8', '10']",['4'],['1'],['SL'],200
run_3.csv,"['8', '10']",['4'],['0'],[],200
"""


def _pair(pair: int, group: str, follower: int) -> pd.DataFrame:
    """A follower 30 m behind a leader, both at 20 m/s."""
    who = {"recording": "run1", "pair": pair, "group": group, "follower_id": follower, "leader_id": 90 + pair}
    moves = {"t_s": T, "y_f_m": 20 * T, "y_l_m": 30 + 20 * T}
    return pd.DataFrame(who | moves | {"v_f_mps": 20.0, "a_f_mps2": 0.0, "v_l_mps": 20.0, "a_l_mps2": 0.0})


def _read_pairs(folder: Path, pairs: pd.DataFrame) -> list[Recording]:
    pairs.to_parquet(folder / "pairs.parquet")
    return list(iterate_recordings(DataConfig(DataFormat.fhwa, str(folder))))


@pytest.mark.parametrize("on_bad", [BadRows.stop, BadRows.drop_row])
@pytest.mark.parametrize("column", ["y_f_m", "y_l_m"])
def test_pairs_without_any_place_are_refused(tmp_path, on_bad, column):
    _pair(1, "HV", 7).assign(**{column: np.nan}).to_parquet(tmp_path / "pairs.parquet")
    with refused("no-values", column=column):
        list(iterate_recordings(DataConfig(DataFormat.fhwa, str(tmp_path), on_bad=on_bad)))


def test_a_wrong_place_does_not_lengthen_the_road(tmp_path):
    sound = _pair(1, "HV", 7)
    (expected,) = _read_pairs(tmp_path, sound)
    with_values(sound, 50, y_l_m=1e7).astype({"y_l_m": float}).to_parquet(tmp_path / "pairs.parquet")
    (found,) = iterate_recordings(DataConfig(DataFormat.fhwa, str(tmp_path), on_bad=BadRows.drop_row))
    assert found.info.road_length == expected.info.road_length
    assert found.dropped != {}


def test_cars_of_openacc_have_model_and_setting(tmp_path):
    runs = [_platoon().assign(file=f"run_{k}") for k in (1, 2, 3, 4)]
    for k, run in enumerate(runs):
        run["gap_to_follower_m"] += k  # the rows of no two runs are the same
    runs[0]["model"] = "M" + runs[0]["pos"].astype(str)
    pd.concat(runs).to_parquet(tmp_path / "platoons.parquet")
    data = DataConfig(DataFormat.openacc, str(tmp_path))
    assert [recording.info.labels for recording in iterate_recordings(data)] == [("model",)] * 4
    without = data_id(data)
    (tmp_path / INDEX_FILE).write_text(INDEX)
    assert data_id(data) != without
    recordings = list(iterate_recordings(data))
    assert recordings[0].labels["model"].to_dict() == {1: "M1", 2: "M2", 3: "M3", 4: "M4"}
    settings = [set(labels) for labels in track_labels(recordings, "setting", "discover.by")]
    assert settings == [{"S"}, {"mixed"}, {None}, {None}]
    assert [set(labels) for labels in track_labels(recordings, "acc", "discover.by")] == [{"1"}, {"1"}, {"0"}, {None}]
    assert label_of_same(data) == "model"


@pytest.mark.parametrize("line", ["run_1.csv,,,['2'],['S'],1", "run_1.csv,,,['1'],['X'],1"])
def test_an_index_that_states_nothing_usable_stops(tmp_path, line):
    index = tmp_path / INDEX_FILE
    index.write_text(f"{INDEX.splitlines()[0]}\n{line}\n")
    with refused("label-unusable", file=str(index)):
        labels_of_run(index, "run_1")
    index.write_text(INDEX + INDEX.splitlines()[1] + "\n")
    with refused("run-twice", file=str(index)):
        labels_of_run(index, "run_1")


def test_a_vehicle_of_two_models_stops(tmp_path):
    rows = _platoon()
    rows.loc[rows.index[-1], "model"] = "ANOTHER"
    rows.to_parquet(tmp_path / "platoons.parquet")
    with refused("models-contradict", column="model", row=len(rows)):
        next(iterate_recordings(DataConfig(DataFormat.openacc, str(tmp_path))))


def test_people_are_told_by_whom_they_follow(tmp_path):
    pairs = pd.concat([_pair(3, "CAV", 7), _pair(4, "HV", 7), _pair(5, "HV", 8)], ignore_index=True)
    (recording,) = _read_pairs(tmp_path, pairs)
    followers = recording.labels.loc[[6, 8, 10]]
    assert followers["leader"].tolist() == ["ACC", "person", "person"]
    assert followers["person"].tolist() == ["run1_7", "run1_7", "run1_8"]
    assert recording.labels.loc[[7, 9, 11]].isna().all(axis=None)
    table = recording.table
    assert (table.loc[table["track_id"] == 6, "leader_id"] == 7).all()
    behind, ahead = (table.loc[table["track_id"] == track, "position"].to_numpy() for track in (6, 7))
    np.testing.assert_allclose(ahead - behind, 30.0, atol=1e-9)  # the source's gap is the spacing less 5 m
    assert set(table["length"]) == {5.0}
    assert label_of_same(DataConfig(DataFormat.fhwa, str(tmp_path))) == "person"


def test_pairs_that_contradict_themselves_stop(tmp_path):
    pairs = _pair(3, "CAV", 7)
    with refused("group-unknown", column="group", row=5):
        _read_pairs(tmp_path, pairs.assign(group=["CAV"] * 4 + ["bus"] * 96))
    with refused("pair-contradicts", column="follower_id", row=61):
        _read_pairs(tmp_path, pairs.assign(follower_id=[7] * 60 + [8] * 40))


@pytest.fixture
def table(tmp_path) -> pd.DataFrame:
    """Two vehicles with a text and a number that say what they are."""
    pairs = pd.concat([_pair(3, "CAV", 7), _pair(4, "HV", 8)], ignore_index=True)
    (recording,) = _read_pairs(tmp_path, pairs)
    plain = recording.table.drop(columns=["leader", "person"])
    kind = plain["track_id"].map({6: "a", 8: "b"})
    return plain.assign(kind=kind, wheels=plain["track_id"].map({6: 4.0, 7: 6.0, 8: 4.0, 9: 4.0}))


@pytest.mark.parametrize("ending", [".csv", ".parquet", ""])
def test_any_column_of_a_table_that_is_asked_for_is_a_label(table, tmp_path, ending):
    if ending:
        data = DataConfig(DataFormat.table, str(write_table(table, tmp_path / f"tracks{ending}")))
    else:
        data = in_memory(table, DataConfig())
    (plain,) = iterate_recordings(data)
    assert plain.info.labels == ()
    (recording,) = iterate_recordings(data, ["kind", "wheels", "lane"])
    assert recording.info.labels == ("kind", "wheels")
    assert recording.labels["kind"].dropna().to_dict() == {6: "a", 8: "b"}
    assert recording.labels["wheels"].to_dict() == {6: "4", 7: "6", 8: "4", 9: "4"}
    (found,) = track_labels([recording], "kind", "discover.by")
    assert found.to_dict() == {6: "a", 7: None, 8: "b", 9: None}
    with refused("label-unknown", key="discover.by"):
        track_labels([recording], "colour", "discover.by")


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_labels_are_written_and_read_back(table, tmp_path, ending):
    data = in_memory(table, DataConfig())
    (recording,) = iterate_recordings(data, ["kind", "wheels"])
    path = write_recording(recording, tmp_path / f"back{ending}")
    back = TableFile(path, DataConfig()).read(recording.info.id)
    assert back.info.labels == recording.info.labels
    pd.testing.assert_frame_equal(back.labels.astype(object), recording.labels.astype(object))


def test_labels_stay_with_the_pieces_of_a_track(table):
    table = table.copy()
    table.loc[(table["track_id"] == 8) & (table["frame"] == 50), "speed"] = -1.0
    data = replace(in_memory(table, DataConfig()), on_bad=BadRows.drop_row)
    (recording,) = iterate_recordings(data, ["kind"])
    assert len(recording.labels) == 5  # one of the four was cut in two
    assert recording.labels["kind"].dropna().sort_values().tolist() == ["a", "b", "b"]


def test_a_label_that_changes_in_a_track_stops(table):
    table = table.copy()
    table.loc[table.index[10], "kind"] = "c"
    with refused("label-varies", column="kind"):
        list(iterate_recordings(in_memory(table, DataConfig()), ["kind"]))


def test_canonical_columns_are_labels_too(table):
    table = table.copy()
    table["lane"] = pd.array([0] * 40 + [1] * 60 + [0] * 300, "Int8")
    (recording,) = iterate_recordings(in_memory(table, DataConfig()))
    assert track_labels([recording], "lane", "discover.by")[0].tolist() == ["1", "0", "0", "0"]
    assert set(track_labels([recording], "recording", "discover.by")[0]) == {recording.info.id}
    assert set(track_labels([recording], "vehicle_class", "discover.by")[0]) == {"car"}
