"""The site as it is built: strictly, complete, and without anything from elsewhere."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

import rearl_jax
from rearl_jax import tasks
from rearl_jax.config._schema import keys_of
from tests.docs.blocks import DOCS, ROOT
from tests.test_architecture import LOOSE_ENDS

LOADED = {
    "script": "src",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "video": "src",
    "audio": "src",
    "object": "data",
}
"""Attributes of elements that a browser loads without being asked."""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Folder of the built site."""
    folder = tmp_path_factory.mktemp("site")
    program = Path(sys.executable).with_name("mkdocs")
    done = subprocess.run(
        [program, "build", "--strict", "--quiet", "--site-dir", folder],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return folder


class Loads(HTMLParser):
    """Addresses that a page loads."""

    def __init__(self):
        super().__init__()
        self.found, self.classes = [], set()

    def handle_starttag(self, tag, attrs):
        attributes = {name: value or "" for name, value in attrs}
        self.classes |= set(attributes.get("class", "").split())
        if tag in LOADED and LOADED[tag] in attributes:
            self.found.append(attributes[LOADED[tag]])
        # A canonical address or the page before is named, not loaded.
        if tag == "link" and attributes.get("rel") not in ("canonical", "prev", "next"):
            self.found.append(attributes["href"])
        self.found += re.findall(r"url\(([^)]+)\)", attributes.get("style", ""))


def loads_of(page):
    parser = Loads()
    parser.feed(page.read_text(encoding="utf-8"))
    return parser


@pytest.mark.thorough  # the site is built first
def test_pages_load_nothing_from_elsewhere(site):
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 25
    for page in pages:
        parser = loads_of(page)
        assert len(parser.found) > 3
        for address in parser.found:
            assert not re.match(r"\s*(https?:)?//", address), f"{page} loads {address}"
            if page.name != "404.html":  # its addresses are those of a server's root
                assert (page.parent / address.partition("?")[0]).is_file(), (
                    f"{page} loads {address}, which is not there"
                )
        # What the theme would load a program for from elsewhere.
        assert "mermaid" not in parser.classes


@pytest.mark.thorough  # the site is built first
def test_styles_load_nothing_from_elsewhere(site):
    styles = sorted(site.rglob("*.css"))
    assert styles
    for style in styles:
        text = style.read_text(encoding="utf-8")
        assert not re.search(r"@import|url\(\s*['\"]?\s*(https?:)?//", text), style


def test_the_parser_sees_what_is_loaded():
    parser = Loads()
    parser.feed('<link rel=stylesheet href="//a/b.css"><script src=http://c></script><p style="background:url(d)">')
    assert parser.found == ["//a/b.css", "http://c", "d"]


def shown(site, name):
    return (site / name).read_text(encoding="utf-8")


@pytest.mark.thorough  # the site is built first
def test_every_key_of_every_task_is_shown(site):
    pages = shown(site, "reference/keys.html") + shown(site, "reference/tasks.html")
    names = {(key.name, key.default) for task in tasks.TASKS for key in keys_of(task.defaults()).values()}
    assert len(names) > 200
    for name, default in names:
        written = f"{name}={default}".replace("'", "&#39;").replace("<", "&lt;")
        assert f"<code>{written}</code>" in pages or f"<code>{name}={default}</code>" in pages, name
    for task in tasks.TASKS:
        assert f">rearl {task.words}<" in pages


@pytest.mark.thorough  # the site is built first
def test_every_effect_metric_and_column_is_shown(site):
    from rearl_jax.core.effects import EFFECTS
    from rearl_jax.data.schema import COLUMNS
    from rearl_jax.metrics import METRICS

    library = shown(site, "discovery/library.html")
    for name, effect in EFFECTS.items():
        assert f"<code>{name}</code>" in library
        for parameter in effect.parameters:
            assert f"<code>{parameter.name}</code>" in library
    assert "tanh(max(0, u) / scale)" in library
    metrics = shown(site, "method/metrics.html")
    assert all(f"<code>{name}</code>" in metrics for name in METRICS)
    columns = shown(site, "reference/recordings.html")
    assert all(f"<code>{column.name}</code>" in columns for column in COLUMNS)


@pytest.mark.thorough  # the site is built first
def test_every_public_name_is_shown(site):
    page = shown(site, "reference/python.html")
    for name, home in rearl_jax._HOMES.items():
        assert f'id="{home}.{name}"' in page, name


@pytest.mark.thorough  # the site is built first
def test_what_is_generated_is_there(site):
    for page in site.rglob("*.html"):
        assert "<!-- generated:" not in page.read_text(encoding="utf-8"), page
    assert "candidate_z_score" in shown(site, "discovery/index.html")
    measured = shown(site, "measured.html")
    assert "closed-loop gap error" in measured
    assert "controls with an effect named" in measured
    assert "<code>rearl_jax.core</code>" in shown(site, "reference/packages.html")
    assert shown(site, "discovery/index.html").count('<svg role="img"') >= 5


@pytest.mark.parametrize("kind", LOOSE_ENDS)
def test_no_loose_ends(kind):
    files = [ROOT / "mkdocs.yml", *(file for file in DOCS.rglob("*") if file.suffix in (".md", ".py", ".css"))]
    assert len(files) > 30
    for file in files:
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
            assert not LOOSE_ENDS[kind].search(line), f"{file}:{number} holds {kind}: {line.strip()}"
