"""The order of a blind study, that nothing leaks, and that it can be killed at any time."""

import hashlib
import json
import os
import signal
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

from rearl_jax.blind import sealing
from rearl_jax.blind import task as module
from rearl_jax.blind.cases import list_cases
from rearl_jax.blind.rounds import judge_cases, open_study, run_cases
from rearl_jax.blind.sealing import open_protocol, open_truth
from rearl_jax.blind.task import run_with
from rearl_jax.blind.traffic.catalogue import LANE_CHOICE
from rearl_jax.config.blind import BlindConfig, StudySize
from rearl_jax.results import config_hash
from tests.blind.stub_study import Stub, task
from tests.refusal import refused

ROOT = Path(__file__).resolve().parents[2]
LANE_SETS = ("lane_choice", "lane_choice_control")


def silent(done, total):
    pass


def test_a_study_writes_everything(finished):
    root, summary = finished
    folder = root / "blind"
    assert summary["n_cases"] == 6
    names = {"cases", "scores", "sets", "strengths", "parameters", "calibration", "confusion"}
    assert {f"{name}.parquet" for name in names} <= {path.name for path in folder.iterdir()}
    cases = pd.read_parquet(folder / "cases.parquet")
    assert sorted(cases["variant"]) == ["default", "grade", "lens", "rain", "reaction_delay", "reaction_delay+grade"]
    stored = json.loads((folder / "summary.json").read_text())
    assert stored["generated"] is True
    assert {row["name"] for row in stored["scores"]} >= {"identified", "control_false", "artefact_as_effect"}
    assert stored["oracle_share"] is None
    page = (folder / "page.html").read_text()
    assert "How it was kept blind" in page
    assert "with a false effect" in page
    assert "Generated recordings" in page
    for name in ("confusion.png", "strengths.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")


def test_the_truth_is_sealed(finished):
    root, summary = finished
    folder = root / "blind"
    protocol = json.loads((folder / "protocol.json").read_text())
    content = (folder / "truth.json").read_bytes()
    assert hashlib.sha256(content).hexdigest() == protocol["truth_sha256"] == summary["truth_sha256"]
    assert protocol["code_hash"] == json.loads((folder / "summary.json").read_text())["code_hash"]
    assert protocol["seed_drawn"] is False


def test_each_data_set_was_asked_for_once_and_the_data_are_gone(finished):
    root, _ = finished
    asked = (root / "asked.txt").read_text().split("\n")[:-1]
    assert len(asked) == len(set(asked)) == 6
    assert all(line.endswith(" None") for line in asked)
    assert not (root / "blind" / "data").exists()


@pytest.mark.slow
def test_discovery_needs_no_truth(tmp_path):
    """The truth file is taken away while discovery runs; only the scorer misses it."""
    config = task(tmp_path, sets="named")
    folder = tmp_path / "blind"
    folder.mkdir()
    protocol, cases = open_study(folder, config_hash(config), config.blind, silent)
    sealed = (folder / "truth.json").read_bytes()
    (folder / "truth.json").unlink()
    seen = []

    def discover(data, study, oracle=None):
        seen.append((data.name, study, oracle, {path.suffix for path in data.iterdir()}))
        assert list(data.rglob("*.json")) == []
        return Stub(tmp_path / "asked.txt")(data, study, oracle)

    run_cases(folder, "blind", cases[:2], discover, config.blind, silent)
    assert len(seen) == 2
    for data, study, oracle, suffixes in seen:
        assert int(data, 16) >= 0
        assert study == f"blind/runs/{data}"
        assert oracle is None
        assert suffixes == {".parquet"}
    with pytest.raises(FileNotFoundError):
        judge_cases(folder, protocol, cases[:2])
    (folder / "truth.json").write_bytes(sealed.replace(b"grade", b"weather"))
    with refused("truth-changed"):
        open_truth(folder, protocol)


def test_code_is_written_down_before_a_seed_is_drawn(tmp_path, monkeypatch):
    def draw(bits):
        stored = json.loads((tmp_path / "protocol.json").read_text())
        assert stored["code_hash"] == sealing.code_hash()
        assert stored["thresholds_hash"] == sealing.THRESHOLDS.fingerprint()
        assert stored["master_seed"] is None
        return 77

    monkeypatch.setattr(sealing.secrets, "randbits", draw)
    protocol, is_continued = open_protocol(tmp_path, "c", BlindConfig())
    assert (protocol.master_seed, protocol.seed_drawn, is_continued) == (77, True, False)
    again, _ = open_protocol(tmp_path, "c", BlindConfig())
    assert again == protocol
    other, is_continued = open_protocol(tmp_path, "another configuration", BlindConfig(seed=5))
    assert (other.master_seed, other.seed_drawn, is_continued) == (5, False, False)


def test_other_thresholds_begin_a_study_anew(tmp_path, monkeypatch):
    open_protocol(tmp_path, "c", BlindConfig(seed=5))
    assert open_protocol(tmp_path, "c", BlindConfig(seed=6))[0].master_seed == 5
    monkeypatch.setattr(sealing, "THRESHOLDS", replace(sealing.THRESHOLDS, least_total=15.0))
    assert open_protocol(tmp_path, "c", BlindConfig(seed=6))[0].master_seed == 6


def test_verdicts_do_not_go_unnoticed(tmp_path, caplog):
    blind = BlindConfig(seed=11, sets="control")
    open_study(tmp_path, "one", blind, silent)
    kept = tmp_path / "verdicts" / "x.json"
    kept.parent.mkdir()
    kept.touch()
    open_study(tmp_path, "one", blind, silent)
    assert kept.is_file()
    assert caplog.messages == []
    open_study(tmp_path, "another", blind, silent)
    assert not kept.is_file()
    assert "starts again, verdicts removed: 1" in caplog.text


@pytest.mark.slow
def test_a_killed_study_goes_on_where_it_was(tmp_path, finished):
    whole, _ = finished

    def run(*words):
        command = [sys.executable, "-m", "tests.blind.stub_study", str(tmp_path), *words]
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300, env=os.environ)

    assert run("3").returncode == -signal.SIGKILL
    assert len(list((tmp_path / "blind" / "verdicts").iterdir())) == 3
    done = run()
    assert done.returncode == 0, done.stderr
    asked = (tmp_path / "asked.txt").read_text().splitlines()
    assert len(asked) == 7  # the fourth twice: it had no verdict yet
    assert len(set(asked)) == 6
    for name in ("cases", "scores", "confusion"):
        ours, theirs = (pd.read_parquet(root / "blind" / f"{name}.parquet") for root in (tmp_path, whole))
        pd.testing.assert_frame_equal(ours, theirs)


@pytest.mark.thorough
def test_a_study_can_be_run_in_portions(tmp_path, finished, capsys):
    whole, _ = finished
    stub = Stub(tmp_path / "asked.txt")
    part = run_with(task(tmp_path, first=2), stub)
    assert (part["n_cases"], part["n_drawn"]) == (2, 6)
    assert "2 of 6 data sets, the first in the study's random order" in " ".join(capsys.readouterr().out.split())
    assert len(json.loads((tmp_path / "blind" / "truth.json").read_text())) == 6
    rest = run_with(task(tmp_path), stub)
    assert (rest["n_cases"], rest["n_drawn"]) == (6, 6)
    assert len(stub.log.read_text().splitlines()) == 6
    ours, theirs = (pd.read_parquet(root / "blind" / "cases.parquet") for root in (tmp_path, whole))
    pd.testing.assert_frame_equal(ours, theirs)


@pytest.mark.slow
def test_a_data_set_that_discovery_stumbles_over_is_counted(tmp_path):
    def discover(data, study, oracle=None):
        raise ValueError("too few drivers")

    summary = run_with(task(tmp_path, sets="named"), discover)
    assert summary["n_failed"] == summary["n_cases"] == 2
    cases = pd.read_parquet(tmp_path / "blind" / "cases.parquet")
    assert set(cases["message"]) == {"ValueError: too few drivers"}


def test_the_oracle_is_asked_after_the_verdict(tmp_path):
    config = task(tmp_path, sets="named", oracle=True)
    stub = Stub(tmp_path / "asked.txt")

    def discover(data, study, oracle=None):
        if oracle is not None:
            assert (tmp_path / "blind" / "verdicts" / f"{data.name}.json").is_file()
        return stub(data, study, oracle)

    summary = run_with(config, discover)
    asked = sorted(line.split()[1] for line in stub.log.read_text().splitlines())
    assert asked == ["None", "None", "grade", "reaction_delay"]
    assert summary["n_oracles"] == 2
    assert summary["oracle_share"] == pytest.approx((9 - 4) / (9 - 1))


def test_sets_are_as_large_as_the_study_needs():
    cases = list_cases(BlindConfig(size=StudySize.full), 1)
    by_set = pd.Series([case.group for case in cases]).value_counts()
    assert by_set["control"] >= 100
    singles = {case.variant for case in cases if case.group in ("named", "artefact")}
    assert len(singles) >= 20
    repeats = pd.Series([case.variant for case in cases if case.group in ("named", "artefact")]).value_counts()
    assert repeats.min() >= 10
    assert len({case.variant for case in cases if case.group == "two"}) >= 10
    others = ["half", "half_four_times", "quarter", "double", "unlisted", "confusable", "cancelling", "sumo"]
    assert by_set[others].min() >= 10
    assert len({case.name for case in cases}) == len(cases) == len({case.seed for case in cases})
    assert [case.name for case in cases] != sorted(case.name for case in cases)


def test_drivers_choose_their_lane_where_that_is_asked():
    cases = list_cases(BlindConfig(size=StudySize.full, sets="lane_choice*"), 1)
    controls = [case for case in cases if case.group == "lane_choice_control"]
    hidden = pd.Series([case.variant for case in cases if case.group == "lane_choice"]).value_counts()
    assert len(controls) == 10
    assert all(case.planted == () for case in controls)
    assert dict(hidden) == dict.fromkeys(LANE_CHOICE, 3)
    assert all(case.scenario.free_changes for case in cases)
    others = [case for case in list_cases(BlindConfig(size=StudySize.full), 1) if case.group not in LANE_SETS]
    assert not any(case.scenario.free_changes for case in others)


@pytest.mark.parametrize("size", [StudySize.medium, StudySize.full])
def test_the_help_says_how_many_data_sets_there_are(size):
    (about,) = [item.metadata["help"] for item in fields(BlindConfig) if item.name == "size"]
    assert f"{size.name}: {len(list_cases(BlindConfig(size=size), 1))}" in about


def test_another_master_seed_is_another_study_in_another_order():
    one, same, other = (list_cases(BlindConfig(), seed) for seed in (1, 1, 2))
    assert one == same
    assert not {case.name for case in one} & {case.name for case in other}


def test_every_data_set_of_the_full_study_can_be_asked_for():
    for case in list_cases(BlindConfig(size=StudySize.full), 3):
        assert case.scenario.seed == case.seed
    with refused("out-of-range", key="blind.sets", value="no such set"):
        list_cases(BlindConfig(sets="no such set"), 1)


@pytest.mark.parametrize(
    "keys", [{"seed": -1}, {"sets": ""}, {"n_sets": 0}, {"width": 5.0}, {"followers": 3}, {"duration": 5.0}]
)
def test_wrong_keys_are_refused(keys):
    with refused("out-of-range", key=next(iter(keys))):
        BlindConfig(**keys).check()


def test_discovery_gets_a_folder_and_nothing_else(tmp_path, monkeypatch):
    asked = []

    def carry_out(record, *, show):
        assert not show
        asked.append(record)
        return {"verdict": "nothing"}

    monkeypatch.setattr(module, "DiscoverTask", SimpleNamespace)
    monkeypatch.setattr(module.discovery, "run", carry_out)
    config = task(tmp_path)
    monkeypatch.setattr(module, "replace", lambda record, **changes: changes)
    discover = module.discovery_of(config)
    assert discover(tmp_path / "data", "blind/runs/x") == {"verdict": "nothing"}
    assert discover(tmp_path / "data", "blind/oracles/x", "grade") == {"verdict": "nothing"}
    first, second = asked
    assert (first.study, first.data.format.name, first.data.root) == ("blind/runs/x", "table", str(tmp_path / "data"))
    assert first.discover == {"oracle": None}
    assert second.discover == {"oracle": "grade"}
    assert vars(first).keys() == {"study", "results", "data", "discover"}
