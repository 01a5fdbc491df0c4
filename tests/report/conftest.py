"""One real evaluation of the shipped recordings with its report, and folders of studies that would take minutes."""

import contextlib
import io
import json
import re
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from tests.discovery.made_verdict import VERDICT as MADE
from tests.evaluation.conftest import drift

HOSTILE = "</script><script>alert(1)</script><!--"


@dataclass(frozen=True)
class Reported:
    """Runs of `rearl evaluate` and `rearl report`; `before` is the page of the first."""

    config: object
    root: Path
    folder: Path
    before: str
    found: dict
    printed: str

    @property
    def page(self):
        return (self.folder / "page.html").read_text(encoding="utf-8")

    @property
    def replay(self):
        return replay_of(self.page)


def replay_of(page):
    """The data of the player in a page."""
    return json.loads(re.search(r'id="replay-data">(.*?)</script>', page, re.DOTALL)[1])


@contextlib.contextmanager
def drifting():
    """The method base replaced by vehicles that drift."""
    from rearl_jax.evaluation import simulators

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulators, "simulate_base", drift)
        simulators.program.cache_clear()
        yield
        simulators.program.cache_clear()


@pytest.fixture(scope="module", autouse=True)
def only_drifting():
    """Traffic that is simulated anew drifts, in these tests only: later ones in this process need real traffic."""
    with drifting():
        yield


@pytest.fixture(scope="session")
def reported(tmp_path_factory):
    """`rearl evaluate` of drifting vehicles, one run, few resamples, and `rearl report` on it."""
    from rearl_jax.config import EvaluateTask, ResultsConfig
    from rearl_jax.config.evaluation import EvaluationConfig
    from rearl_jax.evaluation import task

    root = tmp_path_factory.mktemp("results")
    config = EvaluateTask(
        study="quick",
        results=ResultsConfig(root=str(root)),
        eval=EvaluationConfig(n_runs=1, resamples=50, noise_draws=10),
    )
    with drifting():
        with contextlib.redirect_stdout(io.StringIO()):
            task.run(config)
        before = (root / "quick" / "page.html").read_text(encoding="utf-8")
        found, printed = report(root, "quick")
    return Reported(config, root, root / "quick", before, found, printed)


def report(root, study, **options):
    """Return value and printed text of the task."""
    from rearl_jax.config import ReportTask
    from rearl_jax.config.report import ReportConfig
    from rearl_jax.config.results import FolderConfig
    from rearl_jax.report.task import run

    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        found = run(ReportTask(study, FolderConfig(str(root)), ReportConfig(**options)))
    return found, printed.getvalue()


@pytest.fixture
def copied(reported, tmp_path):
    """A copy of the evaluation that a test may spoil: its root."""
    shutil.copytree(reported.folder, tmp_path / "quick")
    return tmp_path


@pytest.fixture
def make_report():
    return report


@pytest.fixture
def read_replay():
    return replay_of


DELAY, RIVAL = MADE["candidates"]
VERDICT = MADE | {
    "candidates": [DELAY, RIVAL | {"told_apart_by": f"faster changes {HOSTILE}"}],
    "adequacy": None,
    "data": MADE["data"] | {"findings": [f"the {HOSTILE} column is late"]},
}


@pytest.fixture
def make_study(tmp_path):
    """Makes the folder of a finished study: its task, configuration, summary, tables and other files."""
    from rearl_jax.results import Study

    def make(name, task, config, summary, tables=None, **texts):
        study = Study(tmp_path, name, replace(config, study=name), task, None, generated=True)
        study.write_config()
        for table, frame in (tables or {}).items():
            study.write_table(table, frame)
        for file, content in texts.items():
            study.write_text(f"{file}.json", json.dumps(content))
        study.write_summary(summary)
        return tmp_path

    return make


@pytest.fixture
def discovery(make_study):
    """The folder of a discovery in which everything that is a text is hostile; its root."""
    from rearl_jax.config import DiscoverTask
    from rearl_jax.config.data import DataConfig, DataFormat

    config = DiscoverTask(data=DataConfig(format=DataFormat.table, root=f"nowhere{HOSTILE}"))
    root = make_study("found", "discover", config, {"verdict": "named"}, verdict=VERDICT)
    dot = bytes.fromhex("89504e470d0a1a0a")
    for name in ("planes", "maps", "another"):
        (root / "found" / f"{name}.png").write_bytes(dot)
    return root
