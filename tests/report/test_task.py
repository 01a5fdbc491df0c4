"""`rearl report` from end to end: what is on the page, that nothing is loaded, and what it says where it cannot."""

import json
import re
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config import DiscoverBlindTask, PrepareTask, StudyTable1Task, SweepThresholdsTask
from rearl_jax.evaluation.inputs import read_inputs
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row
from rearl_jax.problems import ProblemError
from rearl_jax.progress import progress_bar
from rearl_jax.replay.embedding import positions
from rearl_jax.results import Study
from rearl_jax.sweep.document import document_of
from tests.blind.made_tables import PROTOCOL, SUMMARY, TABLES
from tests.refusal import refused


class Seen(HTMLParser):
    """Elements of a page by name, with their attributes; whatever is opened is closed."""

    VOID = ("meta", "img", "br", "input", "link", "hr")

    def __init__(self, page):
        super().__init__()
        self.elements, self.open = [], []
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def of(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


def check_alone(page):
    """Nothing is loaded from anywhere, everything is well formed and described."""
    assert not re.search(r"""(src|href|action)\s*=\s*["']?\s*(https?:)?//""", page)
    assert not re.search(r"@import|url\(\s*['\"]?(?!data:)", page)
    assert "default-src 'none'" in page
    seen = Seen(page)
    assert all(attributes["src"].startswith("data:image/png;base64,") for attributes in seen.of("img"))
    assert all(attributes["alt"] for attributes in seen.of("img"))
    assert all("src" not in attributes for attributes in seen.of("script"))
    regions = [attributes["aria-label"] for attributes in seen.of("div") if attributes.get("class") == "scroll"]
    assert len(regions) >= len(seen.of("table"))
    assert all(regions)
    assert len(seen.of("h1")) == 1
    assert all(attributes.get("aria-label") for attributes in seen.of("canvas"))
    assert 'name="viewport"' in page
    assert "prefers-color-scheme: dark" in page
    return seen


def words(page):
    """The visible text, without figures and scripts."""
    page = re.sub(r"<(script|style)\b.*?</\1>|base64,[^\"]*", "", page, flags=re.DOTALL)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", page))


def reported_words(make_report, root, study):
    """The words of the page that is made of a study, which needs nothing but itself."""
    make_report(root, study)
    page = (root / study / "page.html").read_text()
    check_alone(page)
    return words(page)


def test_an_evaluation_is_reported_with_intervals_and_provenance(reported):
    seen = check_alone(reported.page)
    text = words(reported.page)
    summary = json.loads((reported.folder / "summary.json").read_text())[0]
    low, high = summary["h_low"], summary["h_high"]
    assert f"The speeds of base are a Hellinger distance of {summary['h']:.3f} ({low:.3f} to {high:.3f})" in text
    assert f"{low:.3f} to {high:.3f}" in text.split("Metrics by method")[1]
    for part in ("config_hash", "data_id", "git_sha"):
        assert summary[part] is None or summary[part] in text
    assert "rearl evaluate method=base" in text
    for said in ("Licence: CC BY-SA 4.0", "U.S. Department of Transportation", "about a tenth of the traffic"):
        assert said in text
    assert "rearl report study=quick replays more scenes." in reported.before
    assert "Interventions" not in text  # nobody intervenes in base
    assert len(seen.of("img")) == len(list(reported.folder.glob("*.png"))) == 3
    assert not re.search(r"\b(nan|None)\b", text.split("Complete configuration")[0])
    assert f"scenes {', '.join(map(str, reported.found['scenes']))}" in reported.printed
    assert reported.found["size"] < 1_500_000


def test_the_page_of_the_task_says_the_same_and_replays_its_example(reported, make_report, read_replay, tmp_path):
    """All but the origin of the replayed scenes and the name of the data is as the task wrote it."""
    (example,) = read_replay(reported.before)["scenes"]
    make_report(reported.root, "quick", scenes=(example["id"],), path=str(tmp_path / "example.html"))
    again = (tmp_path / "example.html").read_text(encoding="utf-8")
    assert read_replay(again)["scenes"] == [example]

    def without_origin(page):
        return re.sub(r"Simulated .*?(?= Both are drawn)|configuration \w+, .*?(?= Complete)", "", words(page))

    assert without_origin(again) == without_origin(reported.before)


def test_the_replay_is_the_rollout_of_the_study(reported):
    """Positions are those of the same functions `rearl evaluate` calls, to the centimetre."""
    with progress_bar() as bar:
        study = Study(reported.root, "other", reported.config, "evaluate")
        scenes = read_inputs(reported.config, study, bar, with_references=False).scenes
    replay = reported.replay
    assert len(replay["scenes"]) == 3
    chosen = np.array([int(np.flatnonzero(scenes.scene_id == one["id"])[0]) for one in replay["scenes"]])
    (simulated,) = Rollouts([Row(reported.config)], scenes, chosen).chunks()
    runs = pd.read_parquet(reported.folder / "runs.parquet").query("method == 'base'").set_index("scene_id")
    for column, (index, one) in enumerate(zip(chosen, replay["scenes"], strict=True)):
        assert one["h"] == pytest.approx(float(runs.loc[one["id"], "h"]), abs=1e-4)
        for vehicle, piece in enumerate(one["sim"]["vehicles"]):
            assert piece["l"] == 500
            np.testing.assert_allclose(positions(piece["x"]), simulated.frames.x[:, vehicle, column], atol=0.006)
            np.testing.assert_allclose(positions(piece["y"]), simulated.frames.y[:, vehicle, column], atol=0.006)
        # Every picked vehicle of every snapshot is there once, at its place.
        found = {}
        for piece in one["real"]["vehicles"]:
            for second, x in enumerate(positions(piece["x"])):
                found.setdefault(piece["t"] + second, []).append(x)
        assert sorted(found) == list(range(scenes.seconds))
        for second, x in found.items():
            np.testing.assert_allclose(sorted(x), np.sort(scenes.position[index, second]), atol=0.006)
        travelled = positions(one["sim"]["vehicles"][0]["x"])
        assert travelled[-1] - travelled[0] > 500  # it drives
        assert not one["sim"]["asked"]
        assert one["sim"]["crash"] == [8, *[-1] * 9]  # the first vehicle, in the ninth second


def test_scenes_path_and_replay_are_as_asked_for(reported, make_report, read_replay, tmp_path):
    some = reported.found["scenes"][:1]
    found, _ = make_report(reported.root, "quick", scenes=tuple(some), path=str(tmp_path / "mine.html"))
    assert [one["id"] for one in read_replay((tmp_path / "mine.html").read_text())["scenes"]] == some
    found, _ = make_report(reported.root, "quick", replay=False, path=str(tmp_path / "without.html"))
    assert found["scenes"] == []
    assert "replay-data" not in (tmp_path / "without.html").read_text()
    with refused("scene-not-held-out", key="report.scenes", value=999) as caught:
        make_report(reported.root, "quick", scenes=(999,))
    assert str(some[0]) in caught.value.problem.fault
    with refused("out-of-range", key="report.run"):
        make_report(reported.root, "quick", run=7)


def test_without_its_data_a_study_is_reported_without_replay(copied, make_report):
    file = copied / "quick" / "summary.json"
    rows = json.loads(file.read_text())
    file.write_text(json.dumps([row | {"data_id": "us101-gone"} for row in rows]))
    found, printed = make_report(copied, "quick")
    assert found["scenes"] == []
    page = (copied / "quick" / "page.html").read_text()
    check_alone(page)
    for text in (printed, words(page)):
        assert "No scenes are replayed here: the data of the study are us101-gone, those at data.root are" in text
    assert "Metrics by method" in page
    assert "replay-data" not in page


def test_rollouts_that_are_not_those_of_the_study_are_not_shown(copied, make_report):
    runs = pd.read_parquet(copied / "quick" / "runs.parquet")
    runs["h"] = runs["h"] + 0.01
    runs.to_parquet(copied / "quick" / "runs.parquet")
    found, _ = make_report(copied, "quick")
    assert re.search(
        r"run 0 of scene \d+ has a Hellinger distance of 0\.\d+, but the study has 0\.\d+", found["no_replay"]
    )
    assert found["scenes"] == []


def test_a_discovery_is_reported_with_its_verdict_and_hostile_names_are_text(discovery, make_report):
    make_report(discovery, "found")
    page = (discovery / "found" / "page.html").read_text()
    seen = check_alone(page)
    text = words(page)
    assert "Missing in the model: reaction delay." in text
    assert "Generated recordings, not measured" in text
    assert "delay [s] 0.700 0.600 to 0.800 0.90" in text  # value, interval, confidence
    assert "closed-loop gap error [m] 1.50 1.00 to 2.00" in text
    assert "105 drivers who follow a leader" in text
    assert "Source and licence of the recordings are unknown: " in text
    assert seen.of("script") == []
    assert page.count("alert(1)") >= 3
    assert page.count("&lt;/script&gt;&lt;script&gt;alert(1)") == page.count("alert(1)")
    # Maps of what the model leaves come first, figures nobody describes last.
    assert [attributes["alt"] for attributes in seen.of("img")] == ["maps", "planes", "another"]


def test_a_sweep_is_reported_with_its_pairs(make_study, make_report):
    summary = {"n_pairs": 2, "n_rollouts": 30, "best_h_pct": 10.0, "best_m_pct": 5.0, "best_score": 0.5}
    summary |= {"base_score": 0.7, "best_win_share": 0.9, "lead": 0.1, "lead_low": 0.05, "lead_high": 0.2}
    table = pd.DataFrame({"h_pct": [5.0, 10.0], "m_pct": [5.0, 5.0], "score": [0.6, 0.5], "win_share": [0.1, 0.9]})
    root = make_study(
        "sweep", "sweep thresholds", SweepThresholdsTask(), summary | {"is_distinguishable": True}, {"table3": table}
    )
    text = reported_words(make_report, root, "sweep")
    assert "the percentiles 10 % / 5 % leave the least error, 0.500 compared with 0.700 without interventions" in text
    assert "can distinguish it from the next" in text
    assert "lead of 10 % / 5 % over 5 % / 5 %: 0.1000, 95 % bootstrap interval over scenes 0.0500 to 0.2000" in text
    assert text.index("10 % / 5 % 0.500") < text.index(" 5 % / 5 % 0.600") < text.index("base 0.700")  # the best first


def test_a_sweep_of_one_scene_or_one_pair_tells_none_apart():
    summary = {"n_pairs": 2, "n_rollouts": 2, "best_score": 0.5, "base_score": 0.7, "is_distinguishable": False}
    summary |= {"lead": 0.1, "lead_low": None, "lead_high": None}
    table = pd.DataFrame({"h_pct": [5.0, 10.0], "m_pct": [5.0, 5.0], "score": [0.6, 0.5], "win_share": [0.0, 1.0]})
    document = document_of(SweepThresholdsTask(), table, summary, {}, generated=False)
    assert "lead of 10 % / 5 % over 5 % / 5 %: 0.1000, no interval from one scene" in document.sections[0].notes
    alone = document_of(SweepThresholdsTask(), table[1:], summary, {}, generated=False)
    assert "distinguish" not in alone.verdict
    assert not any("lead" in note for note in alone.sections[0].notes)


def test_a_study_beside_the_paper_is_reported_with_both(make_study, make_report):
    table = pd.DataFrame(
        {
            "row": ["base", "rearl"],
            "title": ["base", "<b>REARL</b>"],
            "metric": ["h", "h"],
            "ours": [0.5, 0.4],
            "low": [0.45, 0.35],
            "high": [0.55, 0.45],
            "less_base": [None, -0.1],
            "less_base_low": [None, -0.15],
            "less_base_high": [None, -0.05],
            "paper": [None, 0.3],
        }
    )
    root = make_study("paper", "study table1", StudyTable1Task(), {"n_scenes": 5, "rearl_h": 0.4}, {"table1": table})
    (root / "paper" / "rows").mkdir()
    found, _ = make_report(root, "paper")
    page = (root / "paper" / "page.html").read_text()
    check_alone(page)
    text = words(page)
    assert "&lt;b&gt;REARL&lt;/b&gt; 0.400 0.350 to 0.450 paper: &lt;b&gt;REARL&lt;/b&gt; 0.300" in text
    assert "-0.100 -0.150 to -0.050" in text.split("Difference from base, from the same initial states")[1]
    assert "rearl report study=paper/rows/ROW" in found["no_replay"]


def test_a_blind_study_is_reported_with_its_rates(make_study, make_report):
    root = make_study("blind", "discover blind", DiscoverBlindTask(), SUMMARY, TABLES, protocol=PROTOCOL)
    text = reported_words(make_report, root, "blind")
    assert "Discovery was right about 2 of 3 data sets" in text
    assert "effects named 2 3 66.7 9.0 to 99.0 ≥ 95 % no" in text


def test_what_is_no_finished_study_is_refused_with_the_remedy(discovery, make_report, make_study):
    def said_of(name, code, **fields):
        with refused(code, ProblemError, **fields) as caught:
            make_report(discovery, name)
        return str(caught.value)

    assert "finished studies there: found" in said_of("missing", "study-missing", key="study")
    said_of("../found", "name-unusable", key="study")
    (discovery / "empty").mkdir()
    said_of("empty", "no-study", key=None, file=str(discovery / "empty"))
    make_study("tables", "prepare", PrepareTask(), {"n": 1})
    assert "evaluate, discover" in said_of("tables", "no-report", key="study")
    (discovery / "found" / "summary.json").unlink()
    said_of("found", "study-unfinished", key=None, file=str(discovery / "found"))


def test_a_study_of_an_older_version_is_refused_with_the_key(discovery, make_report):
    folder = discovery / "found"

    def check(file, code, key):
        with refused(code, key=key, file=str(folder / file)) as caught:
            make_report(discovery, "found")
        assert "with this version" in caught.value.problem.remedy

    verdict = json.loads((folder / "verdict.json").read_text())
    del verdict["lane_choice"]
    (folder / "verdict.json").write_text(json.dumps(verdict))
    check("verdict.json", "key-missing", "lane_choice")
    config = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps(config | {"data": config["data"] | {"kind": "us101"}}))
    check("config.json", "key-unknown", "data.kind")
    (folder / "summary.json").write_text('{"task": "discover"}')
    check("summary.json", "provenance-missing", None)
    (folder / "summary.json").write_text("{")
    check("summary.json", "not-json", None)


def test_figures_that_other_code_named_otherwise_are_refused(discovery, make_report):
    folder = discovery / "found"
    verdict = json.loads((folder / "verdict.json").read_text())
    for row in verdict["candidates"]:
        row["surprise"] = row.pop("z_score")
    (folder / "verdict.json").write_text(json.dumps(verdict))
    with pytest.raises(KeyError):  # of this code, so an error of its own
        make_report(discovery, "found")
    summary = json.loads((folder / "summary.json").read_text())
    (folder / "summary.json").write_text(json.dumps(summary | {"code_hash": "0123456789abcdef"}))
    with refused("key-missing") as caught:
        make_report(discovery, "found")
    assert "z_score" in str(caught.value)


def test_keys_that_did_not_exist_then_have_their_defaults(discovery, make_report):
    file = discovery / "found" / "config.json"
    config = json.loads(file.read_text())
    del config["discover"]["confidence"]
    file.write_text(json.dumps(config))
    summary = json.loads((discovery / "found" / "summary.json").read_text())
    (discovery / "found" / "summary.json").write_text(json.dumps(summary | {"config_hash": "of_another_time"}))
    text = reported_words(make_report, discovery, "found")
    assert "Keys that did not exist when the study was made are listed with their defaults." in text
    assert "configuration of_another_time" in text
