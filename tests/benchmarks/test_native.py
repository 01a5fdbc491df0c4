import shutil
from dataclasses import replace

import pytest

from benchmarks import native
from benchmarks.native import CompilerError, NativeProgram, compile_limit


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    try:
        return compile_limit(10, tmp_path_factory.mktemp("limit"))
    except CompilerError as error:
        pytest.skip(str(error))


def test_traffic_is_that_of_the_reference_program(program):
    run = NativeProgram(program, 60, 1).measure(1600, 0)
    assert (run.n_scenarios, run.seconds, run.n_substeps) == (1600, 60, 1600 * 10 * 900)
    # Measured with the program as first written; the compiler may round otherwise on another processor.
    assert run.mean_speed == pytest.approx(24.865, abs=0.05)
    assert run.lane_changes is None
    assert run.crashed is None
    assert run.cpu_s > 0
    assert run.wall_s > 0


def test_threads_share_the_work_without_changing_it(program):
    one, two = (NativeProgram(program, 4, threads) for threads in (1, 2))
    assert (one.facts["unit"], two.facts["unit"]) == (16, 32)
    runs = [replace(session.measure(64, 0), cpu_s=0.0, wall_s=0.0) for session in (one, two)]
    assert runs[0] == runs[1]
    assert runs[0].mean_speed > 20


def test_only_whole_groups_are_taken(program):
    with pytest.raises(RuntimeError, match="multiple of 16"):
        NativeProgram(program, 1, 1).measure(20, 0)


def test_without_compiler(monkeypatch, tmp_path):
    monkeypatch.setattr(native, "COMPILER", "no-such-compiler")
    with pytest.raises(CompilerError, match="no C compiler no-such-compiler"):
        compile_limit(10, tmp_path)


@pytest.mark.skipif(shutil.which(native.COMPILER) is None, reason="no C compiler")
def test_compiler_that_refuses(monkeypatch, tmp_path):
    monkeypatch.setattr(native, "FLAGS", ("-march=no-such-processor",))
    with pytest.raises(CompilerError, match=r"cannot compile it here: .*no-such-processor"):
        compile_limit(10, tmp_path)
    assert not list(tmp_path.iterdir())
