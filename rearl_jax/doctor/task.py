"""The task `rearl doctor`: one line per check on standard output; writes nothing.

JAX is queried in a process of its own, so that this task works even if JAX does not.
"""

from collections import Counter
from pathlib import Path
from typing import Any

from rich.text import Text

from rearl_jax.config import DoctorTask
from rearl_jax.console import standard_output
from rearl_jax.doctor.check import Check, Status
from rearl_jax.doctor.folders import cache_checks, results_checks
from rearl_jax.doctor.machine import machine_checks
from rearl_jax.doctor.programs import program_checks
from rearl_jax.doctor.recordings import recording_checks, shipped_checks

_STYLES = {Status.ok: "green", Status.warn: "yellow", Status.fail: "bold red"}


def run(config: DoctorTask) -> dict[str, Any]:
    """`n_ok`, `n_warn`, `n_fail`, and `checks`: a list of objects with `name`, `status`, `found` and `remedy`."""
    machine = machine_checks()
    has_jax = all(check.status is not Status.fail for check in machine)
    checks = [
        *machine,
        *(_cache_checks() if has_jax else ()),
        *results_checks(Path(config.results.root)),
        *recording_checks(config.data),
        *shipped_checks(),
        *(_server_checks(config) if has_jax else ()),
        *program_checks(),
    ]
    _print(checks)
    counts = Counter(check.status for check in checks)
    return {
        **{f"n_{status.value}": counts[status] for status in Status},
        "checks": [
            {"name": check.name, "status": check.status.value, "found": check.found, "remedy": check.remedy}
            for check in checks
        ],
    }


def _cache_checks() -> list[Check]:
    # Imported here, because the module imports JAX.
    from rearl_jax.runtime import cache_folder

    return cache_checks(cache_folder().parent)


def _server_checks(config: DoctorTask) -> list[Check]:
    # Imported here, because the module imports JAX.
    from rearl_jax.doctor.server import server_checks

    return server_checks(config.decision, config.llm)


def _print(checks: list[Check]) -> None:
    console = standard_output(120)
    width = max(len(check.name) for check in checks)
    for check in checks:
        line = Text.assemble(
            (f"{check.status.value:<4}", _STYLES[check.status]), f"  {check.name:<{width}}  {check.found}"
        )
        console.print(line, soft_wrap=True)
        if check.remedy:
            console.print(Text(f"{'':6}{'':{width}}  -> {check.remedy}"), soft_wrap=True)
    counts = Counter(check.status.value for check in checks)
    console.print(", ".join(f"{counts[status.value]} {status.value}" for status in Status), highlight=False)
