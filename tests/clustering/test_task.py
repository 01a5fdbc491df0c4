"""`rearl cluster` from end to end: what it writes and prints."""

import contextlib
import io
import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rearl_jax.clustering.figures import track_figure
from rearl_jax.clustering.tables import embedding
from rearl_jax.clustering.task import run
from rearl_jax.config import clustering
from rearl_jax.config.clustering import BoConfig
from rearl_jax.results import read_metadata
from tests.refusal import refused

FILES = ["bo_trace.parquet", "centres.parquet", "config.json", "page.html", "references.parquet"]
FILES += ["scene_clusters.parquet", "scenes.png", "search.png", "summary.json", "tracks.parquet", "tracks.png"]


@pytest.fixture(scope="module")
def done(task_config, tmp_path_factory):
    """Configuration, folder, summary and printed text of `rearl cluster bo.enabled=true`, and its cache."""
    root, cache = tmp_path_factory.mktemp("results"), tmp_path_factory.mktemp("cache")
    bo = BoConfig(enabled=True, n_calls=4, n_initial=3, share=0.3, k=(3, 4), l=(5, 8), iterations=(1, 2))
    config = replace(task_config, bo=bo, results=replace(task_config.results, root=str(root)))
    printed = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
        patch.setenv("XDG_CACHE_HOME", str(cache))
        summary = run(config)
    return config, root / "cluster", summary, printed.getvalue(), cache


def test_folder_tables_and_summary(done, traffic, monkeypatch):
    config, folder, summary, printed, cache = done
    scenes, tracks, splits = traffic
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)
    tables = {path.stem: pd.read_parquet(path) for path in folder.glob("*.parquet")}
    for name, table in tables.items():
        assert read_metadata(folder / f"{name}.parquet")["generated"] == "true"
        assert np.isfinite(table.select_dtypes("number").to_numpy(np.float64, na_value=0.0)).all()
    k, n_vertices = summary["k"], summary["l"]
    assert (k, n_vertices) in {(3, 5), (3, 8), (4, 5), (4, 8)}
    assert len(tables["tracks"]) == len(tracks) == summary["n_tracks"]
    assert len(tables["centres"]) == k * n_vertices
    assert len(tables["bo_trace"]) == summary["search_rounds"] == 4
    by_scene = tables["scene_clusters"]
    np.testing.assert_allclose(by_scene[[f"share_{label}" for label in range(k)]].sum(axis=1), 1.0)
    chosen = by_scene[by_scene["is_representative"]]
    assert set(chosen["split"]) <= {"rest", "threshold"}
    assert by_scene[["tsne_x", "tsne_y"]].std().min() > 0.1
    references = tables["references"]
    assert set(references["scene_id"]) == set(chosen["scene_id"])
    assert len(references) == len(chosen) * 8 * 5
    one = references[references["reference"] == 0].pivot(index="second", columns="slot", values="scaled_speed")
    scene = int(references.loc[0, "scene_id"])
    np.testing.assert_allclose(one.to_numpy(), scenes.scaled_speed[scene], rtol=1e-6)
    assert json.loads((folder / "summary.json").read_text())["n_leaked"] == 0
    assert printed.count("GENERATED") == 3
    assert "search of 4 rounds" in printed

    # A second run takes everything from disk, the trace too, and ends with the same files.
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    (folder / "bo_trace.parquet").unlink()
    assert run(config) == summary
    after = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert before.keys() == after.keys()
    same = [name for name in before if before[name] == after[name]]
    assert set(before) - set(same) <= {"bo_trace.parquet"}
    pd.testing.assert_frame_equal(pd.read_parquet(folder / "bo_trace.parquet"), tables["bo_trace"])


def test_figures_are_pictures_and_generated_data_are_marked(done, clustered):
    import matplotlib.image

    folder = done[1]
    for path in folder.glob("*.png"):
        picture = matplotlib.image.imread(path)
        assert min(picture.shape[:2]) >= 500
        assert picture[..., :3].std() > 0.05  # not empty
    assert track_figure(clustered.tracks, generated=True) != track_figure(clustered.tracks, generated=False)


def test_few_scenes_need_no_map():
    assert (embedding(np.tile(np.eye(3), (4, 1)), 0) == 0).all()


@pytest.mark.parametrize(
    ("record", "key", "value"),
    [
        ("KlConfig", "l", 1),
        ("KlConfig", "k", 0),
        ("KlConfig", "centre_points", 5),
        ("KlConfig", "sample", 2),
        ("KlConfig", "weights", (1.0, 0.0, 1.0)),
        ("ClusterConfig", "n_clusters", 0),
        ("ClusterConfig", "seed", -1),
        ("BoConfig", "k", (1, 2)),
        ("BoConfig", "iterations", ()),
        ("BoConfig", "share", 0.0),
        ("BoConfig", "n_calls", 0),
    ],
)
def test_configuration_out_of_range(record, key, value):
    getattr(clustering, record)().check()
    with refused("out-of-range", key=key):
        replace(getattr(clustering, record)(), **{key: value}).check()
