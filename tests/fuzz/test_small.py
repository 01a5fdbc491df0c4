"""A few fuzzed inputs through every reader and parser; `python -m tests.fuzz` tries very many."""

import subprocess
import sys
from collections import Counter
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rearl_jax.config.data import BadRows
from tests.fuzz.__main__ import BAD, TARGETS, main, target
from tests.fuzz.formats import FORMATS
from tests.fuzz.mutation import in_other_units, unit_faults, without_a_value
from tests.fuzz.outcome import Outcome
from tests.fuzz.readers import Reader

FEW = {"words": 8, "config": 8}
"""Inputs of targets that take long."""

UNITS = [name for name in FORMATS if name not in ("ngsim_txt", "table_parquet")]
"""Formats whose values are not read as those of another one."""


@pytest.mark.parametrize("name", TARGETS)
def test_nothing_crashes_and_nothing_passes_in_silence(name, tmp_path_factory):
    try_one = target(name, tmp_path_factory.mktemp(name))
    outcomes = Counter()

    @settings(
        max_examples=FEW.get(name, 12),
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(st.randoms(use_true_random=False))
    def try_all(rng):
        outcome, said = try_one(rng)
        outcomes[outcome] += 1
        assert outcome not in BAD, said

    try_all()
    assert outcomes.total() >= FEW.get(name, 12)
    # What hypothesis begins with is simple; these are as varied as those of the long run.
    for number in range(2 * FEW.get(name, 12)):
        outcome, said = try_one(Random(number))
        outcomes[outcome] += 1
        assert outcome not in BAD, said
    assert outcomes[Outcome.accepted]
    assert outcomes[Outcome.refused]


@pytest.mark.parametrize("name", UNITS)
def test_every_quantity_in_every_wrong_unit_is_refused(name, tmp_path):
    reader = Reader(name, tmp_path / "recording")
    form = FORMATS[name]
    sound = form.make()
    assert reader.read(sound.files(), BadRows.stop) == (Outcome.accepted, "")
    faults = unit_faults(form)
    assert len(faults) >= 18
    for number, (kind, columns, factor) in enumerate(faults):
        policy = (BadRows.stop, BadRows.drop_row, BadRows.drop_track)[number % 3]
        outcome, said = reader.read(in_other_units(sound, columns, factor, Random(number)), policy)
        assert outcome is Outcome.refused, f"{kind} x {factor:.3g}: {outcome} {said}"


@pytest.mark.parametrize("name", FORMATS)
def test_a_missing_number_never_passes_for_one(name, tmp_path):
    reader = Reader(name, tmp_path / "recording")
    form = FORMATS[name]
    sound = form.make()
    columns = sorted({column for names in form.kinds.values() for column in names})
    outcomes = Counter()
    for number in range(10):
        files = without_a_value(sound, columns, Random(number))
        outcome, said = reader.read(files, (BadRows.stop, BadRows.drop_row)[number % 2])
        outcomes[outcome] += 1
        assert outcome not in BAD, said
    assert outcomes[Outcome.refused]


def test_counts_are_printed(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["fuzz", "reply", "mixture", "--inputs", "50"])
    assert main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("  ")[0] for line in lines] == ["target reply", "target mixture"]
    assert all("inputs 50" in line and "crashed 0  silent 0" in line for line in lines)


def test_an_input_that_hangs_is_named():
    code = "import time; from tests.fuzz.outcome import ended_in_time\n"
    code += "with ended_in_time('reply: input 7 of seed 0', limit=0.2): time.sleep(60)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=50)
    assert done.returncode == 2
    assert "reply: input 7 of seed 0 has not ended after 0.2 s" in done.stderr
    assert "time.sleep" in done.stderr or "<string>" in done.stderr  # where it hangs
