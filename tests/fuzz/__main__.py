"""`python -m tests.fuzz`: very many fuzzed inputs through every reader and parser; the counts as a table.

Every input follows from the target's name, the seed and its number, so that a line of the table can be repeated:
python -m tests.fuzz highd --first 1684 --inputs 1
"""

import argparse
import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from random import Random

from tests.fuzz.formats import FORMATS
from tests.fuzz.outcome import Outcome, Result, ended_in_time
from tests.fuzz.parsers import PARSERS
from tests.fuzz.readers import Reader
from tests.fuzz.surveys import survey

OTHERS = {"survey": survey, **PARSERS}
"""By name: a folder to write in -> a function that tries one input."""

TARGETS = (*FORMATS, *OTHERS)
"""Readers of recordings, then what else reads input."""

BAD = (Outcome.crashed, Outcome.silent)


def target(name: str, folder: Path) -> Callable[[Random], Result]:
    """A function that tries one input of the target.

    Args:
        name: One of TARGETS.
        folder: A folder of its own to write in.
    """
    return Reader(name, folder / "recording").try_one if name in FORMATS else OTHERS[name](folder)


def tried(name: str, inputs: range, seed: int) -> tuple[Counter[str], Counter[str], dict[str, tuple[int, str]], float]:
    """Outcomes, what went wrong, the first input of each of those, the longest time of an input [s]."""
    counts, wrong, first, longest = Counter[str](), Counter[str](), dict[str, tuple[int, str]](), 0.0
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        try_one = target(name, Path(folder))
        for number in inputs:
            start = time.perf_counter()
            with ended_in_time(f"{name}: input {number} of seed {seed}"):
                outcome, said = try_one(Random(f"{name} {seed} {number}"))
            longest = max(longest, time.perf_counter() - start)
            counts[outcome.value] += 1
            if outcome in BAD:
                # The place and the kind of an error, without what is different every time.
                key = f"{outcome.value}: {said.partition(': ')[0] if outcome is Outcome.crashed else said[:120]}"
                wrong[key] += 1
                first.setdefault(key, (number, said))
    return counts, wrong, first, longest


def main() -> int:
    """Exit code: 0 if nothing crashed and nothing passed in silence."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", default=list(TARGETS), help=f"of {', '.join(TARGETS)}; default all")
    parser.add_argument("--inputs", type=int, default=100_000, help="inputs per target, default %(default)s")
    parser.add_argument("--first", type=int, default=0, help="number of the first input, default %(default)s")
    parser.add_argument("--seed", type=int, default=0, help="default %(default)s")
    parser.add_argument("--json", action="store_true", help="one JSON object per target")
    options = parser.parse_args()
    unknown = sorted(set(options.targets) - set(TARGETS))
    if unknown:
        parser.error(f"there is no target {unknown[0]}: {', '.join(TARGETS)}")
    failed = 0
    for name in options.targets:
        inputs = range(options.first, options.first + options.inputs)
        counts, wrong, first, longest = tried(name, inputs, options.seed)
        shown = {outcome.value: counts[outcome.value] for outcome in Outcome}
        failed += sum(counts[outcome.value] for outcome in BAD)
        line = {"target": name, "first": options.first, "inputs": len(inputs), **shown, "longest_s": round(longest, 2)}
        print(
            json.dumps(line) if options.json else "  ".join(f"{key} {value}" for key, value in line.items()), flush=True
        )
        for key, number in wrong.most_common():
            example, said = first[key]
            print(f"    {number} x from input {example}: {key}: {said[:200]!r}", file=sys.stderr, flush=True)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
