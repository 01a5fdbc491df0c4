"""Pages that extend the package: their files, at most two, work in a copy of the package."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.blocks import EXTENDING, ROOT, blocks, steps

MOST_FILES = 2
"""Files that an extension may add or change, its registration among them."""

PROMISED = {
    "add-car-following-model": (
        r"driver\.speed_gain=2\.0 +\(float\)\n +acceleration per speed deficit, on a free road \[1/s\]; above 2 / T",
        r"^newell: \d+\.\d+ m/s, idm: \d+\.\d+ m/s$",
    ),
    "add-effect": (r"at 1000 m: \d+\.\d m/s without, \d+\.\d m/s with it", r"EffectValues\(name='rubbernecking'"),
    "add-recording-format": (r"^morning \d+ rows$", r"recordings +│ +1\b"),
    "add-metric": (r"^short time gaps: share 0\.5 of 6 pairs$",),
}
"""Patterns of the output of a page's blocks without a title."""

LATER = {
    "add-car-following-model": (r"newell",),
    "add-effect": (r"[1-9]\d* passed", r"effects: rubbernecking"),
    "add-recording-format": (),
    "add-metric": (r"[1-9]\d* passed",),
}
"""Further patterns of the output of the blocks with a title, which take longer."""


def content(folder):
    """Every file in a folder by its path."""
    return {file.relative_to(folder).as_posix(): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.fixture
def extended(tmp_path):
    """Makes a copy of the checkout with the files of a page; gives the copy and the paths that are new or changed."""

    def make(page):
        copy = tmp_path / "checkout"
        for name in ("rearl_jax", "conf", "sweeps", "tests/core", "tests/metrics"):
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
        for name in ("pyproject.toml", "tests/conftest.py"):
            shutil.copy(ROOT / name, copy / name)
        before = content(copy)
        for block in blocks(page):
            if block.file:
                block.write(copy)
        after = content(copy)
        return copy, sorted(path for path in after if after[path] != before.get(path))

    return make


def followed(page, copy, place, *, titled=False):
    """Output of the steps of a page, run in a folder with the copy of the package."""
    place.mkdir()
    programs = Path(sys.executable).parent
    environment = os.environ | {
        "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(copy),
        "PYTHONDONTWRITEBYTECODE": "1",
        "JAX_PLATFORMS": "cpu",
    }
    printed = []
    for where, command in steps(page, titled=titled):
        folder = copy if "pytest" in command[-1] else place
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{where}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"
        printed.append(done.stdout)
    return "\n".join(printed)


def check_printed(printed, patterns):
    for pattern in patterns:
        assert re.search(pattern, printed, re.MULTILINE), f"{pattern} is not in\n{printed}"


@pytest.mark.parametrize("page", EXTENDING, ids=lambda page: page.stem)
def test_two_files_are_enough(page, extended):
    copy, touched = extended(page)
    assert 1 <= len(touched) <= MOST_FILES, f"{page.stem} touches {len(touched)} files: {', '.join(touched)}"
    tidy = [path for path in touched if path.endswith(".py")]
    for words in (["check"], ["format", "--check"]):
        ruff = subprocess.run(
            [Path(sys.executable).with_name("ruff"), *words, *tidy],
            cwd=copy,
            capture_output=True,
            text=True,
            check=False,
        )
        assert ruff.returncode == 0, ruff.stdout + ruff.stderr


@pytest.mark.slow
@pytest.mark.parametrize("page", EXTENDING, ids=lambda page: page.stem)
def test_pages_can_be_followed(page, extended, tmp_path):
    copy, _ = extended(page)
    check_printed(followed(page, copy, tmp_path / "reader", titled=True), PROMISED[page.stem] + LATER[page.stem])


def test_pages_that_extend_the_package_are_known():
    assert {page.stem for page in EXTENDING} == set(PROMISED) == set(LATER)
