"""Scenes on file: an interrupted collection goes on, and a damaged file is named."""

import dataclasses
import io

import numpy as np
import pytest

from rearl_jax.config import ValidateTask
from rearl_jax.results import Study
from rearl_jax.validation import store as store_module
from rearl_jax.validation.store import ReferenceStore
from rearl_jax.validation.workers import Variant
from tests.refusal import refused


@pytest.fixture
def study(tmp_path):
    return Study(tmp_path, "study", ValidateTask(), "validate")


@pytest.fixture
def three(jobs):
    return jobs["stress10"]


def archive_of_something_else():
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, x=np.zeros(3))
    return buffer.getvalue()


def files(study):
    return sorted(path.name for path in (study.path / "reference").rglob("*") if path.is_file())


def test_collected_scenes_are_those_of_the_workers(study, three, recorded, replayed):
    store = ReferenceStore(study)
    assert list(store.collect(three, 1)) == three
    for job in three:
        np.testing.assert_array_equal(store.load(job).tracks.x, recorded[job].tracks.x)
    assert [name[:10] for name in files(study)] == ["0000_plain", "0001_plain", "0002_plain"]


def test_an_interrupted_collection_goes_on_where_it_stopped(study, three, replayed):
    replayed.broken_after = 1
    collected = []
    with pytest.raises(KeyboardInterrupt):
        collected.extend(ReferenceStore(study).collect(three, 1))
    assert replayed.asked == three
    (first,) = files(study)
    assert first.startswith("0000_plain")
    written = (study.path / "reference" / "stress10" / first).stat().st_mtime_ns

    replayed.asked.clear()
    replayed.broken_after = None
    assert list(ReferenceStore(study).collect(three, 1)) == three
    assert replayed.asked == three[1:]
    assert len(files(study)) == 3
    assert (study.path / "reference" / "stress10" / first).stat().st_mtime_ns == written

    replayed.asked.clear()
    assert list(ReferenceStore(study).collect(three, 1)) == three
    assert replayed.asked == []


def test_other_scenes_and_versions_are_not_mistaken_for_those_on_file(study, three, replayed, monkeypatch):
    list(ReferenceStore(study).collect(three[:1], 1))
    replayed.asked.clear()
    store = ReferenceStore(study)
    job = three[0]
    others = [
        dataclasses.replace(job, variant=Variant.nudged),
        dataclasses.replace(job, scenario=dataclasses.replace(job.scenario, seed=1)),
        dataclasses.replace(job, scenario=dataclasses.replace(job.scenario, actions=job.scenario.actions[1:])),
    ]
    for other in others:
        with pytest.raises(FileNotFoundError):
            store.load(other)
    monkeypatch.setattr(store_module, "version", lambda name: "0.1")
    list(ReferenceStore(study).collect([job], 1))
    assert replayed.asked == [job]
    assert len(files(study)) == 2


def broken(content):
    flipped = bytearray(content)
    flipped[len(content) // 2] ^= 255
    half = content[: len(content) // 2]
    return {"empty": b"", "cut": half, "flipped": bytes(flipped), "other": archive_of_something_else()}


@pytest.mark.parametrize("kind", ["empty", "cut", "flipped", "other"])
def test_a_damaged_file_is_named_with_a_remedy(study, three, replayed, kind):
    store = ReferenceStore(study)
    list(store.collect(three, 1))
    path = study.path / "reference" / "stress10" / files(study)[1]
    path.write_bytes(broken(path.read_bytes())[kind])
    with refused("reference-damaged", file=str(path)):
        store.load(three[1])
    store.load(three[0])
    path.unlink()
    replayed.asked.clear()
    list(store.collect(three, 1))
    assert replayed.asked == [three[1]]
    store.load(three[1])
