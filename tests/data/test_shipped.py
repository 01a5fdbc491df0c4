"""Shipped recordings: they read, have the numbers their README states, lie next to their licence, and are small."""

import re
import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest

from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.data.recordings import data_id, iterate_recordings
from rearl_jax.data.shipped import packing

PAIRS = tuple(packing.SETS)
SHIPPED = ("us101", *PAIRS)


def stated():
    """Rows of the README's table by the name of the format, a dictionary per row."""
    text = (DataFormat["us101"].shipped.parent / "README.md").read_text(encoding="utf-8")
    head, _, *rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")
    ]
    return {row[0].strip("`"): dict(zip(head, row, strict=True)) for row in rows}


def config(name, **keys):
    on_bad = BadRows.drop_row if name == "openacc" else BadRows.stop
    return DataConfig(DataFormat[name], on_bad=on_bad, **keys)


def recordings_of(name, **keys):
    return list(iterate_recordings(config(name, **keys)))


def test_the_readme_lists_every_shipped_set():
    assert list(stated()) == list(SHIPPED)
    assert {kind.name for kind in DataFormat if kind.shipped} == set(SHIPPED)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_set_has_the_numbers_that_its_readme_states(name):
    said = stated()[name]
    (file,) = DataFormat[name].shipped.glob("*.parquet")
    found = recordings_of(name)
    tables = [recording.table for recording in found]
    followers = [table.loc[table["leader_id"].notna()] for table in tables]
    numbers = {
        "rows": pq.read_metadata(file).num_rows,
        "recordings": len(found),
        "vehicles": sum(table["track_id"].nunique() for table in tables),
        "followers": sum(rows["track_id"].nunique() for rows in followers),
        "minutes behind a leader": round(sum(len(rows) for rows in followers) / 600),
    }
    assert numbers == {key: int(said[key].replace(",", "")) for key in numbers}
    assert {recording.info.licence.replace("-", " ") for recording in found} == {said["licence"].replace("-", " ")}


@pytest.mark.parametrize("name", SHIPPED)
def test_licence_and_attribution_stand_beside_the_data(name):
    folder = DataFormat[name].shipped
    licence = (folder / "LICENSE").read_text(encoding="utf-8")
    opening = {
        "CC BY-SA 4.0": "Attribution-ShareAlike 4.0 International",
        "CC BY 4.0": "Creative Commons Attribution 4.0 International",
        "Apache 2.0": "Apache License",
    }
    assert licence.lstrip().startswith(opening[stated()[name]["licence"]])
    assert len(licence) > 10_000
    attribution = (folder / "ATTRIBUTION").read_text(encoding="utf-8")
    assert stated()[name]["licence"].replace("Apache 2.0", "Apache License 2.0") in attribution
    assert re.search(r"https://\S+", attribution)
    assert "Changes against the source" in attribution
    (file,) = folder.glob("*.parquet")
    assert file.name in attribution
    for column in pq.read_schema(file).names:
        assert re.search(rf"\b{column}\b", attribution), column


def test_leaders_and_followers_take_six_megabytes_at_most():
    sizes = [file.stat().st_size for name in PAIRS for file in DataFormat[name].shipped.iterdir()]
    assert sum(sizes) <= 6_000_000


def test_lane_changers_take_four_megabytes_at_most():
    (file,) = DataFormat["us101"].shipped.glob("*.parquet")
    assert file.stat().st_size < 4_000_000


@pytest.mark.parametrize("name", SHIPPED)
def test_a_copy_elsewhere_is_read_as_data_root(name, tmp_path):
    for file in DataFormat[name].shipped.iterdir():
        shutil.copy(file, tmp_path)
    there = config(name, root=str(tmp_path))
    assert data_id(there) == data_id(config(name))
    assert next(iterate_recordings(there)).table.equals(next(iterate_recordings(config(name))).table)


@pytest.mark.parametrize("name", PAIRS)
def test_packing_again_changes_nothing(name, tmp_path):
    folder = DataFormat[name].shipped
    packed = packing.pack(name, folder, tmp_path)
    (file,) = folder.glob("*.parquet")
    assert packed.name == file.name
    assert pq.read_table(packed).equals(pq.read_table(file))
    assert packed.stat().st_size == pytest.approx(file.stat().st_size, rel=0.2)
    index_file = packing.SETS[name].index_file
    assert index_file is None or (tmp_path / index_file).read_bytes() == (folder / index_file).read_bytes()


def test_lateral_positions_are_those_of_followers():
    (recording,) = recordings_of("i80_lateral")
    table = recording.table
    assert recording.info.id == "i80_0400"
    assert recording.dropped == {}
    follows = table["leader_id"].notna()
    assert (table["lateral"].notna() == follows).all()
    # Lanes are 12 feet wide.
    centres = table.groupby("lane", observed=True)["lateral"].median()
    assert np.diff(centres) == pytest.approx(3.66, abs=0.2)
    assert (table.loc[follows, "y"] == table.loc[follows, "lateral"]).all()
    assert set(table["vehicle_class"].unique()) == {"car", "truck", "motorcycle"}
    assert table["width"].notna().all()


def test_gaps_of_the_pairs_with_lateral_positions_are_those_of_the_source():
    (file,) = DataFormat["i80_lateral"].shipped.glob("*.parquet")
    source = pq.read_table(file).to_pandas()
    gap = (source["y_l_m"] - source["y_f_m"] - source["leader_length_m"]).astype(float)
    (recording,) = recordings_of("i80_lateral")
    leader = recording.table[["track_id", "frame", "position", "length"]].rename(columns={"track_id": "leader_id"})
    both = recording.table.merge(leader, on=["leader_id", "frame"], suffixes=("", "_leader"))
    found = both["position_leader"] - both["position"] - (both["length_leader"] + both["length"]) / 2
    assert len(found) == len(source) == 68_309
    np.testing.assert_allclose(np.sort(found), np.sort(gap), atol=1e-9)


def test_the_platoons_hold_all_cars_settings_and_people():
    folder = DataFormat["openacc"].shipped
    (file,) = folder.glob("*.parquet")
    models = set(pq.read_table(file, columns=["model"])["model"].unique().to_pylist())
    cars = "AUDI_A4 AUDI_E_TRON BMW_I3 JAGUAR_I_PACE MAZDA_3 MERCEDES_GLE450 TESLA_MODEL3 TESLA_MODELS TESLA_MODELX"
    assert models >= {*cars.split(), "TOYOTA_RAV4"}
    runs = (folder / "zalazone_index.csv").read_text(encoding="utf-8")
    assert all(f"['{setting}']" in runs for setting in "SML")
    assert {name.split("__")[0] for name in runs.split() if "__" in name} >= {"short_setting", "no_ACC"}
