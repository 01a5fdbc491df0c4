"""The task: keys that rows set, absent components, the road, parts of recordings that are not scored, one whole run."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.budget import BOUNDARY, CALIBRATED, COMPONENTS, REARL, START, BudgetConfig, StudyBudgetTask
from rearl_jax.config.core import InitConfig, InitialSource
from rearl_jax.config.decision import DecisionConfig, PolicyName
from rearl_jax.config.evaluation import EvaluationConfig, Method, SeedScope, Variant
from rearl_jax.config.scenes import BoundarySource, Direction, SpeedConfig, SpeedNorm
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.data.scenes.splits import Splits
from rearl_jax.evaluation.inputs import Inputs
from rearl_jax.problems import InvalidInputError
from rearl_jax.study.budget.calibrating import without_scenes
from rearl_jax.study.budget.components import rows_of
from rearl_jax.study.budget.simulating import Setting, evaluation_row
from rearl_jax.study.budget.task import present, with_road
from tests.evaluation.conftest import made_scenes
from tests.models.drivers import GAIN, model


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"method": Method.rearl}, "method"),
        ({"variant": Variant.repaired}, "variant"),
        ({"init": InitConfig(InitialSource.scene)}, "init.source"),
        ({"speed": SpeedConfig(SpeedNorm.minmax)}, "speed.norm"),
        ({"eval": EvaluationConfig(seed_scope=SeedScope.run)}, "eval.seed_scope"),
        ({"decision": DecisionConfig(PolicyName.llm)}, "decision.policy"),
    ],
)
def test_keys_that_the_rows_set_are_refused(changes, key):
    StudyBudgetTask().check()
    with pytest.raises(InvalidInputError) as caught:
        replace(StudyBudgetTask(), **changes).check()
    assert caught.value.problem.key == key


def test_components_leave_with_what_they_need():
    assert present(COMPONENTS, {}) == COMPONENTS
    assert present(COMPONENTS, {START: "no lanes"}) == tuple(n for n in COMPONENTS if n not in (START, BOUNDARY))
    assert present(COMPONENTS, {CALIBRATED: "nobody follows"}) == (START, BOUNDARY, REARL)
    with pytest.raises(InvalidInputError) as caught:
        present((START, BOUNDARY), {START: "no lanes"})
    assert caught.value.problem.key == "budget.components"


def test_the_road_has_the_lanes_and_vehicles_of_the_scenes():
    scenes, config = made_scenes(), StudyBudgetTask()
    assert (with_road(config, scenes, needs_lanes=True).core.n_lanes, config.core.n_lanes) == (4, None)
    assert with_road(config, scenes, needs_lanes=True).core.n_vehicles == 4
    wide = replace(scenes, infos=tuple(replace(info, lane_count={1: 5, 2: 5}) for info in scenes.infos))
    one_way = replace(wide, settings={"scenes.direction": Direction.per_direction.name})
    assert with_road(config, one_way, needs_lanes=True).core.n_lanes == 5
    assert with_road(config, wide, needs_lanes=False).core.lanes == 4


def recording():
    """Vehicle 1 is recorded in frames 0 to 39, vehicle 2 in frames 12 to 17, 2.5 frames a second."""
    frame = np.concatenate([np.arange(40), np.arange(12, 18)])
    track = np.repeat([1, 2], [40, 6])
    leader = pd.array(np.where(frame < 15, 2, 1), dtype="Int64")
    table = pd.DataFrame({"track_id": track, "frame": frame, "leader_id": leader})
    return Recording(RecordingInfo("a", 2.5, {1: 2}, 100.0, "a set", "CC0", "somebody"), table)


def test_drivers_are_calibrated_outside_the_scored_seconds():
    scenes = made_scenes().select(np.array([0, 1]))
    scenes = replace(scenes, start_frame=np.array([10, 50]), frame_rate=np.full(2, 10 / 12))  # 10 frames a scene
    (left,) = without_scenes([recording()], scenes, np.array([0]))
    frame, track = left.table["frame"].to_numpy(), left.table["track_id"].to_numpy()
    assert not ((frame >= 10) & (frame < 20)).any()
    assert len(frame) == 30
    # The track is cut in two, and vehicle 2 is gone; its number is free.
    assert sorted(set(track)) == [1, 2]
    assert frame[track == 1].max() == 9
    assert frame[track == 2].min() == 20
    (whole,) = without_scenes([recording()], scenes, np.array([1]))
    assert len(whole.table) == 46
    everything = replace(scenes, start_frame=np.array([0, 50]), frame_rate=np.full(2, 4.0))
    assert list(without_scenes([recording()], everything, np.array([0]))) == []


def test_rows_start_and_drive_as_their_components_say():
    scenes = made_scenes()
    inputs = Inputs(scenes, Splits(np.zeros(6, np.int8), {}, 0, 0))
    setting = Setting(StudyBudgetTask(), inputs, np.arange(2), COMPONENTS, model(GAIN), (0.3, 0.2))
    for row in rows_of(COMPONENTS):
        made = evaluation_row(setting, row)
        assert made.config.init.source is (InitialSource.scene if START in row else InitialSource.seed)
        is_measured = made.config.scenes.boundary is BoundarySource.measured
        assert (is_measured, made.config.method is Method.rearl) == (BOUNDARY in row, REARL in row)
        assert (made.drivers is not None) == (CALIBRATED in row)
        assert made.thresholds == ((0.3, 0.2) if REARL in row else (np.inf, np.inf))


def test_thresholds_are_those_of_base_on_a_free_road(monkeypatch, tmp_path):
    from rearl_jax.config.core import CoreConfig
    from rearl_jax.evaluation.boundaries import check_boundary
    from rearl_jax.progress import silent
    from rearl_jax.results import Study
    from rearl_jax.study.budget import task

    asked = []

    def thresholds(config, inputs, bar):
        check_boundary(config)
        asked.append(config.method)
        return 0.3, 0.2

    monkeypatch.setattr(task, "_inputs", lambda *_: Inputs(made_scenes(), Splits(np.full(6, 3, np.int8), {}, 0, 0)))
    monkeypatch.setattr(task, "thresholds_of", thresholds)
    config = StudyBudgetTask(budget=BudgetConfig(("start", "boundary", "rearl")), core=CoreConfig())
    study = Study(tmp_path, "budget", config, "study budget")
    setting, absent, origin = task.prepared(config, study, silent())
    assert (setting.components, absent, origin) == (("start", "boundary", "rearl"), (), ())
    assert (setting.thresholds, asked) == ((0.3, 0.2), [Method.rearl])
    assert setting.config.core.n_vehicles == 4


@pytest.mark.slow
def test_a_whole_budget_and_its_repetition(tmp_path):
    from rearl_jax.config import ResultsConfig
    from rearl_jax.config.core import CoreConfig
    from rearl_jax.models.file import write_model
    from rearl_jax.study.budget import simulating, task

    write_model(tmp_path / "model.yaml", model(GAIN))
    config = StudyBudgetTask(
        results=ResultsConfig(str(tmp_path)),
        model=str(tmp_path / "model.yaml"),
        budget=BudgetConfig(("start", "boundary", "calibrated", "found")),
        core=CoreConfig(collisions=False),
        eval=EvaluationConfig(n_runs=1, resamples=100, noise_draws=20),
    )
    summary = task.run(config)
    assert summary["components"] == "start+boundary+calibrated+found"
    shares = sum(summary[f"h_{name}"] for name in ("start", "boundary", "calibrated", "found"))
    assert shares == pytest.approx(summary["h_whole"], abs=1e-6)
    assert summary["h_start"] > 0.1  # Base starts at 21 to 24 m/s, the recorded queue is slower
    folder = tmp_path / "study_budget"
    assert json.loads((folder / "summary.json").read_text())["h_whole"] == summary["h_whole"]
    assert pd.read_parquet(folder / "errors")["row"].nunique() == len(rows_of(config.budget.components)) + 3
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulating, "simulated_row", None)  # nothing is simulated again
        assert task.run(config) == summary
