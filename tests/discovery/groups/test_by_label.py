"""Discovery by groups: each gets the verdict of what is planted in it, and everything is written."""

import json

import pandas as pd
import pytest

from rearl_jax.config import DataConfig, DiscoverConfig, DiscoverTask, ResultsConfig
from rearl_jax.config.data import DataFormat
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.discovery import compute
from rearl_jax.discovery.discover import Discovery
from rearl_jax.discovery.read import reading
from rearl_jax.discovery.read.split import n_shared, split_drivers
from rearl_jax.discovery.report.error_block import error_block
from rearl_jax.discovery.report.groups_section import groups_section
from rearl_jax.discovery.report.tables import error_table
from rearl_jax.discovery.report.words import verdict_words
from rearl_jax.discovery.resampling import Resampling
from rearl_jax.discovery.task import run
from rearl_jax.problems import InvalidInputError
from tests.discovery.made_verdict import VERDICT
from tests.discovery.report.test_error_block import made
from tests.refusal import refused


def _known_again(tables, owner):
    """Drivers whose persons are those that `owner` makes of their tracks."""
    tracks = [table["track_id"].unique() for table, _ in tables]
    labels = [pd.Series([owner(k, track) for track in own], index=own, dtype=object) for k, own in enumerate(tracks)]
    return reading.measure(tables, labels={"person": labels}, identity_label="person")


def test_no_person_is_in_two_parts(tables_of):
    tables = tables_of()
    data = _known_again(tables, lambda recording, track: f"p{track % 12}")
    parts = split_drivers(data)
    assert [len(set(part.recording.tolist())) for part in parts] == [3, 3, 3]  # without persons one each
    persons = [set(part.identity_of_driver.tolist()) for part in parts]
    assert sum(map(len, persons)) == len(set.union(*persons)) == 12
    assert n_shared(parts[0], parts[2]) == 0
    few = split_drivers(_known_again(tables, lambda recording, track: f"p{track % 3}"))
    assert [len(set(part.recording.tolist())) for part in few] == [1, 1, 1]
    assert n_shared(few[0], few[2]) == 3


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
    config = _config(folder, tmp_path, base=("constant_time_headway",))  # one model to compare, few programs to compile
    verdict = run(config)
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
    (tmp_path / "roads" / "summary.json").unlink()  # as if interrupted before the end
    again = run(config)
    assert again == verdict | {"seconds": again["seconds"]}
    assert again["seconds"] < verdict["seconds"]


@pytest.fixture
def asked(monkeypatch):
    """Names of the groups that were looked into; each discovery is made by hand."""
    names = []

    def discovery_of(config, parts, recordings, bar, study, words):
        names.append(words)
        if len(names) == 2:
            raise KeyboardInterrupt
        errors = {"before": made(1.0 + len(words), 0.3)}
        verdict = VERDICT | {"error": error_block(errors, Resampling(0.9, 20, 0)), "base": None, "effects": []}
        verdict |= {"equilibrium_time_gap": {"10": None}}
        return Discovery(config, parts.id, verdict, {"errors": error_table(errors)})

    monkeypatch.setattr(compute, "discovery_of", discovery_of)
    return names


def test_an_interrupted_discovery_keeps_its_finished_groups(folder, tmp_path, asked):
    config = _config(folder, tmp_path, page=False)
    with pytest.raises(KeyboardInterrupt):
        run(config, show=False)
    verdict = run(config, show=False)
    assert asked == ["road flat", "road hilly", "road hilly"]
    assert [row["value"] for row in verdict["groups"]] == ["flat", "hilly"]
    assert verdict["error"]["n_drivers"] == 2 * verdict["groups"][0]["error"]["n_drivers"]
    again = run(config, show=False)  # what is finished is repeated
    assert asked[3:] == ["road flat", "road hilly"]
    assert again == verdict | {"seconds": again["seconds"]}


def test_labels_that_nobody_has_and_groups_too_small_are_named(folder, tmp_path):
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
        "equilibrium_time_gap": {"10": figure, "20": None}, "notes": [], "car_following": "idm",
        "labels": {"acc": {"value": "1", "share": 0.75}}, "failed_tests": [],
    }  # fmt: skip
    failed = {"test": "old_decisions", "names": [], "value": 5.0, "limit": 3.5}
    other = row | {"value": "S", "verdict": "unexplained", "effects": [], "cars": None, "failed_tests": [failed]}
    grouping = {"by": "setting", "left_out": {"M": 4}}
    section = groups_section({"groups": [row, other], "grouping": grouping})
    (table,) = section.tables
    assert [drawn.title for drawn in table.rows] == ["L", "S"]
    assert table.rows[0].cells[0].value == "16 of 10 persons or cars"
    assert [cell.value for cell in table.rows[1].cells[-2:]] == ["1.50", "-"]
    assert "S: noise grows" in section.notes[0]
    assert "4 drivers of group M are left out" in section.notes[1]
    words = verdict_words({"verdict": "named", "effects": [effect], "groups": [row, other]})
    assert words == "L: missing in the model: grade; S: unexplained (failed tests: old decisions)"
    kinds = {"kinds": 2, "gain": 34.0, "chance": 0.025, "purity": {"acc": {"value": 0.9, "by_chance": 0.6}}}
    notes = " ".join(groups_section({"groups": [row, other], "grouping": grouping | kinds}).notes)
    assert "2 kinds" in notes
    assert "90.0 %" in notes
    assert "acc 1 75.0 %" in notes
