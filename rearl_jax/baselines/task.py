"""The task `rearl train ppo`: trains a policy on the traffic model, without recordings.

Writes into the study folder `curve.parquet` (one row per update), `curve.png`, `weights.eqx` (for `rearl evaluate
method=ppo ppo.weights=FILE`), `config.json` and, last of all, `summary.json`. An interrupted training continues from
`checkpoint.eqx`.
"""

from rearl_jax.baselines.document import document_of
from rearl_jax.baselines.training import CHECKPOINT, Training, curve_table, train
from rearl_jax.baselines.weights import weights_file
from rearl_jax.config import TrainPpoTask
from rearl_jax.decision.situation import ACTION_NAMES
from rearl_jax.document.terminal import print_document
from rearl_jax.progress import progress_bar, shown
from rearl_jax.results import Study
from rearl_jax.runtime import set_precision

WEIGHTS = "weights.eqx"
"""The trained policy."""


def run(config: TrainPpoTask) -> dict:
    """The summary: figures of the last update, and the speed of the training.

    Raises:
        InvalidInputError: The weights have become infinite.
    """
    set_precision(config.core.dtype)
    study = Study(config.results.root, config.study, config, "train ppo")
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return stored
    with progress_bar() as bar:
        training = train(config, study, shown(bar, "updates"))
    batch = config.ppo.batch(config.core.n_vehicles)
    curve = curve_table(training, batch)
    study.write_table("curve", curve, seeds=f"ppo.seed={config.ppo.seed}")
    weights = study.write_bytes(WEIGHTS, weights_file(training.network, config))
    summary = _summary(training, curve, batch)
    print_document(document_of(config, curve, summary, str(weights)))

    # Imported after the table is printed, because matplotlib is slow to import.
    from rearl_jax.baselines.figure import draw_curve

    study.write_bytes("curve.png", draw_curve(curve))
    study.write_summary(summary)
    (study.path / CHECKPOINT).unlink(missing_ok=True)
    return summary


def _summary(training: Training, curve, batch: int) -> dict[str, int | float | None]:
    """Flat keys: figures of the first and the last update, and the speed of the training in this process."""
    first, last = curve.iloc[0], curve.iloc[-1]
    n_trained = len(curve) - training.n_before
    return {
        "updates": len(curve),
        "car_steps": len(curve) * batch,
        "return_first": float(first["return"]),
        "return_last": float(last["return"]),
        "crashed_first": float(first["crashed"]),
        "crashed_last": float(last["crashed"]),
        "speed_last": float(last["speed"]),
        **{f"{name}_last": float(last[name]) for name in ACTION_NAMES},
        "compile_s": round(training.compile_s, 3),
        "seconds": round(training.seconds, 3),
        "car_steps_per_s": n_trained * batch / training.seconds if n_trained else None,
    }
