"""Standard streams of a narrow encoding, or closed: the work is done and what can be shown is shown."""

import os
import shutil
import subprocess
import sys

import pytest

from rearl_jax.progress import progress_bar

PRINTING = """
import sys
from rearl_jax.cli.streams import make_writable
make_writable()
from rearl_jax.console import standard_output, titled_table
table = titled_table("3.5 \\u00b1 0.1 \\u2013 \\u2264 Zoll\\u00e4nder \\u4e2d")
table.add_column("\\u0394v", min_width=40)
table.add_row("\\u22121")
standard_output(60).print(table)
print("x \\u2192 y", flush=True)
print("\\u2026", file=sys.stderr, flush=True)
"""


def printed(encoding) -> "subprocess.CompletedProcess[bytes]":
    environment = os.environ | {"PYTHONIOENCODING": encoding}
    return subprocess.run([sys.executable, "-c", PRINTING], capture_output=True, env=environment, check=True)


@pytest.mark.parametrize("encoding", ["ascii", "ascii:strict", "us-ascii"])
def test_a_terminal_without_utf8_gets_plain_characters(encoding):
    done = printed(encoding)
    text = done.stdout.decode("ascii")
    assert "3.5 +- 0.1 - <= Zollander ?" in text
    assert "x -> y" in text
    assert "-1" in text
    assert done.stderr.decode("ascii").strip() == "..."


def test_what_an_encoding_has_is_kept():
    text = printed("latin-1").stdout.decode("latin-1")
    assert "3.5 \u00b1 0.1 - <= Zoll\u00e4nder ?" in text
    assert "3.5 \u00b1 0.1 \u2013 \u2264" in printed("utf-8").stdout.decode("utf-8")


@pytest.mark.parametrize("encoding", ["utf-8", "ascii", "latin-1"])
def test_names_of_files_that_are_no_text_are_printed(encoding):
    code = (
        "import sys\nfrom rearl_jax.cli.streams import make_writable\nmake_writable()\n"
        "for stream in (sys.stdout, sys.stderr):\n    print('m\\udcfcll', file=stream, flush=True)"
    )
    environment = os.environ | {"PYTHONIOENCODING": encoding}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, env=environment, check=True)
    assert all(text.startswith(b"m") and b"ll" in text for text in (done.stdout, done.stderr))


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a device that is full")
@pytest.mark.parametrize("words", ["--version", "doctor --json results.root=."])
def test_an_output_that_cannot_be_written_is_named(tmp_path, words):
    with open("/dev/full", "w", encoding="utf-8") as full:
        command = [sys.executable, "-m", "rearl_jax", *words.split()]
        environment = os.environ | {"PYTHONPATH": os.getcwd()}
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, cwd=tmp_path, env=environment, check=False)
    assert done.returncode == 2
    last = done.stderr.decode().splitlines()[-1]
    assert "standard output" in last
    assert "results.root" not in last


@pytest.mark.skipif(shutil.which("sh") is None, reason="a POSIX shell closes the streams")
@pytest.mark.parametrize("closing", [">&-", "2>&-", "<&-", ">&- 2>&-", ">&- 2>&- <&-"])
def test_closed_streams_are_no_error_and_no_file_takes_their_place(tmp_path, closing):
    code = (
        "import os, sys\nfrom rearl_jax.cli import main\n"
        "code = main(['--version']) or main(['no such task']) - 2\n"
        "file = open('own.txt', 'w')\nassert file.fileno() > 2, file.fileno()\n"
        "sys.stdout.flush(); sys.stderr.flush(); sys.stdin.read(0)\n"
        "os.write(1, b'of a library'); file.close(); sys.exit(code)"
    )
    done = subprocess.run(
        ["sh", "-c", f'"$0" -c "$1" {closing}', sys.executable, code],
        cwd=tmp_path,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        env=os.environ | {"PYTHONPATH": os.getcwd()},
        check=False,
    )
    assert (done.returncode, (tmp_path / "own.txt").read_text()) == (0, ""), done.stderr


def test_json_on_a_closed_output_is_no_error(tmp_path):
    command = f'"{sys.executable}" -m rearl_jax doctor --json results.root="{tmp_path}" >&-'
    done = subprocess.run(["sh", "-c", command], capture_output=True, check=False)
    assert done.returncode in (0, 1)
    assert b"Traceback" not in done.stderr


def test_a_progress_bar_needs_no_standard_error(monkeypatch):
    monkeypatch.setattr(sys, "stderr", None)
    with progress_bar() as bar:
        assert bar.disable
