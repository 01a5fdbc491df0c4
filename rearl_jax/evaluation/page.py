"""The scene that the page of an evaluation replays."""

import numpy as np

from rearl_jax.document.html import Player
from rearl_jax.evaluation.runner import Evaluation
from rearl_jax.evaluation.traffic import with_road
from rearl_jax.replay.player import player_of
from rearl_jax.replay.scenes import Replay, ReplayedScene


def example_player(evaluation: Evaluation) -> Player:
    """Replay of the scene in the space-time diagram, without marks, because the simulation only counts decisions."""
    config, sample, method = evaluation.config, evaluation.sample, evaluation.method
    (pair, *_) = np.flatnonzero((method.scene == sample.example) & (method.run == 0))
    scene = ReplayedScene(
        sample.example, 0, sample.frames, sample.lengths, float(method.values["h"][pair]), (), sample.around
    )
    offer = "replays more scenes"
    if evaluation.log is not None:
        offer += " and marks the vehicles for which decisions were taken, which are not marked here"
    origin = (
        f"Simulated with {method.title}, eval.seed={config.eval.seed}, run 0 of {config.eval.n_runs} (from 0). The "
        f"command rearl report study={config.study} {offer}."
    )
    return player_of(Replay(with_road(config, evaluation.scenes), evaluation.scenes, (scene,), origin))
