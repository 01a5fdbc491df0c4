"""`python -m tests.fuzz.guided reply -runs=100000`: texts grown towards new branches by atheris (pip install atheris).

Stops at the first fault and writes the text that shows it. Options are those of libFuzzer, e.g. -max_total_time=600.
"""

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["rearl_jax.llm", "rearl_jax.baselines.critical", "rearl_jax.models.file"]):
    from rearl_jax.baselines.critical.answers import BadAnswerError, read_mixture
    from rearl_jax.llm.parsing import understand
    from rearl_jax.llm.profiles import read_completion, read_error
    from rearl_jax.llm.records import NO_DECISION, Cause
    from rearl_jax.models.file import BadModelError, read_model

_PATH = Path(tempfile.mkdtemp()) / "model.yaml"


def _text(data: bytes) -> str:
    return data.decode("utf-8", "surrogateescape")


def reply(data: bytes) -> None:
    """A reply about the action of a vehicle."""
    choices = tuple(action for action in range(5) if data[:1] and data[0] >> action & 1)
    action, cause = understand(_text(data[1:]), choices)
    assert (cause is Cause.answered) == (action in choices)
    assert cause is Cause.answered or action == NO_DECISION


def mixture(data: bytes) -> None:
    """A reply about the shares of driver classes."""
    try:
        shares = read_mixture(_text(data))
    except BadAnswerError:
        return
    assert all(0 <= share <= 1 for share in shares)


def completion(data: bytes) -> None:
    """A response of a language-model server."""
    read_error(data).encode()
    try:
        found = read_completion(data)
    except ValueError:
        return
    found.text.encode()


def model(data: bytes) -> None:
    """A file of a repaired traffic model."""
    _PATH.write_bytes(data)
    try:
        read_model(_PATH)
    except BadModelError:
        return


TARGETS: dict[str, Callable[[bytes], None]] = {
    "reply": reply,
    "mixture": mixture,
    "completion": completion,
    "model": model,
}

if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] not in TARGETS:
        sys.exit(f"name a target: {', '.join(TARGETS)}")
    atheris.Setup([sys.argv[0], *sys.argv[2:]], TARGETS[sys.argv[1]])
    atheris.Fuzz()
