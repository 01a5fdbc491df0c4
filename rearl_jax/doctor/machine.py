"""Checks of Python, JAX and its devices, cores and memory."""

import json
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from rearl_jax.code_version import __version__
from rearl_jax.doctor.check import Check, fail, ok, warn
from rearl_jax.machine import PLATFORM_VARIABLES, available_cores, load_average, total_memory

PYTHONS = ((3, 11), (3, 13))
"""First and last minor version of Python that is supported."""

_PATIENCE = 120.0
"""Longest time JAX may take to find its devices [s]."""

_PROBE = """
import json, jax, jaxlib
devices = jax.devices()
print(json.dumps({
    "jax": jax.__version__, "jaxlib": jaxlib.__version__, "platform": devices[0].platform, "n": len(devices),
    "kind": devices[0].device_kind, "sum": float(jax.numpy.ones(4).sum()),
}))
"""

_GIB = 2**30
_LITTLE_MEMORY = 4 * _GIB
"""Free memory [bytes] that may not suffice: default tasks need 1 GiB, discovery on a large data set 3.3 GiB."""


def machine_checks() -> list[Check]:
    """Checks of the machine and the interpreter."""
    return [_python(), *_jax(), _cores(), _memory()]


def _python() -> Check:
    line = f"rearl_jax {__version__}, Python {platform.python_version()}, {platform.system()} {platform.machine()}"
    if PYTHONS[0] <= sys.version_info[:2] <= PYTHONS[1]:
        return ok("python", line)
    versions = " to ".join(".".join(map(str, version)) for version in PYTHONS)
    return fail("python", line, f"install Python {versions} and the package in it")


def _jax() -> list[Check]:
    """Checks of JAX and its devices, in a process of their own, because a driver may crash or hang."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROBE], capture_output=True, text=True, timeout=_PATIENCE, check=False
        )
    except subprocess.TimeoutExpired:
        remedy = "another process may hold the accelerator; JAX_PLATFORMS=cpu works without it"
        return [fail("jax", f"no answer within {_PATIENCE:g} s", remedy)]
    try:
        answer: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    except (IndexError, ValueError):
        message = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        if chosen := " ".join(f"{name}={os.environ[name]}" for name in PLATFORM_VARIABLES if os.environ.get(name)):
            return [fail("jax", f"cannot be started with {chosen} ({message})", "unset it, or set it to cpu")]
        return [
            fail("jax", message, "pip install --force-reinstall jax jaxlib, or JAX_PLATFORMS=cpu without accelerator")
        ]
    versions = f"jax {answer['jax']}, jaxlib {answer['jaxlib']}"
    checks = [ok("jax", versions)]
    if answer["sum"] != 4.0:
        return [
            fail("jax", f"{versions} cannot add: 1 + 1 + 1 + 1 = {answer['sum']}", "install jaxlib for this processor")
        ]
    devices = f"{answer['n']} x {answer['kind']} ({answer['platform']})"
    if answer["platform"] == "cpu" and _has_nvidia() and not os.environ.get("JAX_PLATFORMS"):
        remedy = "pip install 'jax[cuda13]' (or cuda12, as the driver is), if JAX is to use it"
        return [*checks, warn("devices", f"{devices}; there is an NVIDIA GPU that JAX does not use", remedy)]
    return [*checks, ok("devices", devices)]


def _has_nvidia() -> bool:
    return Path("/dev/nvidia0").exists() or shutil.which("nvidia-smi") is not None


def _cores() -> Check:
    n_cores, load = available_cores(), load_average() or 0.0
    cores = f"{n_cores} for this process, load {load:.1f}"
    if load > 1.5 * n_cores:
        return warn("cores", cores, "other programs use the cores, so measured speeds will be too low")
    return ok("cores", cores)


def _memory() -> Check:
    total, free = _memory_bytes()
    if total is None:
        return ok("memory", "not reported by this system")
    memory = f"{total / _GIB:.1f} GiB" + ("" if free is None else f", {free / _GIB:.1f} GiB of it free")
    if (total if free is None else free) < _LITTLE_MEMORY:
        return warn("memory", memory, "close other programs, or ask for fewer rollouts at a time (eval.n_runs)")
    return ok("memory", memory)


def _memory_bytes() -> tuple[int | None, int | None]:
    """Total memory, and the memory available to new programs; None if the system does not report them."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except OSError:
        return total_memory(), None
    values = {name: int(rest.split()[0]) * 1024 for name, _, rest in (line.partition(":") for line in lines)}
    return values.get("MemTotal"), values.get("MemAvailable")
