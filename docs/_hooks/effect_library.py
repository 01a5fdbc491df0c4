"""Sections of the effect library: equations, parameters and sources as stated in the code."""

from inspect import getdoc

from rearl_jax.core.effects import EFFECTS, VARIABLES
from rearl_jax.core.effects.effect import Effect, Parameter
from rearl_jax.discovery.lane_changes.candidates import CANDIDATES
from rearl_jax.discovery.observe.candidates import CURVES, NAMED, PLACED, TIME_GAP_CURVES, TWINS

KINDS = {
    "driver": "Drivers",
    "road": "Road and weather",
    "lane_change": "Lane choice",
    "random": "Randomness",
    "generic": "Unnamed effects",
}
"""Headings of the kinds of effects, in the order of the page."""


def effects() -> str:
    """Every effect, by kind."""
    assert {effect.kind for effect in EFFECTS.values()} == set(KINDS)
    blocks = []
    for kind, heading in KINDS.items():
        blocks.append(f"## {heading}")
        blocks += [_effect(effect) for effect in EFFECTS.values() if effect.kind == kind]
    return "\n\n".join(blocks)


def curves() -> str:
    """Variables of the free curves."""
    rows = [
        f"| `{name}` | {unit} | {_mark(name in CURVES)} | {_mark(name in TIME_GAP_CURVES)} |"
        for name, (unit, _) in VARIABLES.items()
    ]
    return "\n".join(["| variable | unit | acceleration | time gap |", "|---|---|---|---|", *rows])


def _effect(effect: type[Effect]) -> str:
    # getdoc would give the docstring of the base to an effect that has none.
    summary = (effect.__doc__ or "").partition("\n")[0] or (getdoc(effect) or "")
    head = "| parameter | unit | meaning | off or usual | bounds |\n|---|---|---|---|---|"
    rows = [_row(parameter) for parameter in effect.parameters]
    equation = f"```text\n{effect.equation}\n```"
    return "\n\n".join(
        [
            f"### `{effect.name}`",
            summary,
            equation,
            "\n".join([head, *rows]),
            f"{_looked_for(effect)} Source: {effect.source}.",
        ]
    )


def _row(parameter: Parameter) -> str:
    name = f"`{parameter.name}`" + (" *" if parameter.is_strength else "")
    bounds = f"{parameter.low:g} to {parameter.high:g}"
    return f"| {name} | {parameter.unit} | {parameter.meaning} | {parameter.off:g} | {bounds} |"


def _looked_for(effect: type[Effect]) -> str:
    """Treatment of an effect by discovery."""
    name = effect.name
    twins = {twin: effect_name for effect_name, others in TWINS.items() for twin in others}
    if name in NAMED:
        return "Discovery searches for it."
    if name in PLACED:
        return f"Discovery finds it through a curve over {PLACED[name]} and then fits its section."
    if name in twins:
        return f"Trajectories cannot distinguish it from `{twins[name]}`; discovery lists it beside that effect."
    if name in {candidate.name for candidate in CANDIDATES}:
        return "Discovery searches for it in lane changes by choice."
    if effect.kind == "generic":
        return "Discovery uses it as a curve if no named effect explains as much."
    return "Only for simulation: discovery does not search for it."


def _mark(holds: bool) -> str:
    return "yes" if holds else ""
