"""Version, hash and commit of this code: results are reused only for equal code. Standard library only."""

import hashlib
import subprocess
from functools import cache
from pathlib import Path

__version__ = "0.1.0"

PACKAGE = Path(__file__).resolve().parent


@cache
def code_hash(parts: tuple[str, ...] = (".",)) -> str:
    """First sixteen hexadecimal digits of the hash of the sources of some parts of this package, by default of all.

    Args:
        parts: Folders, as seen from the package.
    """
    digest = hashlib.sha256()
    for part in parts:
        for file in sorted((PACKAGE / part).rglob("*.py")):
            digest.update(file.relative_to(PACKAGE).as_posix().encode() + file.read_bytes())
    return digest.hexdigest()[:16]


@cache
def git_sha() -> str | None:
    """The commit of the checkout this package runs from, `-modified` if files differ; None if installed."""
    checkout = PACKAGE.parent
    if not (checkout / ".git").exists():
        return None
    try:
        commit = _git(checkout, "rev-parse", "HEAD")
        return f"{commit}-modified" if _git(checkout, "status", "--porcelain") else commit
    except (OSError, subprocess.CalledProcessError):  # no git here, or no commit yet
        return None


def _git(checkout: Path, *arguments: str) -> str:
    command = ["git", "-C", str(checkout), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
