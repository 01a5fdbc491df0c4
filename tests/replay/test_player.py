"""The player says no more than is known, and leaves out what makes a page too large."""

from dataclasses import replace

import pytest

from rearl_jax.replay import embedding
from rearl_jax.replay.player import player_of


@pytest.mark.parametrize("has_decisions", [False, True])
def test_marks_have_a_legend_only_where_decisions_are_known(replay, has_decisions):
    player = player_of(replace(replay, has_decisions=has_decisions))
    assert ("not followed" in player.html) == has_decisions
    assert f'"decisions":{str(has_decisions).lower()}' in player.script


def test_scenes_beyond_the_size_of_a_page_are_left_out_and_counted(replay, monkeypatch):
    monkeypatch.setattr(embedding, "MAX_CHARACTERS", 10)
    player = player_of(replay)
    assert "1 more scenes were left out" in player.html
    assert player.script.count('"recording"') == 1
