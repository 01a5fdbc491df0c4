"""The method critical in the evaluation: same starts as base, one program for all mixtures, frozen shares, files."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.baselines.critical.adaptation import Assessment, best_of
from rearl_jax.baselines.critical.mixture import ALL_REGULAR, Mixture, grid
from rearl_jax.cli.composition import with_implied
from rearl_jax.config import SweepScaleTask
from rearl_jax.config.core import InitConfig, InitialSource
from rearl_jax.config.critical import CriticalConfig, Proposer
from rearl_jax.config.decision import DecisionConfig, PolicyName
from rearl_jax.config.evaluation import EvaluationConfig, Method, SeedScope
from rearl_jax.config.metrics import SafetyConfig
from rearl_jax.evaluation import critical as glue
from rearl_jax.evaluation.critical import adapt
from rearl_jax.evaluation.critical_results import adaptation_extra
from rearl_jax.evaluation.mixture_trials import assess
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row
from rearl_jax.evaluation.runner import scored_rollouts
from rearl_jax.progress import progress_bar
from rearl_jax.sweep.scale import list_rollouts
from rearl_jax.tasks import TASKS
from tests.evaluation.test_rollouts import frames_of
from tests.llm.asking import make_config
from tests.llm.stub import Stub
from tests.refusal import refused

SUBSET = np.array([0, 2, 3])


@pytest.fixture
def critical(small):
    return replace(small, method=Method.critical, critical=CriticalConfig(rollouts=6))


def test_regular_drivers_start_on_the_lanes_and_at_the_places_of_base(scenes, critical, standing):
    _, base = frames_of(replace(critical, method=Method.base), scenes)
    _, ours = frames_of(critical, scenes, mixture=ALL_REGULAR)
    np.testing.assert_array_equal(ours.x[0], base.x[0])
    np.testing.assert_array_equal(ours.lane[0], base.lane[0])
    assert (ours.speed > base.speed).mean() > 0.8
    np.testing.assert_allclose(ours.acceleration, 3.2, rtol=1e-6)
    assert standing == [False, True]  # politeness counts in the second program, the first ones of this file


def test_a_measured_start_keeps_its_speeds_and_gets_drivers(scenes, critical, standing):
    measured = replace(critical, init=InitConfig(source=InitialSource.scene))
    _, base = frames_of(replace(measured, method=Method.base), scenes)
    _, ours = frames_of(measured, scenes, mixture=Mixture(0.0, 1.0, 0.0))
    np.testing.assert_array_equal(ours.x[0], base.x[0])
    np.testing.assert_array_equal(ours.speed[0], base.speed[0])
    wanted, seen = ours.heading[0], base.heading[0]
    assert (wanted <= seen).all()
    assert 0.1 < (wanted < seen).mean() < 0.9
    np.testing.assert_allclose(ours.acceleration, 2.0, rtol=1e-6)


def test_mixtures_are_assessed_from_recorded_starts_where_these_are_evaluated(scenes, critical, standing):
    mixture = Mixture(0.4, 0.2, 0.2)
    measured = replace(critical, init=InitConfig(source=InitialSource.scene))
    (alone,) = assess(measured, scenes, SUBSET, [mixture])
    config = replace(measured, eval=EvaluationConfig(n_runs=2))
    row = scored_rollouts(Rollouts([Row(config, mixture=mixture)], scenes, SUBSET), scenes, SUBSET)
    assert alone.n_vehicles == 6 * 4
    assert alone.h == pytest.approx(row.values["h"].mean(), rel=1e-6)


@pytest.mark.parametrize(
    ("source", "said"),
    [
        (InitialSource.seed, "4 rollouts against 3 threshold scenes"),
        (InitialSource.scene, "6 rollouts each against its own of 3 threshold scenes"),  # equally many for every scene
    ],
)
def test_the_note_counts_the_rollouts_that_were_simulated(critical, source, said):
    config = replace(with_keys(critical, rollouts=4), init=InitConfig(source=source))
    n_rollouts = 4 if source is InitialSource.seed else 6
    assessment = Assessment(0.3, 0.2, 0, 0, n_rollouts * config.core.n_vehicles)
    adaptation = best_of([ALL_REGULAR], lambda mixtures: [assessment], Proposer.stats.name)
    assert said in adaptation_extra(config, adaptation, 3, generated=False).notes[0]


def test_rounds_have_initial_states_of_their_own(scenes, critical, standing):
    def starts(eval, **keys):
        return frames_of(replace(critical, eval=eval), scenes, mixture=ALL_REGULAR, **keys)[1].x[0]

    shared = EvaluationConfig(n_runs=6, seed_scope=SeedScope.run)
    evaluated, per_scene = starts(shared), starts(EvaluationConfig(n_runs=6))
    rounds = starts(shared, apart=True)
    assert rounds.shape == evaluated.shape == (4, 6)
    assert not np.isin(rounds, np.concatenate([evaluated, per_scene], axis=1)).any()
    np.testing.assert_array_equal(rounds, starts(shared, apart=True))


def test_a_mixture_is_assessed_alike_alone_and_among_others_and_as_the_evaluation_scores(scenes, critical, standing):
    mixture = Mixture(0.4, 0.2, 0.2)
    (alone,) = assess(critical, scenes, SUBSET, [mixture])
    traced, seen = len(standing), []
    # Near misses do not move with the threshold of the metrics.
    other = replace(critical, safety=SafetyConfig(ttc=9.0))
    among = assess(other, scenes, SUBSET, grid(), lambda done, total: seen.append((done, total)))
    assert alone == among[grid().index(mixture)]
    assert len({assessment.h for assessment in among}) > 30
    assert {assessment.n_vehicles for assessment in among} == {6 * 4}
    assert len(standing) == traced  # one program for all mixtures
    assert seen[-1] == (56 * 6, 56 * 6)
    config = replace(critical, eval=EvaluationConfig(n_runs=6, seed_scope=SeedScope.run))
    row = scored_rollouts(Rollouts([Row(config, mixture=mixture)], scenes, SUBSET, apart=True), scenes, SUBSET)
    assert alone.h == pytest.approx(row.values["h"].mean(), rel=1e-6)
    assert alone.mape == pytest.approx(row.values["mape_a"].mean(), rel=1e-6)
    short = row.values["ttc_share"] * row.counts["ttc_share"]
    assert alone.near_misses == round(np.nansum(short) / len(SUBSET))
    assert alone.crashed == 0


def test_shares_must_come_from_somewhere(scenes, critical):
    with refused("key-missing", key="critical.ratios"):
        Rollouts([Row(critical)], scenes, np.arange(2))
    scale = SweepScaleTask(method=critical.method, core=critical.core, n_rollouts=20.0)
    with refused("key-missing", key="critical.ratios"):
        list_rollouts(scale, scenes, np.arange(6), None, (0.0, 0.0))
    fixed = replace(scale, critical=CriticalConfig(ratios=(0.2, 0.3, 0.1)))
    assert len(list_rollouts(fixed, scenes, np.arange(6), None, (0.0, 0.0))) == 20


def adapted(config, scenes):
    with progress_bar() as bar:
        return adapt(config, scenes, SUBSET, bar)


def with_keys(config, **keys):
    return replace(config, critical=replace(config.critical, **keys))


def test_given_shares_are_taken_as_they_are(scenes, critical):
    mixture, (extra,) = adapted(with_keys(critical, ratios=(0.2, 0.3, 0.1)), scenes)
    assert mixture == (0.2, 0.3, 0.1)
    assert not extra.tables
    assert not extra.figures
    assert extra.summary == {
        "ratio_aggressive": 0.2,
        "ratio_defensive": 0.3,
        "ratio_truck": 0.1,
        "proposer": "given",
        "rounds": 0,
    }
    assert "set by critical.ratios" in extra.notes[0]


def test_search_keeps_the_least_sum_of_both_errors(scenes, critical, standing):
    mixture, (extra,) = adapted(with_keys(critical, proposer=Proposer.search), scenes)
    rounds = extra.tables["rounds"]
    assert len(rounds) == 56
    best = rounds.loc[(rounds.h + rounds.mape).idxmin()]
    assert best.is_kept
    assert rounds.is_kept.sum() == 1
    assert mixture == (best.aggressive, best.defensive, best.truck)
    assert extra.figures["critical"]().startswith(b"\x89PNG")
    assert "the best of 56 mixtures" in extra.notes[0]


@pytest.fixture
def asking(critical, tmp_path, monkeypatch):
    """A configuration that asks a server, and recordings whose shares are known."""
    monkeypatch.setattr(glue, "recorded_shares", lambda *arguments: Mixture(0.1, 0.2, 0.3))

    def configured(server, policy="matcher", **keys):
        decision = DecisionConfig(policy=PolicyName[policy], server=server)
        llm = make_config(tmp_path, tries=1, **{"constrained": True})
        asking = replace(critical, decision=decision, llm=llm)
        return with_keys(asking, proposer=Proposer.llm, rounds=3, attempts=2, **keys)

    return configured


def saying(answer):
    """A stub that answers with what a function of the user message says."""

    def say(body):
        message = {"role": "assistant", "content": answer(body["messages"][-1]["content"])}
        return {"choices": [{"index": 0, "finish_reason": "stop", "message": message}], "usage": {}}

    return Stub(say=say)


def object_of(*shares):
    return json.dumps(dict(zip(("aggressive", "defensive", "truck"), shares, strict=True)))


def test_a_language_model_proposes_its_answers_are_kept_and_replayed(scenes, asking, standing):
    def answer(user):
        if "Check the ranges" not in user:
            return "I think there should be more trucks."
        return object_of(0.5, 0.4, 0.3) if "Tried before" not in user else f"So: {object_of(0.1, 0.2, 0.4)}."

    with saying(answer) as stub:
        mixture, (extra, answers) = adapted(asking(stub.url), scenes)
        assert mixture == (0.1, 0.2, 0.4)
        rounds = extra.tables["rounds"]
        assert rounds["round"].tolist() == [0, 1, 2, 3]
        assert rounds.cause.tolist() == ["start", "out_of_range", "answered", "answered"]
        assert rounds.attempts.tolist() == [0, 2, 2, 2]
        assert rounds.is_kept.tolist() == [False, False, False, True]
        assert rounds.truck.tolist() == [0.0, 0.0, 0.4, 0.4]
        assert extra.summary["rounds"] == 3
        assert extra.figures["critical"]().startswith(b"\x89PNG")
        requests = answers.tables["requests"]
        assert requests.scenario.tolist() == [1, 1, 2, 2, 3, 3]
        assert requests.vehicle.tolist() == [1, 2] * 3
        assert requests.cause.tolist() == ["unparsable", "out_of_range", *["unparsable", "answered"] * 2]
        assert (requests.action == -1).all()
        assert "rounds without new shares: out_of_range 1" in answers.notes[0]
        assert len(stub.chats) == answers.summary["requests"] == 6
        assert stub.chats[0].body["max_tokens"] == 256
        again, (_, second) = adapted(asking(stub.url), scenes)
        assert len(stub.chats) == 6
        assert second.summary["requests"] == 0
    replayed, (_, third) = adapted(asking("nowhere", "replay"), scenes)
    assert again == replayed == mixture
    assert third.tables["requests"].text.tolist() == requests.text.tolist()


def test_a_model_without_a_valid_answer_leaves_all_regular_and_is_counted(scenes, asking, standing):
    with saying(lambda user: "{}") as server:
        mixture, (extra, answers) = adapted(asking(server.url), scenes)
    assert mixture == (0.0, 0.0, 0.0)
    assert extra.tables["rounds"].cause.tolist() == ["start", *["unparsable"] * 3]
    assert extra.tables["rounds"].attempts.tolist() == [0, *[2] * 3]
    assert answers.summary["cause_unparsable"] == 6
    assert "unparsable 3" in answers.notes[0]


def test_a_server_that_answers_nothing_leaves_no_result(scenes, asking, standing):
    with Stub(fault=lambda seen: 400) as server, refused("answers-unusable"):
        adapted(asking(server.url), scenes)


def test_no_server_is_said_before_anything_is_simulated(scenes, asking, monkeypatch):
    monkeypatch.setattr(glue, "assess", lambda *arguments: pytest.fail("simulated"))
    with Stub() as stub:
        address = stub.url
    with pytest.raises(ConnectionError):
        adapted(asking(address), scenes)


def test_keys_of_the_group_imply_the_method_also_beside_those_of_a_server():
    (task,) = (task for task in TASKS if task.words == "evaluate")
    asked = ["critical.proposer=llm", "decision.server=http://127.0.0.1:1/v1", "llm.model=m"]
    assert with_implied(task, asked) == ["method=critical", *asked]
    assert with_implied(task, asked[1:]) == ["method=rearl", *asked[1:]]
    assert with_implied(task, ["method=base", *asked]) == ["method=base", *asked]


@pytest.mark.slow
def test_evaluate_critical_from_end_to_end(tmp_path):
    """On the shipped recordings, with the default proposer."""
    keys = [
        "eval.n_runs=1",
        "eval.resamples=200",
        "critical.rollouts=4",
        "core.collisions=false",
        f"results.root={tmp_path}",
    ]
    command = [sys.executable, "-m", "rearl_jax", "evaluate", "method=critical", *keys]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "evaluate"
    summary = json.loads((folder / "summary.json").read_text())
    assert [row["method"] for row in summary] == ["critical", "base", "real_vs_real", "noise_floor", "real"]
    method, base = summary[:2]
    ratios = [method[f"ratio_{name}"] for name in ("aggressive", "defensive", "truck")]
    assert 0 < sum(ratios) < 1
    assert (method["proposer"], method["rounds"]) == ("stats", 1)
    assert base["proposer"] is None
    assert method["h"] != base["h"]
    assert method["h_less_base"] == pytest.approx(method["h"] - base["h"])
    (row,) = pd.read_parquet(folder / "rounds.parquet").to_dict("records")
    assert [row["aggressive"], row["defensive"], row["truck"]] == ratios
    assert row["is_kept"]
    assert row["n_vehicles"] == 40
    page = (folder / "page.html").read_text(encoding="utf-8")
    assert "How the shares of the driver classes were found" in page
    assert page.count("data:image/png;base64,") == 4
    assert (folder / "critical.png").read_bytes().startswith(b"\x89PNG")
    said = " ".join(done.stdout.split())
    assert "proposed and simulated once" in said
    assert f"aggressive {100 * ratios[0]:.0f} %" in said
