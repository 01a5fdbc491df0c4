"""Checks of required packages, optional packages of the extras, and programs besides Python."""

import re
import shutil
from importlib.metadata import PackageNotFoundError, distributions, requires

from rearl_jax.doctor.check import Check, fail, ok, warn

_USES = {
    "test": "the checks of the code (make test)",
    "bench": "SUMO in `python -m benchmarks core` and `rearl discover blind`",
    "sumo": "the comparison with SUMO in `rearl export`",
    "openscenario": "`rearl export to=openscenario`",
    "llm": "decision.server=local",
    "joblib": "hydra/launcher=joblib",
    "ray": "hydra/launcher=ray",
    "submitit": "hydra/launcher=submitit_slurm",
    "docs": "the documentation (make docs)",
    "gymnax": "gymnax's wrappers around the functional environment",
}
"""Purpose of each extra."""

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


def program_checks() -> list[Check]:
    """Checks of packages and programs."""
    try:
        wanted = _requirements()
    except PackageNotFoundError:
        return [fail("packages", "rearl_jax is not installed, it is imported from its folder", "pip install -e .")]
    missing = _missing(wanted.pop("", []))
    if missing:
        packages = fail("packages", f"missing: {', '.join(missing)}", f"pip install {' '.join(missing)}")
    else:
        packages = ok("packages", "everything rearl_jax needs is installed")
    return [packages, *(_extra(name, names) for name, names in wanted.items()), _browser()]


def _requirements() -> dict[str, list[str]]:
    """Names of the packages this one needs, by extra; the empty name has those always needed."""
    names: dict[str, list[str]] = {"": []}
    for line in requires("rearl-jax") or []:
        needed = re.match(r"[A-Za-z0-9._-]+", line)
        extra = re.search(r"""extra\s*==\s*["']([^"']+)["']""", line)
        if needed is not None:
            names.setdefault(extra[1] if extra else "", []).append(needed[0])
    return names


def _missing(names: list[str]) -> list[str]:
    return [name for name in names if not any(distributions(name=name))]


def _extra(name: str, packages: list[str]) -> Check:
    use = f"for {_USES.get(name, 'some tasks')}"
    missing = _missing(packages)
    if missing:
        state = f"not installed, {use} (missing: {', '.join(missing)})"
        return warn(f"extra {name}", state, f"pip install 'rearl_jax[{name}]', if you need it")
    return ok(f"extra {name}", f"installed, {use}")


def _browser() -> Check:
    browser = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if browser is None:
        remedy = "apt-get install chromium (Debian), if the pages are to be tested"
        return warn("browser", "no Chromium; only tests of the pages need it", remedy)
    return ok("browser", browser)
