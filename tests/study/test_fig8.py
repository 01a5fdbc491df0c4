"""`rearl study fig8`: clusters compared with the paper's numbers."""

import json

import pandas as pd
import pytest

from rearl_jax.study.fig8_figure import draw_clusters


def test_figure_shows_the_clusters_there_are():
    scenes = pd.DataFrame(
        {"cluster": [0, 0, 1, None], "share_0": [1.0, 0.5, 0.0, 0.3], "share_1": [0.0, 0.5, 1.0, 0.7]}
    )
    png = draw_clusters(scenes.astype({"cluster": "Int64"}), 2, generated=False)
    assert png[:4] == b"\x89PNG"
    assert png != draw_clusters(scenes.astype({"cluster": "Int64"}), 2, generated=True)


@pytest.mark.slow
def test_the_command_clusters_once_and_stands_beside_the_paper(rearl, tmp_path):
    printed = rearl(tmp_path, "study", "fig8")
    assert "741" in printed
    folder = tmp_path / "study_fig8"
    own = json.loads((folder / "cluster" / "summary.json").read_text())
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["n_scenes"] == own["n_scenes"]
    assert (summary["n_scenes_paper"], summary["n_scene_clusters_paper"]) == (741, 15)
    table = pd.read_parquet(folder / "fig8.parquet").set_index(["row", "metric"])
    assert table.loc[("all", "n_scene_clusters"), "ours"] == own["n_scene_clusters"]
    assert (folder / "fig8.png").read_bytes() == (folder / "cluster" / "scenes.png").read_bytes()
    before = (folder / "cluster" / "tracks.parquet").stat().st_mtime_ns
    rearl(tmp_path, "study", "fig8")
    assert (folder / "cluster" / "tracks.parquet").stat().st_mtime_ns == before
