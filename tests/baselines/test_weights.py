"""Files of weights: there and back, and every way in which one can be wrong."""

import json
from dataclasses import replace

import jax
import numpy as np
import pytest

from rearl_jax.baselines.driving import DrivingOptions
from rearl_jax.baselines.weights import DEFAULT, FORMAT, load_policy, weights_file
from rearl_jax.config import TrainPpoTask
from rearl_jax.config._schema import as_plain
from rearl_jax.config.decision import AdmissibleConfig, LaneGate, Longitudinal
from rearl_jax.config.ppo import PpoConfig
from rearl_jax.problems import InvalidInputError, MissingInputError


@pytest.fixture
def config(tiny):
    admissible = AdmissibleConfig(lane=LaneGate.mobil_safe, decel_keep=2.5)
    return replace(tiny, ppo=PpoConfig(width=16, longitudinal=Longitudinal.idm_capped), admissible=admissible)


@pytest.fixture
def file(network, config, tmp_path):
    path = tmp_path / "weights.eqx"
    path.write_bytes(weights_file(network, config))
    return path


def test_there_and_back(network, config, file):
    policy = load_policy(str(file), config.core)
    for a, b in zip(*map(jax.tree.leaves, (network, policy.network)), strict=True):
        assert a.dtype == b.dtype == np.float32
        np.testing.assert_array_equal(a, b)
    assert policy.options == DrivingOptions(config.admissible, Longitudinal.idm_capped)
    assert (policy.n_lanes, policy.file) == (4, "weights.eqx")
    assert policy.car_steps == config.ppo.n_updates(4) * 64 * 60 * 4
    # The folder of the results leaves no trace in it.
    moved = replace(config, study="elsewhere", results=replace(config.results, root="anywhere"))
    assert weights_file(network, moved) == file.read_bytes()


def test_wrong_files_are_named(config, file, tmp_path):
    whole = file.read_bytes()
    header, rest = whole.split(b"\n", 1)
    for content, code in (
        (b"", "not-weights"),
        (b'{"a": 1}\n' + rest, "not-weights"),
        (np.random.default_rng(0).bytes(300), "not-weights"),
        (header.replace(b'"width": 16', b'"width": 32') + b"\n" + rest, "weights-damaged"),
        (header.replace(b'"layers": 2', b'"layers": 1') + b"\n" + rest, "weights-damaged"),
        (whole[:-100], "weights-damaged"),
        (whole + b"x", "weights-damaged"),
        (header.replace(b'"decel_keep"', b'"decel_kept"') + b"\n" + rest, "weights-of-another-version"),
    ):
        file.write_bytes(content)
        with pytest.raises(InvalidInputError) as caught:
            load_policy(str(file), config.core)
        assert (caught.value.code, caught.value.problem.file) == (code, str(file))
    file.write_bytes(whole)
    for path, core, code, key in (
        (tmp_path / "nothing.eqx", config.core, "file-missing", "ppo.weights"),
        (tmp_path, config.core, "not-a-file", "ppo.weights"),
        (file, replace(config.core, n_lanes=3), "other-road", "core.n_lanes"),
    ):
        with pytest.raises((InvalidInputError, MissingInputError)) as caught:
            load_policy(str(path), core)
        assert (caught.value.code, caught.value.problem.key) == (code, key)


def test_the_weights_of_the_package_are_those_of_the_defaults():
    assert DEFAULT.stat().st_size < 300_000
    defaults = TrainPpoTask()
    policy = load_policy(None, defaults.core)
    assert policy.car_steps == 1_036_800
    with DEFAULT.open("rb") as file:
        description = json.loads(file.readline())
    assert description["format"] == FORMAT
    plain = as_plain(defaults)
    assert description["config"] == {key: plain[key] for key in ("ppo", "core", "admissible")}
