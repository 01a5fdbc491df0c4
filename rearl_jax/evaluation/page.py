"""The page of an evaluation: its document, its figures and one scene replayed."""

from collections.abc import Mapping

import numpy as np

from rearl_jax.document.document import Document
from rearl_jax.document.html import page_of
from rearl_jax.evaluation.road import with_road
from rearl_jax.evaluation.runner import Evaluation
from rearl_jax.replay.player import player_of
from rearl_jax.replay.scenes import Replay, ReplayedScene


def render(evaluation: Evaluation, document: Document, figures: Mapping[str, bytes]) -> str:
    """The page as HTML text.

    Args:
        evaluation: The evaluation.
        document: Its document.
        figures: PNG files by name.
    """
    player, data_id = player_of(example_replay(evaluation)), evaluation.scenes.data_id
    return page_of(document, evaluation.config, figures, data_id=data_id, player=player)


def example_replay(evaluation: Evaluation) -> Replay:
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
    return Replay(with_road(config, evaluation.scenes), evaluation.scenes, (scene,), origin)
