"""The task: one discovery for each set, finished ones left alone, time gaps kept, keys refused that sets decide."""

import json
from dataclasses import replace

import pandas as pd
import pytest

from rearl_jax.config import DataConfig, DiscoverConfig, ResultsConfig, StudyRealTask
from rearl_jax.config._schema import finished
from rearl_jax.config.data import DataFormat
from rearl_jax.config.real import OWN, SETS, RealConfig
from rearl_jax.data.recordings import count_recordings
from rearl_jax.problems import InvalidInputError
from rearl_jax.report.documents import DOCUMENTS
from rearl_jax.report.finished import read_finished
from rearl_jax.results import Study
from rearl_jax.study.real import task
from rearl_jax.study.real.facts import FACT_COLUMNS
from tests.study.real.made import verdict


@pytest.fixture
def config(tmp_path):
    """Two small sets."""
    return StudyRealTask(results=ResultsConfig(str(tmp_path)), real=RealConfig(("i80", "fhwa")))


@pytest.fixture
def done(monkeypatch):
    """Instead of discoveries and calibrations: made ones, and a list of what was asked for."""
    asked = []

    def discover(part, *, show, bar):
        assert not show
        study = Study(part.results.root, part.study, part, "discover", task.data_id(part.data))
        if study.begin(resume=part.results.resume) is None:
            asked.append(part)
            study.write_summary({})
        bar.add_task("a line of the discovery")
        groups = [("ACC", "idm"), ("person", "gipps")] if part.discover.by == "leader" else ()
        return verdict(groups=groups)

    def facts(data, by, car, models, known, *, lane_changes):
        asked.append((by, car, {group: model.model for group, model in models.items()}, len(known)))
        row = dict.fromkeys(FACT_COLUMNS) | {"car": "someone", "setting": "ACC", "calibrated": 1.0, "model_free": 1.1}
        rows = [row, row | {"setting": "person"}, row | {"car": "another"}]
        numbers = [name for name in FACT_COLUMNS if name not in ("car", "setting")]
        return pd.DataFrame(rows).astype(dict.fromkeys(numbers, "Float64"))

    class Read:
        data = None

    monkeypatch.setattr(task.discovery, "run", discover)
    monkeypatch.setattr(task, "facts_of", facts)
    monkeypatch.setattr(task, "read_drivers", lambda *args, **others: Read())
    return asked


def test_every_set_is_a_discovery_in_its_own_folder(config, done, tmp_path):
    summary = task.run(config)
    i80, fhwa, facts = done
    assert (i80.study, i80.data.format, i80.discover.by) == ("study_real/sets/i80", DataFormat.i80, None)
    assert (fhwa.study, fhwa.discover.by) == ("study_real/sets/fhwa", "leader")
    assert facts == ("leader", "person", {"ACC": "idm", "person": "gipps"}, 0)
    assert summary["n_groups"] == 3
    folder = tmp_path / "study_real"
    assert json.loads((folder / "summary.json").read_text())["n_groups"] == 3
    table = pd.read_parquet(folder / "real.parquet")
    assert table["group"].tolist() == ["all", "ACC", "person"]
    assert len(pd.read_parquet(folder / "facts.parquet")) == 3
    assert "Apache" in (folder / "page.html").read_text()


@pytest.mark.slow
def test_what_is_finished_is_not_done_again(config, done):
    first = task.run(config)
    n_asked = len(done)
    assert task.run(config) == first
    assert len(done) == n_asked
    task.run(replace(config, real=RealConfig(("fhwa", "i80", "openacc_people"))))
    assert [part.study for part in done[n_asked:]] == ["study_real/sets/openacc_people"]
    task.run(replace(config, discover=DiscoverConfig(seed=1)))
    assert len(done) == 2 * n_asked + 1


def test_the_report_is_that_of_the_study(config, done, tmp_path):
    task.run(config)
    study = read_finished(str(tmp_path), "study_real")
    document = DOCUMENTS["study real"](study)
    assert document.verdict == "Groups of drivers: 3 improved."
    assert len(document.sources) == 2


def test_known_time_gaps_are_those_of_the_shipped_platoons(config, done):
    task.run(replace(config, real=RealConfig(("openacc",))))
    (_, facts) = done
    assert facts[:2] == ("setting", "model")
    assert facts[3] == 10
    own = DataConfig(DataFormat.openacc, root=str(DataFormat.openacc.shipped))
    assert not task._is_zalazone(own)


def test_own_recordings_are_told_apart_by_the_keys(config):
    data = DataConfig(DataFormat.openacc, root=str(DataFormat.openacc.shipped), recordings="*part1*")
    options = DiscoverConfig(by="setting")
    (cell,) = task.set_tasks_of(replace(config, data=data, discover=options, real=RealConfig((OWN,))))
    assert cell.part.data == data
    assert cell.car == "model"
    assert cell.part.discover == options
    (by_car,) = task.set_tasks_of(
        replace(config, data=data, discover=DiscoverConfig(by="model"), real=RealConfig((OWN,)))
    )
    assert by_car.car is None


def test_a_pattern_takes_the_place_of_that_of_the_sets(config):
    cells = task.set_tasks_of(replace(config, data=DataConfig(DataFormat.i80_slice, recordings="*_1*")))
    assert {cell.part.data.recordings for cell in cells} == {"*_1*"}
    assert len({cell.id for cell in cells}) == 2


def test_every_set_selects_recordings(config):
    cells = task.set_tasks_of(replace(config, real=RealConfig(tuple(SETS))))
    counts = {cell.name: count_recordings(cell.part.data) for cell in cells}
    assert counts == {"i80": 3, "fhwa": 10, "openacc": 20, "openacc_people": 6, "openacc_model": 14}


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        ({"real": RealConfig(("i80", "i80"))}, "real.sets"),
        ({"real": RealConfig(("us101",))}, "real.sets"),
        ({"real": RealConfig(())}, "real.sets"),
        ({"discover": DiscoverConfig(by="lane")}, "discover.by"),
        ({"discover": DiscoverConfig(same="model")}, "discover.same"),
        ({"discover": DiscoverConfig(oracle="grade")}, "discover.oracle"),
    ],
)
def test_keys_that_the_sets_decide_are_refused(config, changed, key):
    with pytest.raises(InvalidInputError) as error:
        finished(replace(config, **changed))
    assert error.value.problem.key == key


@pytest.mark.slow  # minutes of compiling
def test_a_set_from_beginning_to_end(config, tmp_path):
    small = replace(
        config,
        data=DataConfig(DataFormat.i80_slice, recordings="fhwa_run[1-4]"),
        discover=DiscoverConfig(max_drivers=12, replicates=2, draws=200, base=(), page=False),
        real=RealConfig(("fhwa",)),
    )
    summary = task.run(small)
    assert summary["n_groups"] >= 1
    facts = pd.read_parquet(tmp_path / "study_real" / "facts.parquet")
    assert facts["calibrated"].notna().any()
    verdict_file = tmp_path / "study_real" / "sets" / "fhwa" / "verdict.json"
    before = verdict_file.stat().st_mtime_ns
    assert task.run(small) == summary
    assert verdict_file.stat().st_mtime_ns == before
