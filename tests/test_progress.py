"""Progress where there is no terminal."""

from rearl_jax import progress
from rearl_jax.progress import progress_bar


def test_without_a_terminal_stages_are_lines(capsys, monkeypatch):
    now = iter(range(0, 1000, 10))
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(now))
    with progress_bar() as bar:
        line = bar.add_task("reading", total=9)
        bar.update(line, description="reading", completed=1)
        for _ in range(3):
            bar.advance(line)
        bar.update(line, description="fitting", completed=0)
    written = capsys.readouterr().err.splitlines()
    assert written == ["20 s: reading, 2 of 9", "40 s: reading, 4 of 9", "50 s: fitting, 0 of 9"]


def test_short_work_writes_nothing(capsys):
    with progress_bar() as bar:
        bar.update(bar.add_task("reading", total=3), completed=1)
    assert capsys.readouterr().err == ""
