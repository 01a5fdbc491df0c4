"""Tables on standard output, with and without a terminal."""

import re

import pytest

from rearl_jax import console


def printed_table(capsys, **options) -> str:
    output = console.standard_output(50)
    table = console.titled_table("speeds [m/s]", **options)
    table.add_column("x", min_width=60)
    table.add_row("1")
    output.print(table)
    return capsys.readouterr().out


def test_a_pipe_has_the_width_asked_for_and_no_colours(capsys):
    printed = printed_table(capsys)
    assert max(map(len, printed.splitlines())) == 50
    assert "\x1b" not in printed


def test_a_terminal_keeps_its_own_width(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich then takes any output for a terminal
    monkeypatch.setenv("COLUMNS", "71")
    assert console.standard_output(50).width == 71


@pytest.mark.parametrize("generated", [True, False])
def test_the_title_marks_generated_data(capsys, generated):
    title = printed_table(capsys, generated=generated).splitlines()[0]
    assert title.rstrip() == "speeds [m/s]" + (" (GENERATED recordings)" if generated else "")


def test_notes_are_printed_as_they_are(monkeypatch, capsys):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm-256color")
    output, note = console.standard_output(50), "mean speed 3.5 [bold]"
    output.print(note)
    assert re.search(r"\x1b\[\d.*3\.5", capsys.readouterr().out)  # otherwise the next line would show nothing
    console.print_notes(output, [note, "b"])
    assert capsys.readouterr().out == f"{note}\nb\n"
