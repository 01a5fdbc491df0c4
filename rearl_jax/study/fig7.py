"""The task `rearl study fig7`: the errors of base and their percentiles, in the form of the paper's Fig. 7.

Writes `base_values.parquet` (one row per value), `fig7.parquet` (one row per percentile and error), `fig7.png`,
`page.html`, `config.json` and, last of all, `summary.json`.
"""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from rearl_jax.config import StudyFig7Task
from rearl_jax.data.scenes.splits import split_scenes
from rearl_jax.document.document import Section
from rearl_jax.evaluation.inputs import read_inputs
from rearl_jax.evaluation.percentiles import BaseValues
from rearl_jax.evaluation.traffic import inputs_id
from rearl_jax.metrics.histograms import legacy_scale
from rearl_jax.progress import progress_bar, shown
from rearl_jax.runtime import set_precision
from rearl_jax.study import differences
from rearl_jax.study.document import Form, beside_paper, long_table, publish, remarks_on
from rearl_jax.study.parts import begin
from rearl_jax.study.published import N_THRESHOLD_SCENES, N_VALUES_H, N_VALUES_MAPE, THRESHOLDS_H, THRESHOLDS_MAPE
from rearl_jax.sweep.base_values import kept_base_values

_CAPTION = (
    "Cumulative distributions of the errors of base; dots: the percentiles that become thresholds. Diamonds: the "
    "paper's thresholds, those of the Hellinger distance divided by the factor that they probably contain."
)


def _sections(config: StudyFig7Task, table: pd.DataFrame, summary: Mapping[str, Any]) -> tuple[Section, ...]:
    headings = {"h": "H", "h_legacy": "H legacy", "mape": f"MAPE {config.mape.definition.name}"}
    title = "Fig. 7, percentiles of base, ours and the paper's"
    percentiles = beside_paper(title, table, headings, dict.fromkeys(headings, 4))
    return (Section("Percentiles of base", tables=(percentiles,)),)


FORM = Form("fig7", "Errors of base, compared with Fig. 7 of the paper", _sections, {"fig7": _CAPTION})


def run(config: StudyFig7Task) -> dict:
    """The summary, as in summary.json.

    Raises:
        FileNotFoundError, ValueError: There are no recordings, a recording is invalid, or too few scenes can be cut
            from them.
    """
    set_precision(config.core.dtype)
    study = begin("study fig7", config, inputs_id(config))
    with progress_bar() as bar:
        inputs = read_inputs(config, study, bar, with_references=False)
        scenes, subset = inputs.scenes, split_scenes(inputs.scenes, config.split).threshold
        metadata = {"seeds": config.seeds}
        metadata |= {"scenes_id": scenes.data_id, "mape": config.mape.definition.name}
        base = kept_base_values(config, study, scenes, subset, metadata, shown(bar, "base"))
    records = percentile_records(config, base)
    differing = (
        *differences.of_data(config, scenes),
        *differences.of_subset(len(subset), N_THRESHOLD_SCENES, "threshold scenes", config.eval.n_runs),
        *differences.of_model(config, scenes),
        *differences.of_errors(config),
    )
    summary: dict[str, Any] = {
        "n_scenes": len(subset),
        "n_values_h": len(base.h),
        "n_values_h_paper": N_VALUES_H,
        "n_values_mape": len(base.mape),
        "n_values_mape_paper": N_VALUES_MAPE,
        "mape": config.mape.definition.name,
    }
    for record in records:
        key = f"{record['metric']}_p{record['percentile']:g}"
        summary |= {key: record["ours"], f"{key}_paper": record["paper"]}
    use = f"{len(subset)} of them behind the percentiles"

    def draw() -> dict[str, bytes]:
        from rearl_jax.sweep.figures import cumulative

        scale = legacy_scale(config.hist)
        published = ({percentile: value / scale for percentile, value in THRESHOLDS_H.items()}, THRESHOLDS_MAPE)
        return {"fig7": cumulative(base, config, published, generated=scenes.generated)}

    publish(
        study,
        FORM,
        config,
        scenes,
        long_table(records),
        summary,
        remarks_on(config, scenes, use, _findings(config, base), differing),
        draw,
        **metadata,
    )
    return summary


def percentile_records(config: StudyFig7Task, base: BaseValues) -> list[dict[str, Any]]:
    """`row`, `percentile` [%], `metric`, `ours`, `paper`, `n_values`; h_legacy is h on the paper's probable scale."""
    scale = legacy_scale(config.hist)
    records: list[dict[str, Any]] = []
    for percentile in config.sweep.h_pct:
        keys = {"row": f"{percentile:g} %", "percentile": percentile, "n_values": len(base.h)}
        value = base.threshold_h(percentile)
        records.append(keys | {"metric": "h", "ours": value, "paper": None})
        records.append(keys | {"metric": "h_legacy", "ours": scale * value, "paper": THRESHOLDS_H.get(percentile)})
    for percentile in config.sweep.m_pct:
        keys = {"row": f"{percentile:g} %", "percentile": percentile, "n_values": len(base.mape)}
        value = base.threshold_m(percentile)
        records.append(keys | {"metric": "mape", "ours": value, "paper": THRESHOLDS_MAPE.get(percentile)})
    return records


def _findings(config: StudyFig7Task, base: BaseValues) -> list[str]:
    n_runs, window = config.eval.n_runs, config.hist.window
    sentences = [
        f"{len(base.scene)} threshold scenes x {n_runs} runs give {len(base.h):,} Hellinger distances (windows of "
        f"{window} s) and {len(base.mape):,} spacing errors; the paper has {N_VALUES_H:,} and {N_VALUES_MAPE:,}."
    ]
    ours = [base.threshold_m(percentile) for percentile in THRESHOLDS_MAPE]
    theirs = list(THRESHOLDS_MAPE.values())
    sentences.append(
        f"Spread of the spacing error, 10 % by 5 % percentile: ours {ours[1] / ours[0]:.2f}, the paper's "
        f"{theirs[1] / theirs[0]:.2f}; the ratio depends on the definition of the error and on the data."
    )
    return sentences
