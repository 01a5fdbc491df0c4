"""A single data set: `python -m rearl_jax.blind.traffic NAME SEED STRENGTH FOLDER [KEY=VALUE ...]`.

NAME is an effect or artefact, several joined by +, or `none`. KEY is a field of Scenario; `highd=1` writes highD's
files of a camera's view. Effects on lane choice switch free lane changes on, as does free_changes=1. The truth is
printed, not written.
"""

import json
import sys
from dataclasses import fields
from pathlib import Path
from typing import Any

from rearl_jax.blind.traffic.catalogue import LANE_CHOICE
from rearl_jax.blind.traffic.dataset import write_dataset
from rearl_jax.blind.traffic.scenario import FREE_CHANGES, Planted, Scenario


def main(arguments: list[str]) -> None:
    """Writes the data set and prints what is hidden in it."""
    if len(arguments) < 4:
        sys.exit((__doc__ or "").strip())
    name, seed, strength, folder, *pairs = arguments
    planted = () if name == "none" else tuple(Planted(part, float(strength)) for part in name.split("+"))
    given = {key: value for key, _, value in (pair.partition("=") for pair in pairs)}
    as_highd = bool(int(given.pop("highd", "0")))
    given = ({"view": "420", "frame_rate": "25"} if as_highd else {}) | given
    # All numbers except the seed, which has an argument of its own.
    numbers = [item for item in fields(Scenario)[1:] if item.type in (int, bool, float, float | None)]
    types = {item.name: int if item.type in (int, bool) else float for item in numbers}
    if unknown := given.keys() - types:
        sys.exit(f"no such key: {', '.join(sorted(unknown))}; one of highd, {', '.join(types)}")
    keys: dict[str, Any] = {key: types[key](value) for key, value in given.items()}
    if keys.get("free_changes") or any(item.name in LANE_CHOICE for item in planted):
        keys = {**FREE_CHANGES} | keys
    try:
        truth = write_dataset(Path(folder), Scenario(int(seed), planted, **keys), as_highd=as_highd)
    except ValueError as error:
        sys.exit(str(error))
    print(json.dumps(truth, indent=1))


if __name__ == "__main__":
    main(sys.argv[1:])
