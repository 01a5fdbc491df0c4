"""Tables of the car-following models: equations, parameters, equilibrium time gaps and string stability."""

import ast
from importlib import import_module
from inspect import getsource

import jax.numpy as jnp

from rearl_jax.config.driver import DEFAULT, MODELS
from rearl_jax.config.driver.declaration import DriverModel
from rearl_jax.core.car_following import CAR_FOLLOWING
from rearl_jax.core.car_following.model import linearise
from rearl_jax.study.stability.cases import TYPICAL_DRAWN

SPEEDS = (5.0, 15.0, 25.0)
"""Speeds of the comparison [m/s]."""


def car_following() -> str:
    """Every model: source, equation, parameters."""
    return "\n\n".join(_model(model) for model in MODELS.values())


def equilibria() -> str:
    """Time gap at equilibrium and string stability of every model with its usual values."""
    head = "| `driver` | " + " | ".join(f"{speed:g} m/s" for speed in SPEEDS) + " |"
    rows = [head, "|---|" + "---|" * len(SPEEDS)]
    for name, model in CAR_FOLLOWING.items():
        declared = model.declaration.parameters
        usual = (TYPICAL_DRAWN[item.name] if item.usual is None else item.usual for item in declared)
        driver, speed = model(*(jnp.asarray(value) for value in usual)), jnp.asarray(SPEEDS)
        time_gaps = driver.equilibrium_gap(speed) / speed
        margins = linearise(driver, speed).stability_margin()
        words = ("stable" if margin >= 0 else "unstable" for margin in margins)
        cells = (f"{time_gap:.2f} s, {word}" for time_gap, word in zip(time_gaps, words, strict=True))
        rows.append(f"| `{name}` | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def _model(model: DriverModel) -> str:
    module = import_module(f"rearl_jax.core.car_following.{model.name}")
    text = ast.get_docstring(ast.parse(getsource(module))) or ""
    equation = "\n".join(line for line in text.splitlines() if line.startswith("    "))
    words = [part for part in text.split("\n\n")[1:] if not part.startswith(("    ", "Source"))]
    default = " The default." if model.name == DEFAULT else ""
    rows = ["| key | unit | meaning | usual | spread | bounds | source |", "|---|---|---|---|---|---|---|"]
    for item in model.parameters:
        usual = "null" if item.usual is None else f"{item.usual:g}"
        usual += "" if item.truck is None or item.usual is None else f" (truck {item.truck:g})"
        rows.append(
            f"| `driver.{item.name}` | {item.unit} | {item.meaning} | {usual} | {item.spread:g} "
            f"| {item.low:g} to {item.high:g} | {item.source} |"
        )
    blocks = [f"### `{model.name}`", f"{model.title}.{default}", f"```text\n{equation}\n```", *words, "\n".join(rows)]
    return "\n\n".join([*blocks, f"Source: {model.source}."])
