"""OpenACC platoons: positions rebuilt from speeds and gaps, holes, negative gaps, missing vehicles."""

import threading
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.formats.openacc import fill_holes, find_platoons, platoon_recordings, read_platoon
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.problems import MissingInputError
from tests.refusal import refused

STOP = DataConfig()
DROP_ROW = DataConfig(on_bad=BadRows.drop_row)
T = np.arange(200) / 10.0


def _platoon(n: int = 4) -> pd.DataFrame:
    """n vehicles that swing around 12 m/s; the gap to follower k opens and closes as their speeds say."""
    rows = []
    speeds = [12.0 + np.sin(0.4 * T - 0.3 * k) for k in range(n)]
    moved = [np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) / 10.0)]) for v in speeds]
    for k in range(n):
        gap = 15.0 + 2.0 * k + moved[k] - moved[k + 1] if k + 1 < n else np.nan
        rows.append(
            pd.DataFrame(
                {
                    "file": "run_1",
                    "t_s": 30.0 + T,
                    "pos": np.int8(k + 1),
                    "speed_mps": speeds[k],
                    "e_m": 0.0,
                    "n_m": 0.0,
                    "gap_to_follower_m": gap,
                    "model": "MADE",
                }
            )
        )
    return pd.concat(rows, ignore_index=True)


def _read(folder: Path, rows: pd.DataFrame, policy: DataConfig = STOP):
    rows.to_parquet(folder / "platoons.parquet")
    path = find_platoons(folder)
    return [read_platoon(path, name, part, policy) for name, part in platoon_recordings(path).items()]


def _gaps(table: pd.DataFrame, leader: int, follower: int) -> np.ndarray:
    ahead, behind = (table[table["track_id"] == i].set_index("frame")["position"] for i in (leader, follower))
    return (ahead - behind).dropna().to_numpy() - 4.5


def test_positions_hold_the_gaps_and_the_leaders_integrated_speed(tmp_path):
    rows = _platoon()
    (recording,) = _read(tmp_path, rows)
    table = recording.table
    assert recording.info.id == "openacc_run_1"
    assert recording.dropped == {}
    for k in (1, 2, 3):
        expected = rows.loc[rows["pos"] == k, "gap_to_follower_m"]
        np.testing.assert_allclose(_gaps(table, k, k + 1), expected, atol=1e-9)
        assert set(table.loc[table["track_id"] == k + 1, "leader_id"]) == {k}
    first = table[table["track_id"] == 1]
    # Closed form of the integral of 12 + sin(0.4 t).
    driven = 12.0 * T + (1.0 - np.cos(0.4 * T)) / 0.4
    np.testing.assert_allclose(first["position"] - first["position"].iloc[0], driven, atol=1e-3)
    assert table["position"].min() == pytest.approx(2.25)
    assert recording.info.road_length == pytest.approx(table["position"].max() + 2.25)
    assert set(table["lane"]) == {0}
    assert any("4.5 m assumed" in note for note in recording.info.notes)


def test_negative_gaps_stop_or_are_left_out_and_counted(tmp_path):
    rows = _platoon()
    rows.loc[(rows["pos"] == 2) & rows.index.isin(range(250, 300)), "gap_to_follower_m"] = -1.0
    with refused("negative-gap", column="gap_to_follower_m", row=251) as caught:
        _read(tmp_path, rows)
    assert "run_1" in caught.value.problem.file
    (recording,) = _read(tmp_path, rows, DROP_ROW)
    # 5 s without a gap: the two vehicles behind have no place, and go on under new ids.
    assert recording.dropped == {"negative_gap": 50, "no_gap": 100, "gap_cuts": 2}
    assert recording.table.groupby("track_id").size().tolist() == [200, 200, 50, 50, 100, 100]
    later = recording.table[recording.table["track_id"] == 6]
    assert set(later["leader_id"]) == {5}
    (recording,) = _read(tmp_path, rows, DataConfig(on_bad=BadRows.drop_track))
    assert set(recording.table["track_id"]) == {1, 2}


def test_a_hole_of_a_second_is_filled_a_longer_one_is_not(tmp_path):
    rows = _platoon()
    third = rows.index[rows["pos"] == 3]
    whole = rows.loc[third, "gap_to_follower_m"].to_numpy().copy()
    rows.loc[third[50:60], "gap_to_follower_m"] = np.nan
    (recording,) = _read(tmp_path, rows)
    assert recording.dropped == {}
    assert "10 speeds and gaps in holes" in recording.info.notes[-1]
    np.testing.assert_allclose(_gaps(recording.table, 3, 4), whole, atol=0.05)
    rows.loc[third[60], "gap_to_follower_m"] = np.nan
    with refused("no-gap", column="gap_to_follower_m", row=651):
        _read(tmp_path, rows)
    (recording,) = _read(tmp_path, rows, DROP_ROW)
    assert recording.dropped == {"no_gap": 11, "gap_cuts": 1}


def test_fill_holes_leaves_ends_and_long_holes():
    column = np.array([np.nan, 1.0, np.nan, np.nan, 4.0, *[np.nan] * 11, 16.0, np.nan])
    filled = fill_holes(column[:, None])[:, 0]
    np.testing.assert_array_equal(filled[:5], [np.nan, 1.0, 2.0, 3.0, 4.0])
    assert np.isnan(filled[5:16]).all()
    assert filled[16] == 16.0
    assert np.isnan(filled[17])
    column[6] = 6.0
    assert np.isnan(fill_holes(column[:, None])).sum() == 2
    assert np.isnan(fill_holes(np.full((5, 1), np.nan))).all()


def test_a_missing_vehicle_parts_the_platoon_and_a_lone_one_is_counted(tmp_path):
    rows = _platoon(7)
    rows = rows[rows["pos"] != 3]
    rows.loc[rows["pos"] == 2, "gap_to_follower_m"] = np.nan
    first, second = _read(tmp_path, rows, DROP_ROW)
    assert [r.info.id for r in (first, second)] == ["openacc_run_1_1to2", "openacc_run_1_4to7"]
    assert [sorted(set(r.table["track_id"])) for r in (first, second)] == [[1, 2], [4, 5, 6, 7]]
    for part in (first, second):
        assert sum(note.startswith("vehicles that are not recorded: 3;") for note in part.info.notes) == 1
    rows = rows[rows["pos"] != 1]
    with refused("unlinked", column="pos", row=1):
        _read(tmp_path, rows)
    (only,) = _read(tmp_path, rows, DROP_ROW)
    assert only.dropped == {"unlinked": 200}
    assert only.info.id == "openacc_run_1"


@pytest.mark.parametrize("on_bad", BadRows)
def test_a_run_without_any_gap_does_not_vanish_beside_others(tmp_path, on_bad):
    alone = _platoon(2).assign(file="run_2", gap_to_follower_m=np.nan)
    with refused("unlinked", column="gap_to_follower_m", row=401):
        _read(tmp_path, pd.concat([_platoon(2), alone]), DataConfig(on_bad=on_bad))


def test_a_jumping_gap_is_found(tmp_path):
    rows = _platoon()
    rows.loc[(rows["pos"] == 1) & (rows["t_s"] > 40.0), "gap_to_follower_m"] += 5.0
    with refused("jump", column="gap_to_follower_m", row=302):
        _read(tmp_path, rows)
    (recording,) = _read(tmp_path, rows, DROP_ROW)
    assert recording.dropped == {"jump_cuts": 3}


def test_small_negative_speeds_are_standing_still(tmp_path):
    rows = _platoon()
    rows.loc[5, "speed_mps"] = -0.05
    (recording,) = _read(tmp_path, rows)
    assert recording.table["speed"].min() == 0.0
    assert "1 negative speeds set to 0" in recording.info.notes[-1]


def test_damaged_statistics_do_not_hold_the_reading_up(tmp_path):
    (sound,) = _read(tmp_path, _platoon())
    path = find_platoons(tmp_path)
    content = path.read_bytes()
    # The footer says that the texts of the first column are float32, so that its statistics cannot be understood.
    spoiled = content.replace(b"\x15\x0c\x19", b"\x15\x08\x19", 1)
    assert spoiled != content
    path.write_bytes(spoiled)
    found = []
    reading = threading.Thread(target=lambda: found.append(read_platoon(path, *_only(path), STOP)), daemon=True)
    reading.start()
    reading.join(timeout=60)
    assert len(found) == 1
    pd.testing.assert_frame_equal(found[0].table, sound.table)


@pytest.mark.parametrize(
    ("sound", "damaged", "says"),
    [
        (b"run_1", b"\xf2un_1", "UTF8"),
        (b"\x16\x52\x19", b"\x16\x54\x19", "41 of its 42 rows"),  # the number of rows in the footer
    ],
)
def test_damage_inside_is_named(tmp_path, sound, damaged, says):
    path = tmp_path / "platoons.parquet"
    _platoon().iloc[:41].to_parquet(path)
    content = path.read_bytes()
    assert sound in content
    path.write_bytes(content.replace(sound, damaged))
    with refused("not-parquet", file=str(path)) as caught:
        platoon_recordings(path)
    assert says in caught.value.problem.fault


def _only(path: Path):
    ((name, platoon),) = platoon_recordings(path).items()
    return name, platoon


def test_files_are_recordings(tmp_path):
    both = pd.concat([_platoon(), _platoon(3).assign(file="run_2")])
    both.to_parquet(tmp_path / "platoons.parquet")
    recordings = list(iterate_recordings(DataConfig(DataFormat.openacc, str(tmp_path))))
    assert [r.info.id for r in recordings] == ["openacc_run_1", "openacc_run_2"]
    assert [r.table["track_id"].nunique() for r in recordings] == [4, 3]
    with refused("recordings-missing", MissingInputError):
        find_platoons(tmp_path / "elsewhere")
