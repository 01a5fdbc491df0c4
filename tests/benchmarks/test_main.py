"""The command line: keys as they were given, and what is said where they cannot be used."""

import json
import os

import pytest

from benchmarks import __main__ as module
from benchmarks.__main__ import BENCHMARKS, configured, keys_help, main
from benchmarks.options import Peer
from rearl_jax.problems import InvalidInputError
from rearl_jax.results import Study


def test_keys_are_read_in_the_types_of_the_record():
    words = ["study=quick", "bench.vehicles=[10]", "bench.peers=[c,gpu]", "bench.density=3", "bench.against=results/x"]
    config = configured("core", [*words, "bench.chunk=null", "results.root=there"])
    assert (config.study, config.results.root) == ("quick", "there")
    bench = config.bench
    assert (bench.vehicles, bench.peers, bench.density) == ((10,), (Peer.c, Peer.gpu), 3.0)
    assert (bench.against, bench.chunk) == ("results/x", None)
    assert configured("loop", ["loop.effects=[]", "loop.batches=[16]"]).loop.effects == ()
    assert configured("discover", []) == BENCHMARKS["discover"]()


@pytest.mark.parametrize(
    ("benchmark", "word", "code", "key"),
    [
        ("cor", "study=x", "choice-unknown", "cor"),
        ("core", "bench.vehicle=[1]", "key-unknown", "bench.vehicle"),
        ("loop", "loop", "key-unknown", "loop"),
        ("core", "bench.peers=[d]", "choice-unknown", "bench.peers"),
        ("core", "bench.vehicles=two", "wrong-type", "bench.vehicles"),
        ("core", "bench.vehicles=[", "wrong-type", "bench.vehicles"),
        ("discover", "discover.drivers=[3]", "out-of-range", "discover.drivers"),
    ],
)
def test_other_words_are_refused(benchmark, word, code, key, capsys):
    with pytest.raises(InvalidInputError) as caught:
        configured(benchmark, [word])
    assert (caught.value.code, caught.value.problem.key) == (code, key)
    assert code != "key-unknown" or "nearest: " in caught.value.problem.fault
    assert main([benchmark, word]) == 2
    assert capsys.readouterr().err.startswith("benchmarks: ")


@pytest.mark.parametrize("benchmark", BENCHMARKS)
def test_help_names_every_key_with_its_default(benchmark, capsys):
    assert main([benchmark, "--help"]) == 0
    said = capsys.readouterr().out
    assert said == keys_help(benchmark) + "\n"
    assert f"  study=bench_{benchmark}  (str)" in said
    assert "results.resume=false" in said


def test_help_names_every_benchmark(capsys):
    assert main([]) == main(["--help"]) == 0
    said = capsys.readouterr().out
    assert all(f"\n{name} " in said for name in BENCHMARKS)


@pytest.fixture
def started(monkeypatch):
    """JAX as the other tests of the process have it: it cannot be given more devices once it has computed something."""
    monkeypatch.setattr(module.runtime, "start", lambda: None)


@pytest.mark.usefixtures("started")
@pytest.mark.parametrize(("n_slower", "code"), [(0, 0), (2, 1)])
def test_json_is_the_summary_in_one_line_and_slower_is_a_failure(n_slower, code, monkeypatch, capfd, tmp_path):
    class Core:
        @staticmethod
        def run(config):
            os.write(1, b"a table\n")  # as a library that is not Python's would
            summary = {"n_slower": n_slower, "substeps_per_cpu_s_n10": 2.0}
            Study(config.results.root, config.study, config, "bench core").write_summary(summary)
            return summary

    monkeypatch.setattr(module, "import_module", {"benchmarks.core": Core}.get)
    assert main(["core", "study=x", f"results.root={tmp_path}", "--json"]) == code
    said = capfd.readouterr()
    shown = json.loads(said.out)
    stored = json.loads((tmp_path / "x" / "summary.json").read_text())
    assert shown == {"results": str(tmp_path / "x"), **stored}
    assert (shown["task"], shown["substeps_per_cpu_s_n10"]) == ("bench core", 2.0)
    assert "a table" in said.err


@pytest.mark.usefixtures("started")
@pytest.mark.parametrize(("benchmark", "kept"), [("loop", "nothing is kept"), ("discover", "the same command goes on")])
def test_an_interruption_has_the_code_of_its_signal(benchmark, kept, monkeypatch, capsys):
    class Interrupted:
        @staticmethod
        def run(config):
            raise KeyboardInterrupt

    monkeypatch.setattr(module, "import_module", lambda name: Interrupted)
    assert main([benchmark]) == 130
    said = capsys.readouterr().err
    assert "interrupted by Ctrl-C" in said
    assert kept in said
