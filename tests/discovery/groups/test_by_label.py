"""Discovery by groups: each gets the verdict of what is planted in it, and everything is written."""

import json

import pandas as pd
import pytest

from rearl_jax.config import DataConfig, DiscoverConfig, DiscoverTask, ResultsConfig
from rearl_jax.config.data import DataFormat
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.discovery.read import reading
from rearl_jax.discovery.read.split import in_both, split_drivers
from rearl_jax.discovery.report.groups_section import groups_section
from rearl_jax.discovery.report.words import verdict_words
from rearl_jax.problems import InvalidInputError
from tests.refusal import refused


def _known_again(tables, owner):
    """Drivers whose persons are those that `owner` makes of their tracks."""
    tracks = [table["track_id"].unique() for table, _ in tables]
    labels = [pd.Series([owner(k, track) for track in own], index=own, dtype=object) for k, own in enumerate(tracks)]
    return reading.measure(tables, labels={"person": labels}, same="person")


def test_no_person_is_in_two_parts(tables_of):
    tables = tables_of()
    data = _known_again(tables, lambda recording, track: f"p{track % 12}")
    parts = split_drivers(data)
    assert [len(set(part.recording.tolist())) for part in parts] == [3, 3, 3]  # without persons one each
    persons = [set(part.same.tolist()) for part in parts]
    assert sum(map(len, persons)) == len(set.union(*persons)) == 12
    assert in_both(parts[0], parts[2]) == 0
    few = split_drivers(_known_again(tables, lambda recording, track: f"p{track % 3}"))
    assert [len(set(part.recording.tolist())) for part in few] == [1, 1, 1]
    assert in_both(few[0], few[2]) == 3


@pytest.fixture(scope="module")
def folder(folder_of, tmp_path_factory):
    """Recordings of two roads, one of them with a grade, told apart by a column."""
    made = tmp_path_factory.mktemp("roads")
    for road, name in (("hilly", "grade"), ("flat", None)):
        root = str(folder_of(name, 1.5 if name else 1.0, n_vehicles=24))
        for recording in iterate_recordings(DataConfig(format=DataFormat.table, root=root)):
            table = recording.table.assign(recording=f"{road}_{recording.info.id}", road=road)
            table.to_parquet(made / f"{road}_{recording.info.id}.parquet")
    return made


def _config(folder, root, **keys):
    return DiscoverTask(
        study="roads",
        results=ResultsConfig(str(root)),
        data=DataConfig(format=DataFormat.table, root=str(folder)),
        discover=DiscoverConfig(**({"replicates": 6, "draws": 200, "by": "road"} | keys)),
    )


@pytest.mark.slow
def test_each_group_gets_its_verdict(folder, tmp_path):
    from rearl_jax.discovery.task import run

    verdict = run(_config(folder, tmp_path))
    flat, hilly = verdict["groups"]
    assert (flat["value"], hilly["value"]) == ("flat", "hilly")
    assert [effect["name"] for effect in hilly["effects"]] == ["grade"]
    assert flat["effects"] == []
    assert [effect["group"] for effect in verdict["effects"]] == ["hilly"]
    assert verdict["error"]["n_drivers"] == flat["error"]["n_drivers"] + hilly["error"]["n_drivers"]
    assert hilly["error"]["change"]["high"] < 0 == flat["error"]["change"]["value"]
    gap = flat["equilibrium_time_gap"]["10"]
    assert gap["low"] < gap["value"] < gap["high"]
    assert 1.0 < gap["value"] < 2.5
    inside = tmp_path / "roads" / "groups" / "hilly"
    assert {"model.yaml", "page.html", "verdict.json", "null.parquet"} <= {path.name for path in inside.iterdir()}
    assert json.loads((inside / "verdict.json").read_text())["effects"] == hilly["effects"]
    page = (tmp_path / "roads" / "page.html").read_text()
    assert "hilly: missing in the model: grade" in page.replace("Hilly", "hilly")


def test_labels_that_nobody_has_and_groups_too_small_are_named(folder, tmp_path):
    from rearl_jax.discovery.task import run

    with refused("label-unknown", key="discover.by"):
        run(_config(folder, tmp_path, by="colour"))
    with refused("label-unknown", key="discover.same"):
        run(_config(folder, tmp_path, same="plate"))
    with pytest.raises(InvalidInputError) as caught:
        DiscoverConfig(by="road", oracle="grade").check()
    assert caught.value.problem.key == "by"


def test_groups_are_a_table_and_a_line():
    figure = {"value": 1.5, "low": 1.0, "high": 2.0}
    effect = {"name": "grade", "kind": "road", "variables": [], "confidence": 0.9, "parameters": {}}
    row = {
        "by": "setting", "value": "L", "drivers": {"fitted": 5, "checked": 5, "reported": 6}, "cars": 10, "shared": 0,
        "verdict": "named", "effects": [effect], "error": {"before": figure, "after": figure},
        "equilibrium_time_gap": {"10": figure, "20": None}, "notes": [],
        "labels": {"acc": {"value": "1", "share": 0.75}},
    }  # fmt: skip
    other = row | {"value": "S", "verdict": "nothing", "effects": [], "cars": None}
    grouping = {"by": "setting", "left_out": {"M": 4}}
    section = groups_section({"groups": [row, other], "grouping": grouping})
    (table,) = section.tables
    assert [drawn.title for drawn in table.rows] == ["L", "S"]
    assert table.rows[0].cells[0].value == "16 of 10 persons or cars"
    assert [cell.value for cell in table.rows[1].cells[-2:]] == ["1.50", "-"]
    assert "4 drivers of group M are left out" in section.notes[0]
    words = verdict_words({"verdict": "named", "effects": [effect], "groups": [row, other]})
    assert words == "L: missing in the model: grade; S: nothing significant is missing"
    kinds = {"kinds": 2, "gain": 34.0, "chance": 0.025, "purity": {"acc": {"value": 0.9, "by_chance": 0.6}}}
    notes = " ".join(groups_section({"groups": [row, other], "grouping": grouping | kinds}).notes)
    assert "2 kinds" in notes
    assert "90.0 %" in notes
    assert "acc 1 75.0 %" in notes
