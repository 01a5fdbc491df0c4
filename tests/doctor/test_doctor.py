"""`rearl doctor`: every line says ok, warn or fail, with a remedy where there is something to do."""

import json
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from rearl_jax.config import DoctorTask
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.config.decision import DecisionConfig, PolicyName
from rearl_jax.config.llm import LlmConfig
from rearl_jax.doctor import folders, machine, programs, recordings, server
from rearl_jax.doctor.check import Status
from rearl_jax.doctor.programs import _USES
from rearl_jax.doctor.recordings import recording_checks, shipped_checks
from rearl_jax.llm.connection import Response


def statuses(checks):
    return [check.status for check in checks]


def test_the_command_prints_lines_and_json(tmp_path):
    command = [sys.executable, "-m", "rearl_jax", "doctor", f"results.root={tmp_path}", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    found = json.loads(done.stdout)
    assert done.returncode == int(found["n_fail"] > 0)
    names = [check["name"] for check in found["checks"]]
    assert {"python", "jax", "devices", "cores", "memory", "cache", "results", "disk", "data", "packages"} <= set(names)
    assert found["n_ok"] + found["n_warn"] + found["n_fail"] == len(names)
    assert all(check["remedy"] for check in found["checks"] if check["status"] != "ok")
    assert sum(line.startswith(("ok ", "warn", "fail")) for line in done.stderr.splitlines()) == len(names)
    assert list(tmp_path.iterdir()) == []


def test_recordings_that_are_missing_or_broken_fail(tmp_path):
    (sound,) = recording_checks(DataConfig())
    assert sound.status is Status.ok
    assert "3 recordings" in sound.found
    (tmp_path / "a.csv").write_text("nothing,of,that\n1,2,3\n")
    for root in (tmp_path / "nowhere", tmp_path):
        (check,) = recording_checks(DataConfig(DataFormat.table, str(root)))
        assert check.status is Status.fail
        assert str(root) in check.found


def test_shipped_recordings_are_counted_and_missed(monkeypatch):
    (sound,) = shipped_checks()
    assert sound.status is Status.ok
    assert "fhwa 10, i80 3, i80_lateral 1, i80_slice 1, openacc 26, us101 3" in sound.found

    def missing(data):
        raise FileNotFoundError(data.format.name)

    monkeypatch.setattr(recordings, "count_recordings", missing)
    (lost,) = shipped_checks()
    assert lost.status is Status.fail
    assert lost.remedy


def test_folders_that_cannot_be_used(tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.touch()
    assert statuses(folders.results_checks(file / "results"))[0] is Status.fail
    assert statuses(folders.cache_checks(file / "cache"))[0] is Status.warn
    assert statuses(folders.results_checks(tmp_path / "new"))[0] is Status.ok
    assert not (tmp_path / "new").exists()
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    (check, _) = folders.cache_checks(tmp_path / "open")
    assert check.status is Status.warn
    assert "others can write" in check.found
    for free, status in ((2**40, Status.ok), (2**30, Status.warn), (2**20, Status.fail)):
        usage = SimpleNamespace(free=free)
        monkeypatch.setattr(folders.shutil, "disk_usage", lambda place, usage=usage: usage)
        assert folders.results_checks(tmp_path)[1].status is status


def test_a_large_cache_may_be_removed(tmp_path, monkeypatch):
    (tmp_path / "program").write_bytes(b"x" * 1000)
    tmp_path.chmod(0o700)
    assert folders.cache_checks(tmp_path)[0].status is Status.ok
    monkeypatch.setattr(folders, "_LARGE_CACHE", 999)
    check = folders.cache_checks(tmp_path)[0]
    assert (check.status, check.remedy[:6]) == (Status.warn, "rm -r ")


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("raise ImportError('libcuda is gone')", "libcuda is gone"),
        ("import time; time.sleep(60)", "no answer within"),
        ("import os; os.kill(os.getpid(), 11)", "exit code -11"),
        ("print('nothing')", "exit code 0"),
    ],
)
def test_jax_that_does_not_work_fails_whatever_it_does(monkeypatch, code, said):
    monkeypatch.setattr(machine, "_PROBE", code)
    monkeypatch.setattr(machine, "_PATIENCE", 3.0)
    (check,) = machine._jax()
    assert check.status is Status.fail
    assert said in check.found
    assert check.remedy


def test_a_gpu_that_jax_does_not_use_is_told(monkeypatch):
    answer = {"jax": "1", "jaxlib": "1", "platform": "cpu", "n": 1, "kind": "cpu", "sum": 4.0}
    monkeypatch.setattr(machine, "_PROBE", f"print({json.dumps(answer)!r})")
    monkeypatch.setattr(machine, "_has_nvidia", lambda: True)
    monkeypatch.delenv("JAX_PLATFORMS", raising=False)
    assert statuses(machine._jax()) == [Status.ok, Status.warn]
    monkeypatch.setattr(machine, "_has_nvidia", lambda: False)
    assert statuses(machine._jax()) == [Status.ok, Status.ok]


def test_little_memory_and_busy_cores_are_told(monkeypatch):
    for memory, status in (((2**35, 2**34), Status.ok), ((2**35, 2**30), Status.warn), ((None, None), Status.ok)):
        monkeypatch.setattr(machine, "_memory_bytes", lambda memory=memory: memory)
        assert machine._memory().status is status
    for load, status in ((0.0, Status.ok), (10_000.0, Status.warn)):
        monkeypatch.setattr(machine.os, "getloadavg", lambda load=load: (load, 0.0, 0.0))
        assert machine._cores().status is status


def test_packages_that_are_missing(monkeypatch):
    wanted = ["jax>=0.9", "no-such-package>=1", 'no-such-extra>=2; extra == "ray"', "pytest; extra == 'test'"]
    monkeypatch.setattr(programs, "requires", lambda name: wanted)
    monkeypatch.setattr(programs.shutil, "which", lambda name: None)
    found = {check.name: check for check in programs.program_checks()}
    assert found["packages"].status is Status.fail
    assert found["packages"].remedy == "pip install no-such-package"
    assert (found["extra ray"].status, found["extra test"].status) == (Status.warn, Status.ok)
    assert found["browser"].status is Status.warn


def test_it_is_said_what_every_extra_is_for():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert set(_USES) == set(project["optional-dependencies"])


def test_servers(monkeypatch):
    llm = LlmConfig()
    assert server.server_checks(DecisionConfig(), llm) == []  # nobody has asked for one
    assert len(server.server_checks(DecisionConfig(PolicyName.llm), llm)) == 1
    assert statuses(server.server_checks(DecisionConfig(server="nonsense"), llm)) == [Status.fail]
    said: dict[str, Response] = {}

    async def get(connection, path, read_timeout):
        return said["now"]

    monkeypatch.setattr(server.Connection, "get", get)
    asked = DecisionConfig(server="http://127.0.0.1:9/v1")
    for response, config, status in (
        (Response(error="refused"), llm, Status.fail),
        (Response(401, b"{}"), llm, Status.fail),
        (Response(200, b"<html>"), llm, Status.fail),
        (Response(503, b"{}"), llm, Status.fail),
        (Response(200, b'{"data": [{"id": "a"}]}'), llm, Status.ok),
        (Response(200, b'{"data": [{"id": "a"}, {"id": "b"}]}'), llm, Status.fail),
        (Response(200, b'{"data": [{"id": "a"}, {"id": "b"}]}'), replace(llm, model="b"), Status.ok),
        (Response(200, b'{"data": [{"id": "a"}]}'), replace(llm, model="c"), Status.fail),
    ):
        said["now"] = response
        (check,) = server.server_checks(asked, config)
        assert check.status is status, check
        assert check.remedy or status is Status.ok


def test_nothing_that_needs_jax_is_asked_where_jax_does_not_work(monkeypatch, tmp_path, capsys):
    from rearl_jax.doctor import check, task

    monkeypatch.setattr(task, "machine_checks", lambda: [check.fail("jax", "gone", "install it")])
    monkeypatch.setattr(task, "_cache_checks", lambda: pytest.fail("needs JAX"))
    config = DoctorTask()
    config.results.root = str(tmp_path)
    found = task.run(config)
    assert found["n_fail"] == 1
    printed = capsys.readouterr().out
    assert "fail  jax" in printed
    assert "-> install it" in printed
