"""The public names: few, light to import, and the examples of the package's docstring do what they say."""

import re
import subprocess
import sys
import textwrap
from pathlib import Path

import jax
import numpy as np
import pandas as pd
import pytest

import rearl_jax
from rearl_jax.blind.traffic import Planted, Scenario
from rearl_jax.blind.traffic.dataset import write_dataset
from rearl_jax.config.data import DataConfig
from rearl_jax.config.evaluation import Method
from rearl_jax.data.problems import BadRecordingError
from rearl_jax.data.recordings import count_recordings, data_id, iterate_recordings
from rearl_jax.data.tables.canonical import write_recording
from rearl_jax.data.tables.in_memory import in_memory
from rearl_jax.models.file import read_model
from rearl_jax.problems import InvalidInputError
from rearl_jax.runtime import double_precision
from rearl_jax.workflows import _task_record

HEAVY = ("gymnasium", "highway_env", "hydra", "jax", "matplotlib", "numpy", "pandas", "pyarrow", "scipy", "sklearn")
LONGEST = 10
"""Lines of an example."""


def examples():
    """The blocks of the docstring, by the first word that tells them apart."""
    blocks = re.findall(r"((?:^    .*\n)+)", rearl_jax.__doc__ or "", re.MULTILINE)
    found = [textwrap.dedent(block) for block in blocks]
    names = ("cut_scenes", "spawn", "evaluate", "calibrate", "discover", "make_env")
    assert len(found) == len(names)
    return {name: next(text for text in found if f"rearl_jax.{name}(" in text) for name in names}


def follow(name, **given):
    """The names an example leaves behind."""
    space = {"rearl_jax": rearl_jax, "jax": jax, "pandas": pd} | given
    exec(compile(examples()[name], f"example of {name}", "exec"), space)
    return space


@pytest.fixture(scope="module")
def lenient():
    """JAX's usual promotion, as users have it."""
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield


def test_importing_it_imports_nothing_heavy():
    program = f"import sys, rearl_jax; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_there_are_about_twenty_names():
    assert 15 <= len(rearl_jax.__all__) <= 22
    for name in rearl_jax.__all__:
        assert name == "__version__" or getattr(rearl_jax, name).__doc__


def test_every_example_is_short():
    assert len(examples()) == 6
    for name, text in examples().items():
        assert len(text.splitlines()) <= LONGEST, name


def test_example_scenes(capsys):
    scenes = follow("cut_scenes")["scenes"]
    assert capsys.readouterr().out.startswith(f"{scenes.speed.shape} ")
    assert scenes.speed.shape[1:] == (60, 10)


@pytest.mark.thorough
@pytest.mark.usefixtures("lenient")
def test_example_rollout(capsys):
    frames = follow("spawn")["frames"]
    assert capsys.readouterr().out.startswith("(60, 10, 100) ")
    assert 15 < frames.speed.mean() < 32


@pytest.mark.slow
@pytest.mark.usefixtures("lenient")
def test_example_metric_table(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    result = follow("evaluate")["result"]
    assert {"summary.json", "runs.parquet", "page.html"} <= {file.name for file in Path("results/mine").iterdir()}
    assert pd.read_parquet("results/mine/runs.parquet").equals(result.runs)
    printed = capsys.readouterr().out
    assert "real against real" in printed
    assert str(result) in printed
    row = result.summary.set_index(["method", "metric"])["value"]
    assert row["base", "h"] > row["noise_floor", "h"] > 0
    assert result.runs["method"].value_counts()["base"] == 5


@pytest.mark.slow
@pytest.mark.usefixtures("lenient")
def test_example_calibration(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    found = follow("calibrate", folder=str(planted(tmp_path / "data")))["found"]
    assert "time_gap" in capsys.readouterr().out
    drivers = found.drivers
    assert len(drivers) > 20
    assert 0.8 < drivers["time_gap"].median() < 2.0
    assert (drivers["one_step"] < 0.3).all()
    model = read_model("model.yaml")
    assert model.effects == ()
    assert np.exp(model.population["car"].log_mean["time_gap"]) == pytest.approx(drivers["time_gap"].median(), rel=0.2)


@pytest.mark.slow
@pytest.mark.usefixtures("lenient")
def test_example_discovery(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    found = follow("discover", folder=str(planted(tmp_path / "data")))["found"]
    assert {"verdict.json", "model.yaml", "page.html"} <= {file.name for file in Path("results/mine").iterdir()}
    printed = capsys.readouterr().out
    assert found.verdict["verdict"] in printed
    assert isinstance(found.candidates, pd.DataFrame)
    assert len(found.candidates) > 5
    assert {effect.name for effect in found.model.effects} == {effect["name"] for effect in found.verdict["effects"]}
    assert "grade" in {effect["name"] for effect in found.verdict["effects"]}


@pytest.mark.slow
@pytest.mark.usefixtures("lenient")
def test_example_environments():
    space = follow("make_env")
    assert space["observation"].shape == (64, 5, 5)
    assert 0 < space["reward"] <= 1


def planted(folder):
    """Generated recordings with a grade in them."""
    folder.mkdir(exist_ok=True)
    write_dataset(folder, Scenario(11, (Planted("grade", 1.5),), n_vehicles=24, duration=40.0))
    return folder


@pytest.mark.parametrize(
    ("call", "code", "key"),
    [
        (lambda: rearl_jax.evaluate(evl={"n_runs": 1}), "key-unknown", "evl.n_runs"),
        (lambda: rearl_jax.evaluate(eval={"n_run": 1}), "key-unknown", "eval.n_run"),
        (lambda: rearl_jax.evaluate(method="bse"), "choice-unknown", "method"),
        (lambda: rearl_jax.evaluate(driver="krause"), "choice-unknown", "driver.model"),
        (lambda: rearl_jax.evaluate(driver=3), "choice-unknown", "driver.model"),
        (lambda: rearl_jax.calibrate(driver={"model": ["idm"]}), "choice-unknown", "driver.model"),
        (lambda: rearl_jax.evaluate(eval={"n_runs": 0}), "out-of-range", "eval.n_runs"),
        (lambda: rearl_jax.discover(study="x"), "key-implied", "study"),
        (lambda: rearl_jax.cut_scenes(data={"format": "highd"}), "root-missing", "data.root"),
        (lambda: list(rearl_jax.read_recordings(form="highd")), "key-unknown", "form"),
    ],
)
def test_wrong_keys_are_named(call, code, key):
    with pytest.raises(InvalidInputError) as caught:
        call()
    assert (caught.value.code, caught.value.problem.key) == (code, key)
    if code == "key-unknown":
        assert "nearest: " in str(caught.value)


def test_keys_imply_what_they_do_on_the_command_line():
    detection, ppo = {"detection": {"interval": 3}}, {"ppo": {"weights": "some.eqx"}}
    # Where two groups imply a method, the order in which they are given does not matter.
    methods = [
        _task_record("evaluate", keys).method
        for keys in ({}, detection, detection | {"method": "base"}, detection | ppo, ppo | detection)
    ]
    assert methods == [Method.base, Method.rearl, Method.base, Method.ppo, Method.ppo]


def test_the_car_following_model_that_is_chosen_is_compared_with_others_only_where_they_are_named():
    named = {"discover": {"base": ["fvdm"]}}
    compared = [
        [driver.model for driver in _task_record("discover", keys).compared]
        for keys in ({"driver": "idm"}, {"driver": "idm", "discover": {"draws": 200}}, {"driver": "idm"} | named)
    ]
    assert compared == [["idm"], ["idm"], ["idm", "fvdm"]]
    assert len(_task_record("discover", {}).compared) > 2


def test_a_table_in_memory_is_read_as_its_file_is(tmp_path):
    recording = next(rearl_jax.read_recordings())
    write_recording(recording, tmp_path / "one.csv")
    (tmp_path / "one.csv.info.json").unlink()
    of_file = rearl_jax.cut_scenes(data={"format": "table", "root": str(tmp_path / "one.csv")})
    of_table = rearl_jax.cut_scenes(recording.table)
    assert len(of_table) == len(of_file) > 0
    np.testing.assert_allclose(of_table.speed, of_file.speed, rtol=1e-6)


def test_a_table_in_memory_names_what_is_wrong_in_it():
    table = next(rearl_jax.read_recordings()).table
    with pytest.raises(BadRecordingError) as error:
        rearl_jax.cut_scenes(table.drop(columns="speed"))
    assert error.value.problem.column == "speed"
    with pytest.raises(BadRecordingError) as error:
        rearl_jax.cut_scenes(table.assign(recording=["a"] * (len(table) - 1) + [None]))
    assert (error.value.problem.column, error.value.problem.row) == ("recording", len(table))


def test_recordings_in_one_table_are_told_apart():
    tables = [recording.table.assign(recording=recording.info.id) for recording in rearl_jax.read_recordings()][:2]
    data = in_memory(pd.concat(tables), DataConfig())
    assert [len(recording.table) for recording in iterate_recordings(data)] == [len(table) for table in tables]
    assert count_recordings(data) == 2
    assert data_id(data) != data_id(in_memory(tables[0], DataConfig()))
    assert data_id(data) == data_id(in_memory(pd.concat(tables), DataConfig()))


def test_scenes_are_evaluated_as_the_recordings_they_were_cut_from():
    scenes = rearl_jax.cut_scenes()
    once = {"eval": {"n_runs": 1, "resamples": 20, "noise_draws": 2}, "core": {"collisions": False}}
    assert rearl_jax.evaluate(scenes, **once).runs.equals(rearl_jax.evaluate(**once).runs)
    with pytest.raises(InvalidInputError) as caught:
        rearl_jax.evaluate(scenes, method="rearl")
    assert (caught.value.code, caught.value.problem.key) == ("recordings-needed", "method")


def test_double_precision_ends_with_the_task():
    before = jax.config.read("jax_enable_x64")
    jax.config.update("jax_enable_x64", False)
    try:
        with double_precision():
            assert jax.numpy.zeros(1, float).dtype == np.float64
        assert not jax.config.read("jax_enable_x64")
    finally:
        jax.config.update("jax_enable_x64", before)
