"""Setup of JAX, once per process: cache of compiled programs on disk, a CPU device per core, precision.

The module also describes the machine for speed measurements, without names of hosts and users.
"""

import os
import platform
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib.metadata import version
from pathlib import Path

import jax

from rearl_jax.config.core import Precision
from rearl_jax.machine import PLATFORM_VARIABLES, available_cores, total_memory
from rearl_jax.problems import InvalidInputError, Problem


def start(x64: bool = False, cpu_devices: int | None = None) -> None:
    """Configures JAX for a task; the first call must come before the first computation.

    A later call may only change the precision. Environment variables that the user has set are respected: JAX reads
    JAX_COMPILATION_CACHE_DIR, JAX_ENABLE_COMPILATION_CACHE, JAX_PERSISTENT_CACHE_* and JAX_NUM_CPU_DEVICES; XLA reads
    PJRT_NPROC and XLA_FLAGS.

    Args:
        x64: Whether arrays without a stated type are float64 and int64.
        cpu_devices: CPU devices over which a batch can be split; by default one per usable core.

    Raises:
        RuntimeError: JAX has already computed something with another number of CPU devices.
        InvalidInputError: The environment names a platform that this JAX does not have.
    """
    _set_compiler_flags(x64)
    _set_cpu_devices(available_cores() if cpu_devices is None else cpu_devices)
    _set_compilation_cache()
    jax.config.update("jax_enable_x64", x64)
    check_platform()


def set_precision(precision: Precision) -> None:
    """Switches JAX to 64-bit numbers for a simulation in float64, which JAX would otherwise turn into float32."""
    if precision is Precision.float64:
        jax.config.update("jax_enable_x64", True)


@contextmanager
def double_precision() -> Iterator[None]:
    """JAX's x64 mode for as long as it is needed, in all threads."""
    was_enabled = jax.config.read("jax_enable_x64")
    jax.config.update("jax_enable_x64", True)
    try:
        yield
    finally:
        jax.config.update("jax_enable_x64", was_enabled)


def cache_folder() -> Path:
    """The folder of compiled programs: `rearl_jax/jax` in XDG_CACHE_HOME, or in ~/.cache without it."""
    base = os.environ.get("XDG_CACHE_HOME")
    if base:
        return Path(base) / "rearl_jax" / "jax"
    try:
        home = Path.home()
    except RuntimeError:  # no HOME, and a user id without an entry, as in a container
        home = Path(tempfile.gettempdir()) / f"rearl_jax-{os.getuid()}"
    return home / ".cache" / "rearl_jax" / "jax"


def machine_line(machine: Mapping[str, str | int | float], load: float | None) -> str:
    """One line on a machine from `describe_machine`, with its load before a measurement."""
    load_text = "" if load is None else f", load {load:.1f} at the start"
    return f"{machine['cpu_model']}, {machine['cpu_cores']} cores, jax {machine['jax_version']}{load_text}"


def describe_machine() -> dict[str, str | int | float]:
    """Description of the machine for speed measurements: processor, cores, memory [GiB], accelerator, versions."""
    devices = jax.devices()
    return {
        "cpu_model": _cpu_model(),
        "cpu_cores": available_cores(),
        "memory_gib": round((total_memory() or 0) / 2**30, 1),
        "jax_backend": devices[0].platform,
        "jax_device": devices[0].device_kind,
        "jax_devices": len(devices),
        "jax_version": jax.__version__,
        "jaxlib_version": version("jaxlib"),
        "python_version": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def check_platform() -> None:
    """Raise InvalidInputError if JAX cannot compute on what the environment chooses; the check initialises JAX."""
    chosen = {name: os.environ[name] for name in PLATFORM_VARIABLES if os.environ.get(name)}
    if not chosen:
        return
    try:
        jax.devices()
    except Exception as error:  # RuntimeError, or an AssertionError of JAX
        name, value = next(iter(chosen.items()))
        why, available = " ".join(str(error).split()), _platforms()
        fault = f"is {value}, but this JAX has only {' and '.join(available)}" + (f" ({why[:300]})" if why else "")
        remedy = f"unset it or set it to {available[0]}, or install the jaxlib of that platform"
        raise InvalidInputError(Problem("platform-missing", fault, remedy, key=name)) from None


def _platforms() -> list[str]:
    """Platforms that JAX finds if nothing is chosen, the preferred one first."""
    answer = subprocess.run(
        [sys.executable, "-c", "import jax; print(jax.devices()[0].platform)"],
        env={name: value for name, value in os.environ.items() if name not in PLATFORM_VARIABLES},
        capture_output=True,
        text=True,
        check=False,
    )
    return list(dict.fromkeys([*answer.stdout.split()[-1:], "cpu"]))


@cache
def _set_compiler_flags(x64: bool) -> None:
    """Sets XLA to one thread per CPU device, because there is a device per core; in float32 also the full vector width.

    Measured on a core with AVX-512: a quarter less time per tick of ten-vehicle scenarios at 512 bits than at XLA's
    default of 256. In float64 jaxlib 0.10.2 compiles the lateral controller to NaN at that width, so there the default
    stays. XLA uses the last of several equal flags, so flags that the user has set have priority.
    """
    flags = "--xla_cpu_multi_thread_eigen=false" + ("" if x64 else " --xla_cpu_prefer_vector_width=512")
    os.environ["XLA_FLAGS"] = f"{flags} {os.environ.get('XLA_FLAGS', '')}".strip()


def _set_cpu_devices(count: int) -> None:
    """Sets the number of CPU devices of JAX, and no more threads than devices.

    With more threads than devices XLA divides every vector operation of a device among them, and they spend more time
    waiting for each other than working. Measured on 2 cores with one device, 10 vehicles, 1,200 scenarios: 52 ns of CPU
    time and 28 ns of elapsed time for a vehicle step with two threads, 27 and 26 ns with one.
    """
    chosen = "JAX_NUM_CPU_DEVICES" in os.environ
    if chosen or "xla_force_host_platform_device_count" in os.environ.get("XLA_FLAGS", ""):
        return
    if count < available_cores():
        os.environ.setdefault("PJRT_NPROC", str(count))
    try:
        jax.config.update("jax_num_cpu_devices", count)
    except RuntimeError as error:
        raise RuntimeError(
            f"JAX has already computed something, so it cannot be given {count} CPU devices any more: call "
            "rearl_jax.runtime.start() before the first computation, or set JAX_NUM_CPU_DEVICES"
        ) from error


@cache
def _set_compilation_cache() -> None:
    """Stores every compiled program, also those compiled fast: a study needs thousands of them in new processes."""
    if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
        folder = cache_folder()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if not os.access(folder, os.W_OK | os.X_OK):
                raise PermissionError(f"no permission to write to {folder}")
        except OSError as error:
            warnings.warn(
                f"compiled programs are not stored: {error}; set JAX_COMPILATION_CACHE_DIR to another folder",
                stacklevel=3,
            )
            return
        jax.config.update("jax_compilation_cache_dir", str(folder))
    if "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS" not in os.environ:
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    if "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES" not in os.environ:
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)


def _cpu_model() -> str:
    if sys.platform == "darwin":
        command = ["sysctl", "-n", "machdep.cpu.brand_string"]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    if sys.platform == "linux":
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
