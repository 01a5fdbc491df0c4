"""The method ppo in the evaluation: the traffic of base at the start, its own row, note and figure."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from rearl_jax.config.evaluation import Method
from rearl_jax.config.ppo import PpoPolicyConfig
from rearl_jax.core.rollout import Frames
from rearl_jax.data.recordings import data_id
from rearl_jax.evaluation import simulators
from rearl_jax.evaluation.estimates import estimates
from rearl_jax.evaluation.figures import draw
from rearl_jax.evaluation.policy_actions import count_actions
from rearl_jax.evaluation.rollouts import Rollouts
from rearl_jax.evaluation.rows import Row
from rearl_jax.evaluation.runner import evaluate
from rearl_jax.evaluation.tables import summary_rows
from rearl_jax.evaluation.task import documented, inputs_id
from tests.evaluation.test_rollouts import frames_of


@pytest.fixture
def driven(small):
    core = replace(small.core, lane_changes=False)
    return replace(small, method=Method.ppo, core=core)


def test_everybody_starts_as_under_base(scenes, driven, monkeypatch, simulated_by):
    """The state handed to both simulations is the same, bit for bit."""

    def still(state, n_seconds):
        same = jnp.zeros((n_seconds, *state.x.shape), state.x.dtype)
        lane = jnp.zeros(same.shape, jnp.int32)
        return Frames(same + state.x[None], same + state.y[None], same, same + state.speed[None], same, lane, same > 0)

    def driving(state, *_, n_seconds):
        frames = still(state, n_seconds)
        return frames, frames.lane

    monkeypatch.setattr(simulators, "rollout_with_actor", driving)
    parts = {}
    with simulated_by(lambda state, drivers, model, n_seconds: still(state, n_seconds)):
        for method in (Method.base, Method.ppo):
            (parts[method],) = Rollouts([Row(replace(driven, method=method))], scenes, np.array([1, 4])).chunks()
    assert parts[Method.ppo].decisions is None
    assert parts[Method.ppo].actions is not None
    assert parts[Method.base].actions is None
    for name in ("x", "y", "speed"):
        values = (getattr(part.frames, name) for part in parts.values())
        np.testing.assert_array_equal(*values)
    assert np.ptp(parts[Method.base].frames.speed[0]) > 0


@pytest.mark.thorough
def test_row_base_beside_it_note_and_figure(scenes, driven):
    held_out = np.array([1, 4])
    evaluation = evaluate(driven, scenes, held_out)
    assert [row.row for row in evaluation.rows] == ["ppo", "base", "real_vs_real", "noise_floor", "real"]
    assert evaluation.log is None
    counts = evaluation.sample.action_counts
    assert counts.sum() == 6 * 4 * (scenes.seconds - 1)
    _, ppo_frames = frames_of(driven, scenes, held_out)
    _, base_frames = frames_of(replace(driven, method=Method.base), scenes, held_out)
    assert (ppo_frames.speed[-1] > base_frames.speed[-1]).mean() > 0.9
    found = estimates(evaluation.rows, held_out, driven.eval)
    ppo, base = (evaluation.row(name).values["h"] for name in ("ppo", "base"))
    assert found["ppo", "h"].less_base == pytest.approx((ppo - base).mean())
    rows = summary_rows(evaluation, found)
    assert rows[0]["h_less_base"] == pytest.approx((ppo - base).mean())
    assert "trigger_rate" not in rows[0]
    document = documented(evaluation, found)
    notes = document.sections[0].notes
    assert any(note.startswith("weights ppo_default.eqx") and "faster" in note for note in notes)
    assert any(note.startswith("ppo less base") for note in notes)
    figures = draw(driven, evaluation)
    assert figures["actions_by_speed"].startswith(b"\x89PNG")
    assert set(figures) <= set(document.captions)


def test_actions_are_counted_by_the_speed_before_them():
    actions = np.array([[[3]], [[1]], [[4]], [[-1]]])
    speed = np.array([[[6.0]], [[50.0]], [[20.0]], [[7.0]]])
    counts = count_actions(actions, speed, np.array([5.0, 10.0, 20.5, 32.0]))
    expected = np.zeros((5, 3), int)
    expected[1, 0] = 1  # IDLE after 6 m/s
    expected[4, 2] = 1  # SLOWER after 50 m/s, in the outermost bin
    np.testing.assert_array_equal(counts, expected)


def test_weights_are_part_of_what_was_read(driven, tmp_path):
    assert inputs_id(replace(driven, method=Method.base)) == data_id(driven.data)
    assert inputs_id(driven).startswith(data_id(driven.data) + ", weights-")
    missing = replace(driven, ppo=PpoPolicyConfig(weights=str(tmp_path / "none.eqx")))
    with pytest.raises(FileNotFoundError, match="rearl train ppo"):
        inputs_id(missing)
