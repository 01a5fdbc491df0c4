"""Names of recordings and studies that hold HTML: every page shows them and carries out none of it."""

import ast
import json
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

import rearl_jax

HOSTILE = "<img src=x onerror=alert(1)>\"'&</script><script>alert(2)</script>"

STUDIES = """
import sys
from pathlib import Path
from dataclasses import replace
from rearl_jax import runtime
from rearl_jax.config import DataConfig, EvaluateTask, ReportTask, ResultsConfig
from rearl_jax.config.data import DataFormat
from rearl_jax.config.evaluation import EvaluationConfig
from rearl_jax.config.report import ReportConfig
from rearl_jax.config.results import FolderConfig
from rearl_jax.data.tables.canonical import write_recording
from rearl_jax.data.recordings import iterate_recordings

root, hostile = Path(sys.argv[1]), sys.argv[2]
runtime.start()
first = next(iterate_recordings(DataConfig(recordings="us101_0750")))
named = {name: f"{name} {hostile}" for name in ("id", "source", "licence", "attribution")}
info, table = replace(first.info, **named, notes=(hostile,)), first.table.assign(recording=named["id"])
write_recording(replace(first, info=info, table=table), root / "data" / "a.parquet")

from rearl_jax.evaluation import task as evaluation
from rearl_jax.report import task as report

study = hostile.replace("/", "")
config = EvaluateTask(
    study=study,
    results=ResultsConfig(str(root)),
    data=DataConfig(DataFormat.table, str(root / "data")),
    eval=EvaluationConfig(n_runs=1, resamples=100),
)
evaluation.run(config)
page = str(root / study / "report.html")
report.run(ReportTask(study=study, results=FolderConfig(str(root)), report=ReportConfig(path=page)))
"""


class Elements(HTMLParser):
    """Elements of a page with their attributes, and its text."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(page)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text += data


def test_the_parser_sees_what_a_browser_would_run():
    found = Elements(f"<p>{HOSTILE}</p>").found
    assert ("img", {"src": "x", "onerror": "alert(1)"}) in found
    assert any(tag == "script" for tag, _ in found)


@pytest.mark.slow
def test_pages_show_hostile_names_as_text(tmp_path):
    subprocess.run([sys.executable, "-c", STUDIES, str(tmp_path), HOSTILE], check=True, capture_output=True)
    (folder,) = (path for path in tmp_path.iterdir() if path.is_dir() and path.name != "data")
    assert json.loads((folder / "config.json").read_text())["study"].startswith("<img")
    for name in ("page.html", "report.html"):
        page = Elements((folder / name).read_text(encoding="utf-8"))
        assert HOSTILE in page.text, name
        assert sum(tag == "script" for tag, _ in page.found) == 2, name  # the player and its scenes
        for tag, attributes in page.found:
            assert not any(key.startswith("on") for key in attributes), (name, tag, attributes)
            assert (attributes.get("src") or "data:").startswith("data:"), (name, tag, attributes)


def test_only_vetted_texts_go_unescaped_into_a_page():
    root = Path(rearl_jax.__file__).parent
    templates = sorted(root.rglob("*.html.j2"))
    assert len(templates) >= 2
    unescaped = {
        (template.relative_to(root).as_posix(), expression.split("|")[0].strip())
        for template in templates
        for expression in template.read_text(encoding="utf-8").split("{{")[1:]
        if "safe" in expression.split("}}")[0]
    }
    # JSON in which < > & are written as escapes.
    assert unescaped == {("replay/player.html.j2", "data")}
    for file in sorted(root.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        assert "Markup(" not in text, file
        assert "autoescape=False" not in text, file


def test_nothing_that_is_read_can_bring_code():
    """No pickle, and YAML only through the safe loader."""
    seen = 0
    for file in sorted(Path(rearl_jax.__file__).parent.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [alias.name for alias in getattr(node, "names", [])] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not {name.split(".")[0] for name in names} & {"pickle", "shelve", "dill", "cloudpickle", "joblib"}, (
                file
            )
            if not isinstance(node, ast.Call):
                continue
            called = ast.unparse(node.func)
            assert called not in ("eval", "exec", "yaml.load", "yaml.unsafe_load", "yaml.full_load"), (file, called)
            if called in ("np.load", "numpy.load"):
                seen += 1
                words = {word.arg: ast.unparse(word.value) for word in node.keywords}
                assert words.get("allow_pickle", "False") == "False", (file, node.lineno)
    assert seen >= 3
