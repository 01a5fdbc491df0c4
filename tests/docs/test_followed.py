"""Pages followed from top to bottom in an empty folder, as a reader would. Blocks with a title need what they say."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.blocks import DOCS, EXTENDING, PAGES, steps

pytestmark = pytest.mark.slow  # a page takes up to some minutes


FOLLOWED = [page for page in PAGES if DOCS in page.parents and page not in EXTENDING and any(steps(page))]


@pytest.mark.parametrize("page", FOLLOWED, ids=lambda page: str(page.relative_to(DOCS)))
def test_page_can_be_followed(page, tmp_path):
    programs = Path(sys.executable).parent
    environment = os.environ | {"PATH": f"{programs}{os.pathsep}{os.environ['PATH']}", "MPLBACKEND": "agg"}
    for where, command in steps(page):
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{where}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"
    check_columns(tmp_path / "results")


def documented_columns():
    """Columns of result files by task and file, as patterns: those that are always there, and all that may be.

    On the page of result files, those that may be missing stand behind a semicolon.
    """
    from rearl_jax.config.driver import MODELS
    from rearl_jax.metrics import METRICS

    parameters = {
        parameter.name + end for model in MODELS.values() for parameter in model.parameters for end in ("", "_log_sd")
    }
    found, task = {}, ""
    for line in (DOCS / "reference" / "results.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            task = line.removeprefix("## rearl ")
        elif row := re.fullmatch(r"\| `(\w+)\.parquet` \| .+? \| (.+) \|", line):
            always, every = (
                [
                    re.sub(r"[A-Z]+", r"\\d+", name)
                    for name in re.findall(r"`(\w+)`", part)
                    if name not in ("_n", "_log_sd")
                ]
                for part in (row[2].partition(";")[0], row[2])
            )
            metrics = [name + end for name in METRICS for end in ("", "_n")] if "metrics.md" in row[2] else []
            driver = parameters if "car-following.md" in row[2] else []
            found[task, row[1]] = [*always, *metrics], [*every, *metrics, *driver]
    assert len(found) > 15
    return found


def check_columns(results):
    """Every table that is documented has the columns that are documented, no more and no less; returns which."""
    import pyarrow.parquet as pq

    from rearl_jax import read_metadata

    documented, seen = documented_columns(), set()
    for file in results.rglob("*.parquet"):
        what = read_metadata(file).get("task"), file.stem
        if what in documented:
            seen.add(what)
            columns, (always, every) = pq.read_schema(file).names, documented[what]
            for name in columns:
                assert any(re.fullmatch(pattern, name) for pattern in every), f"{what}: {name} is not documented"
            for pattern in always:
                assert any(re.fullmatch(pattern, name) for name in columns), f"{what}: {pattern} is not there"
    return seen


def test_most_pages_can_be_followed():
    assert len(FOLLOWED) >= 12
