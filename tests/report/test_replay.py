"""A replay changes nothing of the study that it shows."""

import pandas as pd
import pytest

from rearl_jax.clustering.search import TRACE
from rearl_jax.config import EvaluateTask
from rearl_jax.config.report import ReportConfig
from rearl_jax.progress import silent
from rearl_jax.report import replay
from rearl_jax.report.finished import FinishedStudy
from rearl_jax.report.replay import NoReplayError, simulate_again
from rearl_jax.results import Study
from rearl_jax.tasks import TASKS


def content(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_search_that_is_continued_is_a_copy(tmp_path, monkeypatch):
    config = EvaluateTask()
    study = Study(tmp_path, "evaluate", config, "evaluate")
    study.write_table(TRACE, pd.DataFrame({"k": [3]}))
    (task,) = [task for task in TASKS if task.words == "evaluate"]
    finished = FinishedStudy(study.path, task, config, {"generated": False}, ())
    before, found = content(study.path), []

    def read_inputs(config, search, bar, *, with_references):
        found.append(pd.read_parquet(search.path / f"{TRACE}.parquet"))
        search.write_table(TRACE, pd.DataFrame({"k": [3, 4]}))
        raise NoReplayError("stop")

    monkeypatch.setattr(replay, "_require_same_data", lambda study: None)
    monkeypatch.setattr(replay, "read_inputs", read_inputs)
    with silent() as bar, pytest.raises(NoReplayError, match="stop"):
        simulate_again(finished, ReportConfig(), bar)
    assert found[0]["k"].tolist() == [3]
    assert content(study.path) == before
