"""Data sets with broad priors: what is drawn, how it is measured, what is drawn again, and a study of them."""

import json
from collections import Counter
from dataclasses import fields, replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.blind import broad, sealing
from rearl_jax.blind.again import judge_again
from rearl_jax.blind.broad import MANY_CHANGES, broad_truth, draw_traffic, write_broad
from rearl_jax.blind.cases import BROAD, BROAD_CONTROL, list_cases
from rearl_jax.blind.rounds import open_study
from rearl_jax.blind.strata import IDMS
from rearl_jax.blind.task import run_with
from rearl_jax.blind.traffic import Planted
from rearl_jax.blind.traffic.catalogue import LISTED
from rearl_jax.blind.traffic.drawing import SUMO_BASES, draw_scenario
from rearl_jax.blind.traffic.models import BASES
from rearl_jax.blind.traffic.plausibility import fault_of
from rearl_jax.blind.traffic.priors import PRIORS
from rearl_jax.blind.traffic.simulation import simulate
from rearl_jax.config.blind import BlindConfig, StudyPriors
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.config.driver import MODELS
from rearl_jax.data.recordings import iterate_recordings
from rearl_jax.discovery.observe.noise import TIMES, USUAL
from tests.blind.stub_study import Stub, task

SMALL = {"priors": StudyPriors.broad, "followers": 12, "duration": 20.0, "sumo": False}


def small(**keys) -> BlindConfig:
    return BlindConfig(**SMALL | {"seed": 11, "n_sets": 4} | keys)


@pytest.fixture(scope="module")
def scenarios():
    return [draw_scenario(PRIORS, (), base, seed, 0) for seed in range(60) for base in BASES]


def test_a_large_study_has_enough_of_everything(scenarios):
    cases = list_cases(BlindConfig(priors=StudyPriors.broad, n_sets=500), 1)
    groups = Counter(case.group for case in cases)
    assert (groups[BROAD_CONTROL], groups[BROAD]) == (125, 375)
    assert sum(case.base not in IDMS for case in cases) >= 60
    effects = Counter(case.variant for case in cases if case.group == BROAD)
    assert set(effects) == set(LISTED)
    assert max(effects.values()) - min(effects.values()) <= 1
    assert Counter(case.base for case in cases).keys() == {*BASES, *SUMO_BASES}
    assert len({case.name for case in cases}) == len({case.seed for case in cases}) == 500
    assert all(case.base not in SUMO_BASES for case in list_cases(small(n_sets=200), 1))
    per_minute = [item.lane_changes / ((item.n_vehicles - item.n_lanes) * item.duration / 60.0) for item in scenarios]
    assert 500 * np.mean(np.array(per_minute) > MANY_CHANGES) >= 60
    assert 500 * np.mean([item.chain.kernel != "none" for item in scenarios]) >= 60


def test_drawn_values_are_within_their_priors(scenarios):
    for scenario in scenarios:
        for item in scenario.population.parameters:
            prior = getattr(PRIORS, item.name)
            assert prior.low <= item.median <= prior.high
        correlation = np.array(scenario.population.correlation)
        assert np.abs(correlation - np.eye(len(correlation))).max() <= PRIORS.correlation.high
        assert np.linalg.eigvalsh(correlation).min() > 0.0
    for name in ("driver_noise", "position_noise", "driver_noise_time", "spacing", "duration"):
        values = np.array([getattr(scenario, name) for scenario in scenarios])
        prior = getattr(PRIORS, name)
        assert values.min() < prior.low * 1.1
        assert values.max() > prior.high / 1.1


def test_no_prior_is_centred_on_what_discovery_assumes():
    assumed = {
        (name, parameter.usual) for model in MODELS.values() for parameter in model.parameters
        if (name := parameter.name) and parameter.usual is not None
    }  # fmt: skip
    assumed |= {("driver_noise", USUAL.acceleration), ("position_noise", USUAL.position)}
    assumed |= {("driver_noise_time", time) for time in TIMES}
    for name, value in assumed:
        assert abs(np.log(getattr(PRIORS, name).centre / value)) > 0.09, name


def test_wider_priors_have_the_same_centres_and_another_hash():
    wide = PRIORS.widened(1.5)
    assert wide.fingerprint() != PRIORS.fingerprint() == PRIORS.widened(1.0).fingerprint()
    for item in fields(PRIORS):
        one, other = getattr(PRIORS, item.name), getattr(wide, item.name)
        if one.is_log:
            assert np.log(other.high / other.low) == pytest.approx(1.5 * np.log(one.high / one.low))
            assert other.centre == pytest.approx(one.centre)
        else:
            assert 0.0 <= other.low <= one.low < one.high < other.high <= 1.0


def test_every_attempt_and_seed_is_another_draw():
    one = draw_scenario(PRIORS, (), "gipps", 3, 0)
    assert one == draw_scenario(PRIORS, (), "gipps", 3, 0)
    assert one != draw_scenario(PRIORS, (), "gipps", 3, 1)
    assert one != draw_scenario(PRIORS, (), "gipps", 4, 0)
    fixed = draw_scenario(PRIORS, (), "gipps", 3, 0, 24, 60.0)
    assert (fixed.duration, fixed.population) == (60.0, one.population)
    assert abs(3 * (fixed.n_vehicles - fixed.n_lanes) - 24) <= 6


@pytest.fixture(scope="module")
def drawn():
    case = list_cases(small(sets=BROAD_CONTROL), 1)[0]
    return case, draw_traffic(case)


def test_what_is_no_traffic_is_noticed(drawn):
    _, (scenario, events) = drawn[0], (drawn[1].scenario, drawn[1].events)
    assert fault_of(scenario, events) is None
    one_place = np.broadcast_to(events.position[:, :1], events.position.shape)
    faults = {
        "invalid": {"position": events.position * np.nan},
        "collision": {"position": one_place},
        "standing": {"speed": 0.0 * events.speed},
        "free": {"position": 30.0 * events.position},
        "emergencies": {"n_emergencies": events.position.size},
    }
    assert {fault_of(scenario, replace(events, **changes)) for changes in faults.values()} == set(faults)
    hiding = replace(scenario, planted=(Planted("grade"),))
    assert fault_of(hiding, replace(events, effect_size=0.0)) == "no_effect"


def test_rejected_draws_are_counted(drawn, monkeypatch):
    case, first = drawn
    answers = iter(["collision", "collision", "free", None])
    monkeypatch.setattr(broad, "fault_of", lambda *_: next(answers))
    monkeypatch.setattr(broad, "simulate", lambda scenario: first.events)
    again = draw_traffic(case)
    assert (again.redraws["collision"], again.redraws["free"], sum(again.redraws.values())) == (2, 1, 3)
    monkeypatch.setattr(broad, "fault_of", lambda *_: "standing")
    with pytest.raises(RuntimeError, match="no traffic"):
        draw_traffic(case)


def test_a_folder_of_a_drawn_data_set_is_readable(drawn, tmp_path):
    case, first = drawn
    write_broad(case, tmp_path)
    recordings = list(iterate_recordings(DataConfig(format=DataFormat.table, root=str(tmp_path))))
    assert len(recordings) == 3
    for recording in recordings:
        assert recording.dropped == {}
        assert recording.table["track_id"].nunique() == first.scenario.n_vehicles
        assert recording.info.frame_rate == first.scenario.frame_rate


def test_an_effect_on_another_model_has_its_size(drawn):
    _, first = drawn
    push = simulate(replace(first.scenario, base="krauss", planted=(Planted("grade"),)))
    assert 0.02 < push.effect_size < 0.4
    assert first.events.effect_size == 0.0


def test_the_truth_says_what_was_drawn(drawn):
    truth = broad_truth(drawn[0])
    assert json.loads(json.dumps(truth, allow_nan=False)) is not None
    assert truth["planted"] == []
    assert truth["base"] == drawn[0].base
    assert truth["scenario"]["chain"]["kernel"] == drawn[1].scenario.chain.kernel


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    root = tmp_path_factory.mktemp("broad")
    return root, run_with(task(root, **SMALL, n_sets=4), Stub(root / "asked.txt", n_files=3))


@pytest.mark.slow
def test_a_study_gives_rates_by_stratum(study):
    root, summary = study
    strata = pd.read_parquet(root / "blind" / "strata.parquet").set_index("stratum")
    assert strata.index[0] == "all"
    assert tuple(strata.loc["all", ["n", "n_effects", "n_controls"]]) == (4, 3, 1)
    for pair in (("smoothed before release", "not smoothed"), ("many lane changes", "few lane changes")):
        assert strata.reindex(pair)["n"].sum() == 4
    assert summary["strata"][0]["n"] == 4
    assert set(summary["redraws"]) == set(broad.REASONS)
    assert {row["name"] for row in summary["priors"]} == {item.name for item in fields(PRIORS)}
    assert {"broad_identified", "broad_wrong", "broad_control"} <= {row["name"] for row in summary["scores"]}
    protocol = json.loads((root / "blind" / "protocol.json").read_text())
    assert protocol["priors_hash"] == PRIORS.fingerprint()
    page = (root / "blind" / "page.html").read_text()
    assert "Broad priors, by stratum" in page
    assert f"rejected before the truth was sealed: {sum(summary['redraws'].values())}" in page
    assert not (root / "blind" / sealing.UNSEALED).exists()


@pytest.mark.slow
def test_a_study_judged_again_is_the_same(study):
    root, summary = study
    again = judge_again(root / "blind")
    assert {key: again[key] for key in summary} == summary


def test_sealing_goes_on_where_it_was(tmp_path, monkeypatch):
    asked = []

    def truth_of(case):
        asked.append(case.name)
        if len(asked) == 3:
            raise KeyboardInterrupt
        return {"planted": []}

    monkeypatch.setattr(sealing, "truth_of", truth_of)
    with pytest.raises(KeyboardInterrupt):
        open_study(tmp_path, "c", small(), lambda done, total: None)
    _, cases = open_study(tmp_path, "c", small(), lambda done, total: None)
    assert [asked.count(case.name) for case in cases] == [1, 1, 2, 1]
    assert len(json.loads((tmp_path / sealing.TRUTH).read_text())) == 4
