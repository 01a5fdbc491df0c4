import re

import pytest

from rearl_jax.bench import startup
from rearl_jax.bench.startup import COMMANDS, Command, measure
from rearl_jax.bench.startup_results import MEANINGS, Start, StartupResults
from rearl_jax.bench.startup_terminal import TITLES, print_results

MACHINE = {"cpu_model": "a processor", "cpu_cores": 2, "jax_version": "1"}


@pytest.fixture
def results():
    starts = [Start(command.name, k, 1.0 + k, 2.0 + k, 0.5) for k in range(3) for command in COMMANDS]
    return StartupResults(tuple(starts), 15.0, 1.5, 0.5, MACHINE)


def test_the_first_line_is_seen_when_it_is_written(tmp_path):
    # Processor time is counted in ticks, some machines' start of Python takes none.
    works = "while time.process_time() < 0.1: pass"
    words = ("-c", f"import time\nprint('first')\n{works}\ntime.sleep(0.5)\nprint('last')")
    start = measure(Command("two_lines", words), 4, tmp_path)
    assert (start.command, start.repetition) == ("two_lines", 4)
    assert 0 < start.first_s < start.wall_s - 0.4
    assert start.cpu_s > 0.02


def test_an_evaluation_is_told_where_to_write_and_keeps_its_cache_there(tmp_path):
    words = ("-c", "import os, sys; print(sys.argv[1:], os.environ['XDG_CACHE_HOME'], file=open('said', 'w'))")
    measure(Command("said", words, is_evaluation=True), 0, tmp_path)
    said = (tmp_path / "said").read_text()
    assert f"results.root={tmp_path / 'results'}" in said
    assert str(tmp_path / "cache") in said


def test_a_command_that_fails_is_quoted(tmp_path):
    with pytest.raises(RuntimeError, match=r"ended with code 3(.|\n)*no such luck"):
        measure(Command("bad", ("-c", "import sys; print('no such luck', file=sys.stderr); sys.exit(3)")), 0, tmp_path)


def test_the_import_does_not_wait_for_jax(tmp_path):
    seen = "import sys, rearl_jax; print([name for name in ('jax', 'numpy', 'pandas') if name in sys.modules])"
    done = startup.subprocess.run([startup.sys.executable, "-c", seen], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_figure_of_the_summary_is_documented(results):
    summary = results.summary()
    assert summary["evaluate_warm_first_s"] == 2
    assert summary["import_ms"] == 0
    names = "|".join(command.name for command in COMMANDS)
    patterns = [re.sub(r"\{command\}", f"({names})", name) for name in MEANINGS]
    for name in summary.keys() - MACHINE.keys():
        plain = re.sub("_(min|max)$", "", name)
        assert any(re.fullmatch(pattern, plain) for pattern in patterns), f"{name} is not documented"
    for pattern in patterns:
        assert any(re.fullmatch(pattern, name) for name in summary), f"{pattern} is documented, but not there"


def test_terminal_says_which_goal_is_met(results, capsys):
    assert set(TITLES) == {command.name for command in COMMANDS}
    print_results(results)
    said = capsys.readouterr().out
    assert "with an empty cache: goal below 15 s, met" in said
    assert "with a full one: goal below 1.5 s, missed" in said
    assert len(results.table()) == 3 * len(COMMANDS)
