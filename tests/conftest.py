"""Strict JAX for every test. The package itself must not be imported here: the shape check of the
jaxtyping plugin hooks into the import, and would come too late."""

import os
from pathlib import Path

os.environ.setdefault("JAX_PLATFORMS", "cpu")

# Most of the time of the tests is compiling, and what they compile runs a few times: compiled in this way, the largest
# programs take half of that time and run at half the speed at worst. Flags that are set already have priority.
os.environ["XLA_FLAGS"] = (
    f"--xla_backend_optimization_level=1 --xla_cpu_use_fusion_emitters=false {os.environ.get('XLA_FLAGS', '')}"
)

import jax
import numpy as np
import pytest

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")

WHOLE_FOLDERS = ("evaluation", "validation", "blind", "decision", "clustering", "environments", "study")
"""Folders whose files share a costly fixture. `--dist loadfile` gives each to one worker, which makes it once; they are
given out first, in this order, and the folders of `LONG` after them, so that no long file is left for the end."""
LONG = ("docs", "core", "discovery", "sweep", "baselines", "llm", "report")

LONG_FILE_OF_SINGLE_TESTS = "tests/docs/test_followed.py"
"""A file whose tests share nothing and take minutes each: they are given out one by one."""

COMPILED = Path(__file__).parents[1] / ".pytest_cache" / "compiled"
"""Folder of compiled programs, kept for other tests and the next run: most of the time of a test is compiling."""
MAPPED = Path("/proc/self/maps")
MOST_MAPPED = 32_000
"""Memory mappings of a process from which on compiled programs are given up: half of what Linux allows it by default
(`vm.max_map_count`, 65,530)."""


if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
    jax.config.update("jax_compilation_cache_dir", str(COMPILED))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)


def pytest_collection_modifyitems(items):
    """Sorts the tests by folder, the longest first."""
    order = [*WHOLE_FOLDERS, *LONG]
    root = Path(__file__).parent

    def place(item):
        folder = item.path.relative_to(root).parts[0] if item.path.is_relative_to(root) else ""
        return order.index(folder) if folder in order else len(order)

    items.sort(key=place)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """The scheduler of `--dist loadfile`, for which each of `WHOLE_FOLDERS` is one file."""
    from xdist.scheduler import LoadFileScheduling

    if config.getvalue("dist") != "loadfile":
        return None

    class LoadFolderOrFile(LoadFileScheduling):
        def _split_scope(self, nodeid):
            folder = nodeid.split("/")[1]
            if nodeid.startswith(LONG_FILE_OF_SINGLE_TESTS):
                return nodeid
            return folder if folder in WHOLE_FOLDERS else super()._split_scope(nodeid)

    config.option.loadscopereorder = False  # which would put files with few tests, the long ones, last
    return LoadFolderOrFile(config, log)


@pytest.fixture(autouse=True, scope="module")
def give_up_compiled_programs():
    """Give up compiled programs before there are too many.

    Each takes dozens of memory mappings, and XLA ends the process with a segmentation fault once the system grants no
    more of them.
    """
    yield
    if MAPPED.exists() and MAPPED.read_bytes().count(b"\n") > MOST_MAPPED:
        jax.clear_caches()


@pytest.fixture(scope="session")
def wild():
    """Vehicles anywhere and anyhow: off their lanes, turned, some crashed, some absent, some far away."""
    from rearl_jax.core.model import TrafficModel
    from rearl_jax.core.state import Controller, make_state

    rng = np.random.default_rng(5)
    shape = (10, 12)
    return make_state(
        rng.uniform(100.0, 500.0, shape),
        rng.uniform(-3.0, 15.0, shape),
        rng.uniform(0.0, 40.0, shape),
        TrafficModel(),
        heading=rng.uniform(-0.5, 0.5, shape),
        target_lane=rng.integers(0, 4, shape),
        controller=np.where(rng.random(shape) < 0.2, Controller.ABSENT, Controller.META),
        crashed=rng.random(shape) < 0.2,
        dtype=np.float64,
    )
