"""Measured followers: pieces behind one leader, amplification by band, and two one-sided tests."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.config.stability import StabilityConfig, StudyStabilityTask
from rearl_jax.data.records import Recording, RecordingInfo
from rearl_jax.export.platoon import STEPS_PER_SECOND
from rearl_jax.study.stability.cases import cases_of
from rearl_jax.study.stability.measured import (
    BANDS,
    Pairs,
    log_amplification,
    mean_interval,
    measured_table,
    read_pairs,
)
from rearl_jax.study.stability.verdict import verdict_of

RATE, SECONDS = 10.0, 20


def table(n_frames, gap):
    """A leader and its follower, whose leader is unknown for one frame in the middle."""
    frame = np.arange(n_frames)
    speed = 10 + np.sin(0.3 * frame / RATE)
    one = {"frame": frame, "speed": speed, "length": 4.0}
    leader = pd.DataFrame({**one, "track_id": 1, "position": frame + 100.0, "leader_id": pd.NA})
    follower = pd.DataFrame({**one, "track_id": 2, "position": frame + 96.0 - gap, "leader_id": 1})
    follower.loc[n_frames // 2, "leader_id"] = pd.NA
    return pd.concat([leader, follower], ignore_index=True).astype({"leader_id": "Int64"})


def recording(*arguments):
    return Recording(RecordingInfo("made", RATE, {1: 1}, 1000.0, "made", "none", "nobody"), table(*arguments))


def test_pieces_end_where_the_leader_is_unknown():
    gap = np.full(801, 20.0)
    gap[[100, 101, 700]] = -1.0
    pairs = read_pairs([recording(801, gap), recording(150, 20.0)], SECONDS)
    assert pairs.leader.shape == pairs.follower.shape == (SECONDS * STEPS_PER_SECOND + 1, 2)
    assert len(set(pairs.driver.tolist())) == 1  # of one follower, before and after
    assert pairs.overlaps == 2
    assert pairs.hours == pytest.approx((800 + 149) / RATE / 3600)


@pytest.mark.parametrize("track", [1, 2])
def test_a_constant_speed_has_no_amplification(track):
    varied = recording(801, 20.0)
    speed = varied.table["speed"].mask(varied.table["track_id"] == track, 10.0)
    constant = replace(varied, table=varied.table.assign(speed=speed))
    assert read_pairs([varied], SECONDS).leader.shape[1] == 2
    assert read_pairs([constant], SECONDS).leader.shape[1] == 0


def test_a_follower_is_a_car_where_it_is_named_and_else_a_track():
    one = recording(801, 20.0)
    other = replace(one, info=replace(one.info, id="other"))
    assert len(set(read_pairs([one, other], SECONDS, "car").driver.tolist())) == 2
    labelled = [replace(part, info=replace(part.info, labels=("car",))) for part in (one, other)]
    named = [replace(part, table=part.table.assign(car="i3")) for part in labelled]
    assert len(set(read_pairs(named, SECONDS, "car").driver.tolist())) == 1
    assert len(set(read_pairs(named, SECONDS).driver.tolist())) == 2
    unknown = replace(named[1], table=one.table.assign(car=None))
    assert len(set(read_pairs([named[0], unknown], SECONDS, "car").driver.tolist())) == 2


def test_amplification_of_known_signals():
    time = np.arange(601) / STEPS_PER_SECOND
    leader = 10 + 0.01 * time + sum(np.sin(2 * np.pi * f * time + f) for f in (0.035, 0.075, 0.15))
    follower = 9 + sum(
        gain * np.sin(2 * np.pi * f * time + 1.0) for f, gain in ((0.035, 2.0), (0.075, 1.0), (0.15, 0.5))
    )
    gains = np.exp(log_amplification(leader[:, None], follower[:, None]))[:, 0]
    np.testing.assert_allclose(gains, [2.0, 1.0, 0.5], rtol=0.05)


def test_the_interval_is_students():
    assert mean_interval(np.array([1.0, 2.0, 3.0]), 0.95) == pytest.approx((-0.4841, 4.4841), abs=1e-3)


def made_pairs(followers, delay_steps):
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(700, followers))
    smooth = np.apply_along_axis(lambda own: np.convolve(own, np.ones(30) / 30, "same"), 0, noise)
    speed = 15 + 3 * smooth / smooth.std()
    leader, follower = speed[50:651], speed[50 - delay_steps : 651 - delay_steps]
    return Pairs(leader, follower, np.arange(followers), 0, 1.0)


@pytest.mark.slow
def test_the_model_is_held_against_the_recording():
    (case,) = cases_of(StudyStabilityTask(stability=StabilityConfig(models=("idm",))))
    wide = measured_table(case, made_pairs(8, 10), 9.0, 0)
    narrow = measured_table(case, made_pairs(8, 10), 0.01, 0)
    assert wide["equivalent"].all()
    assert not narrow["equivalent"].any()
    assert len(wide) == len(BANDS)
    assert (wide["followers"] == 8).all()
    np.testing.assert_allclose(wide["measured"], 1.0, atol=0.2)  # delayed, not amplified
    np.testing.assert_allclose(wide["ratio"], wide["simulated"] / wide["measured"])
    assert measured_table(case, made_pairs(4, 10), 0.2, 0).empty


@pytest.mark.parametrize(
    ("low", "high", "unstable", "statements"),
    [
        (1.1, 1.3, True, ["collides"]),
        (0.9, 1.2, None, ["collides"]),
        (0.7, 0.9, False, ["string_unstable", "collides"]),
    ],
)
def test_statements_are_made_where_the_recording_is_not(low, high, unstable, statements):
    tables = {
        "amplification": pd.DataFrame({"model": ["a", "b"], "simulated": [1.2, 5.0]}),
        "traffic": pd.DataFrame({"model": ["a", "a"], "collided": [2, 0], "vehicle_hours": [3.0, 1.0]}),
        "measured": pd.DataFrame({"model": ["a"], "measured_low": [low], "measured_high": [high]}),
    }
    verdict = verdict_of("a", tables, made_pairs(5, 1))
    assert verdict["recording_string_unstable"] is unstable
    assert verdict["statements"] == statements
    assert (verdict["largest_amplification"], verdict["collisions_per_vehicle_hour"]) == (1.2, 0.5)


def test_a_model_without_platoons_is_neither_stable_nor_unstable():
    tables = {
        "amplification": pd.DataFrame({"model": ["b"], "simulated": [5.0]}),
        "traffic": pd.DataFrame({"model": ["a"], "collided": [0], "vehicle_hours": [3.0]}),
        "measured": pd.DataFrame({"model": ["a"], "measured_low": [0.7], "measured_high": [0.9]}),
    }
    verdict = verdict_of("a", tables, made_pairs(5, 1))
    assert verdict["string_unstable"] is None
    assert verdict["statements"] == []
