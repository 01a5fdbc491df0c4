"""The fenced blocks of README and documentation, and the commands in them."""

import re
import shlex
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby, takewhile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]

_BLOCK = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_FILE = re.compile(r"((?:[\w.-]+/)+[\w.-]+\.\w+)(?:, in (\w+))?")
"""A title that is a path in a checkout, or names a table in that file."""

_SPAN = re.compile(r"(?<!`)`(rearl [^`\n]+)`(?!`)")
_UNFINISHED = re.compile(r"\.\.\.|\b(TASK|STUDY|NAME|FILE)\b")
"""Placeholders in running text."""


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Attributes:
        page: Its file.
        line: Number of its first line.
        language: As after the fence.
        title: What readers see above it: the file that it is; else what it needs that is not here, or how long it
            takes; empty where it can be followed anywhere.
        text: Its lines.
    """

    page: Path
    line: int
    language: str
    title: str
    text: str

    @property
    def where(self) -> str:
        """For messages."""
        return f"{self.page.relative_to(ROOT)}:{self.line}"

    @property
    def file(self) -> str:
        """Path in a checkout of the file that it is, or is a part of; empty where it is none."""
        found = _FILE.fullmatch(self.title)
        return found[1] if found else ""

    @property
    def table(self) -> str:
        """Name of the table of that file whose first entries it is; empty where it is a whole file."""
        found = _FILE.fullmatch(self.title)
        return found[2] or "" if found else ""

    def write(self, folder: Path) -> None:
        """Puts the file, or its part, into a copy of the checkout."""
        file = folder / self.file
        if not self.table:
            assert not file.exists(), f"{self.where}: {self.file} is there already"
            file.write_text(self.text, encoding="utf-8")
            return
        opening, before = f"{self.table} = {{\n", file.read_text(encoding="utf-8")
        assert before.count(opening) == 1, f"{self.where}: {self.file} has no table {self.table}"
        file.write_text(before.replace(opening, opening + self.text), encoding="utf-8")


def blocks(page: Path) -> list[Block]:
    """All blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    found = []
    for match in _BLOCK.finditer(text):
        title = re.fullmatch(r'(?: title="([^"]+)")?', match[2])
        assert title, f"{page}: a block begins with ```{match[1]}{match[2]}"
        line = text.count("\n", 0, match.start()) + 1
        found.append(Block(page, line, match[1], title[1] or "", match[3]))
    return found


def steps(page: Path, *, titled: bool = False) -> Iterator[tuple[str, list[str]]]:
    """Steps of a page and their places: each shell block, and each run of consecutive Python blocks as one.

    Args:
        page: The page.
        titled: Whether blocks that need something are among them; files never are.
    """
    found = [block for block in blocks(page) if block.language in ("sh", "python") and not block.file]
    for language, group in groupby((block for block in found if titled or not block.title), lambda one: one.language):
        some = list(group)
        if language == "python":
            yield some[0].where, [sys.executable, "-c", "\n".join(block.text for block in some)]
        else:
            for block in some:
                yield block.where, ["bash", "-euo", "pipefail", "-c", block.text]


def commands(text: str) -> list[list[str]]:
    """The words of every command of a shell script as simple as those of the pages."""
    found = []
    for line in text.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        for joined, some in groupby(words, key=lambda word: word in ("&&", "|", ";")):
            if not joined:
                found.append(list(takewhile(lambda word: word != ">", some)))
    return found


def spans(page: Path) -> list[list[str]]:
    """Commands in running text."""
    return [
        shlex.split(text) for text in _SPAN.findall(page.read_text(encoding="utf-8")) if not _UNFINISHED.search(text)
    ]


EXTENDING = [page for page in PAGES if any(block.file for block in blocks(page))]
"""Pages that add files to the package; what they show works in a checkout that has these files."""
