"""A tiny training: what it writes, that it can be killed, and that its traffic is never that of an evaluation."""

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest

from rearl_jax.baselines import task
from rearl_jax.baselines.learning import Losses
from rearl_jax.baselines.training import (
    CHECKPOINT,
    CurvePoint,
    _checkpoint,
    _restored,
    first_learner,
    train,
    training_keys,
)
from rearl_jax.config import ResultsConfig
from rearl_jax.config.ppo import PpoConfig
from rearl_jax.core.model import TrafficModel
from rearl_jax.core.spawn import spawn
from rearl_jax.evaluation.simulators import rollout_key
from rearl_jax.problems import InvalidInputError
from rearl_jax.results import Study, read_metadata


def at(tiny, tmp_path, **changes):
    return replace(tiny, results=ResultsConfig(root=str(tmp_path)), **changes)


def quietly(config):
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        summary = task.run(config)
    return summary, printed.getvalue()


@pytest.mark.thorough
@pytest.mark.usefixtures("lenient")
def test_what_is_written(tiny, tmp_path):
    config = at(tiny, tmp_path)
    summary, printed = quietly(config)
    folder = tmp_path / "train_ppo"
    assert sorted(path.name for path in folder.iterdir()) == [
        *("config.json", "curve.parquet", "curve.png", "summary.json", "weights.eqx"),
    ]
    assert (summary["updates"], summary["car_steps"]) == (4, 384)
    assert json.loads((folder / "summary.json").read_text())["return_last"] == summary["return_last"]
    curve = pd.read_parquet(folder / "curve.parquet")
    assert curve["car_steps"].tolist() == [96, 192, 288, 384]
    np.testing.assert_allclose(curve[["left", "keep", "right", "faster", "slower"]].sum(axis=1), 1, atol=1e-6)
    assert curve["return"].between(0, 6).all()
    assert curve["speed"].between(5, 32).all()
    assert curve["return"].nunique() == 4
    assert curve["value_loss"].iloc[-1] < curve["value_loss"].iloc[0]
    assert read_metadata(folder / "curve.parquet")["seeds"] == "ppo.seed=0"
    assert "384" in printed
    assert "ppo.weights=" in printed
    again, _ = quietly(at(tiny, tmp_path / "again"))
    assert (tmp_path / "again" / "train_ppo" / "weights.eqx").read_bytes() == (folder / "weights.eqx").read_bytes()
    config.results.resume = True
    assert quietly(config)[0]["seconds"] == summary["seconds"]  # left alone


@pytest.mark.thorough
@pytest.mark.usefixtures("lenient")
def test_a_killed_training_goes_on_and_equals_an_uninterrupted_one(tiny, tmp_path):
    config = at(tiny, tmp_path)
    study = Study(config.results.root, config.study, config, "train ppo")

    def stop_at_three(done, total):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(config, study, stop_at_three)
    assert (study.path / CHECKPOINT).exists()
    resumed = train(config, study)
    assert resumed.n_before == 2  # the third update is made again
    whole = train(config, Study(tmp_path / "whole", config.study, config, "train ppo"))
    assert whole.n_before == 0
    first, second = (jax.tree.leaves((training.network, training.curve)) for training in (resumed, whole))
    for a, b in zip(first, second, strict=True):
        assert np.isfinite(a).all()
        assert np.asarray(a).dtype == np.float32
        np.testing.assert_array_equal(a, b)
    seeded = replace(config, ppo=replace(config.ppo, seed=1))
    fresh = train(seeded, Study(config.results.root, config.study, seeded, "train ppo"))
    assert fresh.n_before == 0  # the checkpoint is of another configuration
    assert (np.asarray(fresh.curve.episode_return) != np.asarray(whole.curve.episode_return)).all()


@pytest.mark.usefixtures("lenient")
def test_a_damaged_checkpoint_is_said_and_left(tiny, tmp_path, caplog):
    learner, zeros = first_learner(tiny), jnp.zeros(4, jnp.float32)
    curve = CurvePoint(zeros, zeros, zeros, jnp.zeros((4, 5), jnp.float32), Losses(*[zeros] * 6))
    whole = _checkpoint(tiny, learner, curve, 2)
    study = Study(tmp_path, tiny.study, tiny, "train ppo")
    study.write_bytes(CHECKPOINT, whole)
    assert _restored(tiny, study, learner, curve)[2] == 2
    for damaged in (b"", b"\x00\xff\n", b"[]\n", b"{}\n", whole[: len(whole) // 2]):
        caplog.clear()
        (study.path / CHECKPOINT).write_bytes(damaged)
        found = _restored(tiny, study, learner, curve)
        assert (found[0] is learner, found[1] is curve, found[2]) == (True, True, 0)
        assert "is damaged" in caplog.text


@pytest.mark.usefixtures("lenient")
@pytest.mark.slow
def test_a_training_that_diverges_stops(tiny, tmp_path):
    config = at(tiny, tmp_path, ppo=replace(tiny.ppo, learning_rate=1e38))
    with pytest.raises(InvalidInputError) as caught:
        train(config, Study(config.results.root, config.study, config, "train ppo"))
    assert (caught.value.code, caught.value.problem.key) == ("diverged", "ppo.learning_rate")


def test_training_never_sees_the_traffic_of_an_evaluation():
    seed = jnp.int32(0)
    updates = jnp.arange(30, dtype=jnp.int32)
    trained = jax.vmap(lambda update: training_keys(seed, update, 64)[0])(updates).ravel()
    # As many as there are of the others: one program for both.
    run, scene = jnp.meshgrid(jnp.arange(40, dtype=jnp.int32), jnp.arange(48, dtype=jnp.int32))
    tested = jax.vmap(lambda r, s: rollout_key(seed, r, s))(run.ravel(), scene.ravel())
    keys = [{tuple(data) for data in np.asarray(jax.random.key_data(some))} for some in (trained, tested)]
    assert [len(some) for some in keys] == [30 * 64, 40 * 48]
    assert not keys[0] & keys[1]
    place = jax.jit(lambda some: spawn(some, TrafficModel(), n_vehicles=3)[0].x)
    places = [np.asarray(place(some)) for some in (trained, tested)]
    together = np.concatenate(places, axis=1)
    assert len(np.unique(together, axis=1).T) == together.shape[1] == 30 * 64 + 40 * 48


def test_keys_out_of_range_are_refused():
    assert PpoConfig().n_updates(10) == 27
    assert PpoConfig().batch(10) == 38_400
    bad = {"scenarios": 0, "car_steps": float("inf"), "seed": -1, "gamma": 1.5, "learning_rate": 0.0}
    for key, value in (bad | {"entropy_weight": -1.0}).items():
        with pytest.raises(InvalidInputError) as caught:
            PpoConfig(**{key: value}).check()
        assert (caught.value.code, caught.value.problem.key) == ("out-of-range", key)


@pytest.mark.slow
def test_a_training_survives_being_killed(tmp_path):
    keys = ["ppo.scenarios=8", "ppo.car_steps=2e5", "ppo.width=16", "ppo.checkpoint_every=1", "core.collisions=false"]
    command = [sys.executable, "-m", "rearl_jax", "train", "ppo", *keys]
    folder = tmp_path / "one" / "train_ppo"
    subprocess.run([*command, f"results.root={tmp_path / 'two'}"], check=True, capture_output=True)
    n_kills = 0
    while n_kills < 2:
        process = subprocess.Popen([*command, f"results.root={tmp_path / 'one'}"], stderr=subprocess.DEVNULL)
        before = (folder / "checkpoint.eqx").stat().st_mtime_ns if (folder / "checkpoint.eqx").exists() else 0
        while process.poll() is None and not (
            (folder / "checkpoint.eqx").exists() and (folder / "checkpoint.eqx").stat().st_mtime_ns != before
        ):
            time.sleep(0.01)
        assert process.poll() is None, "finished before it could be killed"
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        n_kills += 1
    subprocess.run([*command, f"results.root={tmp_path / 'one'}"], check=True, capture_output=True)
    whole = tmp_path / "two" / "train_ppo"
    assert (folder / "weights.eqx").read_bytes() == (whole / "weights.eqx").read_bytes()
    pd.testing.assert_frame_equal(*(pd.read_parquet(some / "curve.parquet") for some in (folder, whole)))
