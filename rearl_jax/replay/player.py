"""The player of replayed scenes as parts of a page."""

from jinja2 import Environment, PackageLoader, StrictUndefined

from rearl_jax.config.scenes import SpeedNorm
from rearl_jax.document.html import Player
from rearl_jax.replay.embedding import embedded, replay_data
from rearl_jax.replay.scenes import Replay

_HOW_DRAWN = (
    "Both are drawn to one scale, all driving to the right, left lane on top; in the whole stretch vehicles are "
    "enlarged and lanes widened, in the close-up both are to scale. The picture follows the traffic; between two "
    "seconds vehicles move in straight lines. Every vehicle is drawn 2 m wide. Recorded are the vehicles of the scene, "
    "those picked in each second; they appear and leave as they were picked, in the middle of their lanes, at the "
    "speeds they drove."
)


def player_of(replay: Replay) -> Player:
    """The player with its scenes, as many as the size of a page allows."""
    environment = Environment(
        loader=PackageLoader("rearl_jax.replay", ""), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    data = replay_data(replay)
    norm = replay.config.speed.norm
    is_rescaled, n_left_out = norm is not SpeedNorm.none, len(replay.replayed) - len(data["scenes"])
    sentences = [replay.origin, _HOW_DRAWN]
    if is_rescaled:
        sentences.append(
            f"Speeds are compared rescaled (speed.norm={norm.name}), so the recorded strip may move at another pace "
            "than the simulated one that resembles it."
        )
    if n_left_out:
        sentences.append(f"{n_left_out} more scenes were left out to keep the file small.")
    parts = environment.get_template("player.html.j2").make_module(
        {
            "data": embedded(data),
            "has_decisions": replay.has_decisions,
            "has_replayed": any(scene.around is not None for scene in replay.replayed),
            "is_rescaled": is_rescaled,
            "words": " ".join(sentences),
        }
    )
    return Player(**{name: vars(parts)[name] for name in ("html", "style", "script")})
