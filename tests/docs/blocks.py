"""The fenced blocks of README and documentation, and the commands in them."""

import re
import shlex
from dataclasses import dataclass
from itertools import groupby, takewhile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]

_BLOCK = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_SPAN = re.compile(r"(?<!`)`(rearl [^`\n]+)`(?!`)")
_UNFINISHED = re.compile(r"\.\.\.|\b(TASK|STUDY|NAME)\b")
"""What stands for something else in running text."""


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Attributes:
        page: Its file.
        line: Number of its first line.
        language: As after the fence.
        title: What it needs that is not here, as readers see it; empty where it can be followed anywhere.
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
