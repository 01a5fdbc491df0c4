"""`rearl study fig7`: percentiles of the values written, compared with the paper's."""

import json

import pandas as pd
import pytest


@pytest.fixture(scope="module")
def study(tmp_path_factory, rearl, quick):
    root = tmp_path_factory.mktemp("results")
    return root / "study_fig7", rearl(root, "study", "fig7", *quick)


def test_percentiles_are_those_of_the_values(study):
    folder, printed = study
    values = pd.read_parquet(folder / "base_values.parquet")
    h, mape = (values.loc[values["cue"] == cue, "value"].astype(float) for cue in ("h", "mape"))
    table = pd.read_parquet(folder / "fig7.parquet").set_index(["row", "metric"])
    assert table.loc[("30 %", "h"), "ours"] == pytest.approx(h.quantile(0.3), abs=1e-6)
    assert table.loc[("5 %", "mape"), "ours"] == pytest.approx(mape.quantile(0.05), abs=1e-6)
    assert table.loc[("30 %", "h_legacy"), "ours"] == pytest.approx(0.3849 * h.quantile(0.3), rel=1e-3)
    assert table.loc[("30 %", "h_legacy"), "paper"] == 0.3306
    assert table.loc[("5 %", "mape"), "paper"] == 0.1982
    assert pd.isna(table.loc[("30 %", "h"), "paper"])
    assert f"{len(h):,} Hellinger distances" in " ".join(printed.split())


def test_counts_stand_beside_the_papers(study):
    folder, printed = study
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["n_values_h"] == 56 * summary["n_scenes"]
    assert summary["n_values_mape"] == 60 * summary["n_scenes"]
    assert (summary["n_values_h_paper"], summary["n_values_mape_paper"]) == (42_000, 45_000)
    assert "42,000" in printed
    assert summary["h_legacy_p30_paper"] == 0.3306
    assert {"fig7.png", "page.html", "config.json", "fig7.parquet"} <= {path.name for path in folder.iterdir()}
