"""Studies judged again from their tables: one that was just run, and those whose results are kept."""

import json
import re
import shutil
from collections import Counter
from pathlib import Path

import pandas as pd
import pytest

from rearl_jax.blind.again import judge_again, main, read_study
from rearl_jax.blind.judging import names_of
from rearl_jax.blind.sealing import open_truth, stored_protocol
from rearl_jax.results import PROVENANCE, read_metadata
from tests.refusal import refused

ROOT = Path(__file__).resolve().parents[2]
KEPT = [path.parent for path in sorted((ROOT / "results" / "kept").glob("*/protocol.json"))]
WRITTEN = ("scores", "sets", "confusion", "strengths")


@pytest.fixture
def before(finished):
    """Folder of the study."""
    return finished[0] / "blind"


@pytest.fixture
def folder(before, tmp_path):
    """A copy that may be changed."""
    shutil.copytree(before, tmp_path / "copy")
    return tmp_path / "copy"


@pytest.mark.slow
def test_a_study_judged_again_is_the_same(finished, before, folder, capsys):
    summary = finished[1]
    shutil.rmtree(folder / "verdicts")
    for name in WRITTEN[1:]:
        (folder / f"{name}.parquet").unlink()
    again = judge_again(folder)
    assert summary["n_false"] > 0
    assert {key: again[key] for key in summary} == summary
    for name in WRITTEN:
        ours, theirs = (pd.read_parquet(path / f"{name}.parquet") for path in (folder, before))
        pd.testing.assert_frame_equal(ours, theirs)
        about = read_metadata(folder / f"{name}.parquet")
        assert about.pop("judged_again") == "true"
        assert about == read_metadata(before / f"{name}.parquet")
    ours, theirs = (json.loads((path / "summary.json").read_text()) for path in (folder, before))
    assert ours.pop("judged_again") is True
    assert ours == theirs
    assert (folder / "cases.parquet").read_bytes() == (before / "cases.parquet").read_bytes()
    page = (folder / "page.html").read_text()
    assert f"code {theirs['git_sha'] or theirs['code_version']}" in page
    shown = " ".join(capsys.readouterr().out.split())
    assert "Outcomes by set" in shown
    assert "as cases.parquet has no ends of intervals" not in shown


def test_what_the_table_does_not_hold_stays_as_it_was(before, folder):
    cases = pd.read_parquet(folder / "cases.parquet")
    cases.drop(columns=[name for name in cases if name.endswith(("_low", "_high"))]).to_parquet(
        folder / "cases.parquet"
    )
    scores = pd.read_parquet(folder / "scores.parquet")
    is_rose = scores["name"] == "error_rose"
    scores.loc[is_rose | (scores["name"] == "wrong_name"), "n_hits"] = 77
    scores.to_parquet(folder / "scores.parquet")
    _, results = read_study(folder)
    hits = {score.name: score.n_hits for score in results.scores}
    assert hits["error_rose"] == 77
    assert hits["wrong_name"] == pd.read_parquet(before / "scores.parquet").set_index("name").n_hits["wrong_name"]
    (folder / "confusion.png").write_bytes(b"of the first judgement")
    (folder / "strengths.png").unlink()
    judge_again(folder)
    assert (folder / "confusion.png").read_bytes().startswith(b"\x89PNG")
    assert not (folder / "strengths.png").exists()
    page = (folder / "page.html").read_text()
    assert "as cases.parquet has no ends of intervals: " in page
    assert "repaired models: significantly higher error" in page


def test_a_truth_that_was_changed_is_refused(folder):
    truth = (folder / "truth.json").read_bytes()
    (folder / "truth.json").write_bytes(truth.replace(b"grade", b"weather"))
    with refused("truth-changed"):
        judge_again(folder)
    (folder / "protocol.json").unlink()
    with refused("no-protocol"):
        read_study(folder)


@pytest.mark.parametrize(
    ("words", "said"),
    [([], "python -m rearl_jax.blind.again FOLDER"), (["no such folder"], "no such folder")],
)
def test_what_cannot_be_judged_is_said(words, said):
    with pytest.raises(SystemExit) as stopped:
        main(words)
    assert said in str(stopped.value)


def test_a_study_is_kept():
    assert KEPT


@pytest.mark.parametrize("folder", KEPT, ids=lambda folder: folder.name)
def test_what_is_kept_follows_from_its_table_of_data_sets(folder):
    protocol, results = read_study(folder)
    for name, table in results.tables().items():
        kept = pd.read_parquet(folder / f"{name}.parquet")
        # Titles are words of the code, which may be worded otherwise than those stored.
        ours, theirs = (frame.drop(columns="title", errors="ignore") for frame in (table, kept))
        pd.testing.assert_frame_equal(theirs, ours, check_dtype=False, rtol=1e-9)
    stored = json.loads((folder / "summary.json").read_text())
    summary = results.summary()
    assert stored.keys() == {*PROVENANCE, "judged_again", "master_seed", "truth_sha256", *summary}
    assert stored["truth_sha256"] == protocol.truth_sha256
    for name, value in summary.items():
        # Sums of floats may end otherwise on another machine.
        assert stored[name] == (value if isinstance(value, list) else pytest.approx(value, rel=1e-9)), name
    page = (folder / "page.html").read_text()
    for score in results.scores:
        assert re.search(rf"<td[^>]*>{score.n_hits}</td><td[^>]*>{score.n_cases}</td>", page)


@pytest.mark.parametrize("folder", KEPT, ids=lambda folder: folder.name)
def test_names_that_are_not_there_are_none_of_the_sealed_ones(folder):
    """Counted once more from the names themselves, without what the study has judged."""
    protocol = stored_protocol(folder)
    assert protocol is not None
    truths = open_truth(folder, protocol)
    cases = pd.read_parquet(folder / "cases.parquet")
    assert sorted(cases["case"]) == sorted(truths)
    for case in cases.to_dict("records"):
        truth = truths[case["case"]]
        assert (case["set"], case["variant"], case["n_hidden"]) == (
            truth["group"], truth["variant"], len(truth["planted"]),
        )  # fmt: skip
        if any(item["variables"] for item in truth["planted"]):
            continue  # a curve is right by its variable, which the table does not hold
        right = set().union(*map(names_of, truth["planted"]))
        said = Counter(case["named"].split("+")) if case["named"] else Counter()
        false = Counter(case["false"].split("+")) if case["false"] else Counter()
        assert false == Counter({name: n for name, n in said.items() if name not in right})
