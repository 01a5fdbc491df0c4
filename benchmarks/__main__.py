"""Command line of the benchmarks: `python -m benchmarks core|loop|boundary|discover|readers [key=value ...]`."""

import argparse
import inspect
import json
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

from benchmarks import options
from rearl_jax import runtime
from rearl_jax.cli.interruption import ended_by_signals, exit_code, name_of
from rearl_jax.cli.summary_output import standard_output_apart, write_object
from rearl_jax.config._schema import finished, from_plain, groups_of, keys_of, nearest
from rearl_jax.problems import InvalidInputError, Problem

BENCHMARKS = {
    "core": options.CoreBenchmark,
    "loop": options.LoopBenchmark,
    "boundary": options.BoundaryBenchmark,
    "discover": options.DiscoverBenchmark,
    "readers": options.ReadersBenchmark,
}
"""Record of the keys of each benchmark, by its name; the module of that name has the function `run`."""

DONE, SLOWER, UNUSABLE = 0, 1, 2
"""Exit codes; that of a benchmark ended by a signal is 128 plus the number of the signal."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code: 0 done, 1 slower than the earlier benchmark, 2 a fault in the arguments, 130 interrupted."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__, add_help=False)
    parser.add_argument("benchmark", nargs="?")
    parser.add_argument("keys", nargs="*", metavar="key=value")
    parser.add_argument("-h", "--help", action="store_true", help="the keys of a benchmark, with their defaults")
    parser.add_argument("--json", action="store_true", help="summary.json as one line on standard output")
    parsed = parser.parse_intermixed_args(arguments)
    try:
        if parsed.benchmark is None or (parsed.help and parsed.benchmark not in BENCHMARKS):
            print(parser.format_help(), *map(_title, BENCHMARKS), sep="\n")
            return DONE
        if parsed.help:
            print(keys_help(parsed.benchmark))
            return DONE
        config = configured(parsed.benchmark, parsed.keys)
        with ended_by_signals(), standard_output_apart() if parsed.json else nullcontext() as output:
            runtime.start()
            summary = import_module(f"benchmarks.{parsed.benchmark}").run(config)
            folder = Path(config.results.root) / config.study
            if output is None:
                print(f"results: {folder}")
            else:
                stored = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
                write_object({"task": stored["task"], "results": str(folder)} | stored, output)
        return SLOWER if summary.get("n_slower") else DONE
    except KeyboardInterrupt as stop:
        kept = "sizes that were measured are kept, the same command goes on" if parsed.benchmark == "discover" else ""
        print(f"benchmarks: interrupted by {name_of(stop)}; {kept or 'nothing is kept'}", file=sys.stderr)
        return exit_code(stop)
    except (InvalidInputError, OSError) as error:
        print(f"benchmarks: {error}", file=sys.stderr)
        return UNUSABLE


def configured(benchmark: str, words: Sequence[str]) -> Any:
    """The record of a benchmark with the keys that were given.

    Raises:
        InvalidInputError: There is no such benchmark or key, or a value is not of its type or outside its range.
    """
    if benchmark not in BENCHMARKS:
        fault = f"is no benchmark; choices: {', '.join(BENCHMARKS)}"
        raise InvalidInputError(Problem("choice-unknown", fault, key=benchmark))
    record, plain = BENCHMARKS[benchmark], {}
    keys = keys_of(record())
    for word in words:
        name, is_given, text = word.partition("=")
        if not is_given or name not in keys:
            fault = f"is no key of `python -m benchmarks {benchmark}` with its =value"
            near = f"nearest: {nearest(name, keys)}; choices: {', '.join(keys)}"
            raise InvalidInputError(Problem("key-unknown", f"{fault}; {near}", key=name))
        group, _, last = name.rpartition(".")
        try:
            (plain.setdefault(group, {}) if group else plain)[last] = yaml.safe_load(text)
        except yaml.YAMLError as error:
            fault = f"must be {keys[name].type_name}"
            raise InvalidInputError(Problem("wrong-type", fault, key=name, value=text)) from error
    return finished(from_plain(record, plain))


def keys_help(benchmark: str) -> str:
    """Description of a benchmark and its keys with default, type and meaning."""
    record = BENCHMARKS[benchmark]()
    lines = [f"python -m benchmarks {benchmark} [--json] [key=value ...]", "", inspect.getdoc(record) or ""]
    for group in groups_of(record):
        lines += ["", f"{group.name}: {group.help}" if group.name else "keys:"]
        lines += [f"  {key.name}={key.default}  ({key.type_name})\n      {key.help}" for key in group.keys]
    return "\n".join(lines)


def _title(benchmark: str) -> str:
    return f"{benchmark:<9} {(BENCHMARKS[benchmark].__doc__ or '').partition(chr(10))[0]}"


if __name__ == "__main__":
    sys.exit(main())
