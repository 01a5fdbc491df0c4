"""Scenes kept on disk between runs: recordings are read once per machine for the same files and configuration."""

import logging

from rearl_jax.cache import kept_path
from rearl_jax.config.data import DataConfig
from rearl_jax.data.recordings import data_id, file_stamps, is_generated
from rearl_jax.data.scenes.scene_files import load_scenes, save_scenes
from rearl_jax.data.scenes.scene_set import SceneSet
from rearl_jax.data.scenes.scene_windows import SceneKeys, cutting_keys
from rearl_jax.results import Study

log = logging.getLogger(__name__)

_SOURCES = ("config", "data")
"""Parts of the package whose code decides what scenes are cut."""


class SceneCache:
    """The file with the scenes of one data set under one configuration."""

    def __init__(self, data: DataConfig, keys: SceneKeys) -> None:
        """Determines the path, which differs for modified recordings and for other code."""
        self._data_id, self._generated = data_id(data), is_generated(data)
        self._keys = cutting_keys(keys)
        decisive = {**self._keys, "data": self._data_id, "files": file_stamps(data)}
        self.path = kept_path("scenes", decisive, _SOURCES, ".parquet")

    def read(self) -> SceneSet | None:
        """The scenes; None if they were never stored or, with a warning, if the file is damaged."""
        if not self.path.is_file():
            return None
        try:
            return load_scenes(self.path)
        except (OSError, ValueError, KeyError) as error:  # pyarrow's errors are among the first two
            log.warning("%s is damaged (%s): the scenes are cut again", self.path, error)
            return None

    def write(self, scenes: SceneSet) -> None:
        """Stores the scenes; if the folder is not writable, the next run cuts them again."""
        try:
            root, name = self.path.parent.parent, self.path.parent.name
            study = Study(root, name, self._keys, "prepare", self._data_id, generated=self._generated)
            save_scenes(scenes, study, self.path.stem)
        except OSError as error:
            log.warning("the scenes are not stored for the next run: %s; set XDG_CACHE_HOME to another folder", error)
