"""An earlier benchmark beside a new one: did we become slower beside a program that stayed as it is?

Times of different runs cannot be compared, as the machine is never as busy as before. A ratio to a program measured in
turn with ours can.
"""

import json
import re
from dataclasses import dataclass
from pathlib import Path

from rearl_jax.bench.spread import Spread
from rearl_jax.config.bench import Peer

HOW = "make one with `rearl bench core study=NAME` and name its summary.json, bench.against=FILE"


@dataclass(frozen=True)
class Change:
    """Our speed by that of the reference program, then and now, at one number of vehicles.

    Attributes:
        n_vehicles: Vehicles per scenario.
        then: The ratio in the earlier benchmark.
        now: The ratio now.
        margin: Share of it that may be lost.
    """

    n_vehicles: int
    then: Spread
    now: Spread
    margin: float

    @property
    def factor(self) -> Spread:
        """Ratio now by ratio then; the range holds every pair of repetitions."""
        return Spread(
            self.now.median / self.then.median,
            self.now.least / self.then.greatest,
            self.now.greatest / self.then.least,
        )

    @property
    def is_slower(self) -> bool:
        """Whether more than the margin was lost, and no repetition reached what was usual then."""
        return self.factor.median < 1 - self.margin and self.now.greatest < self.then.median


def read_ratios(file: str, reference: Peer) -> dict[int, Spread]:
    """Our speed by that of the reference program in an earlier benchmark, by number of vehicles.

    Args:
        file: Its summary.json, or the folder that holds it.
        reference: The program.

    Raises:
        FileNotFoundError: There is none.
        ValueError: It is no summary of `rearl bench core`, or the reference program was absent.
    """
    path = Path(file) / "summary.json" if Path(file).is_dir() else Path(file)
    if not path.is_file():
        raise FileNotFoundError(f"bench.against: there is no {path}; {HOW}")
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"bench.against: {path} is no JSON; {HOW}") from error
    if not isinstance(found, dict) or found.get("task") != "bench core":
        raise ValueError(f"bench.against: {path} was not written by `rearl bench core`; {HOW}")
    numbers = [int(key[1]) for name in found if (key := re.fullmatch(rf"ratio_to_{reference.name}_n(\d+)", name))]
    if not numbers:
        raise ValueError(f"bench.against: {path} has no ratio to {reference.name}; choose another bench.reference")
    names = {n: f"ratio_to_{reference.name}_n{n}" for n in numbers}
    return {n: Spread(*(float(found[name + end]) for end in ("", "_min", "_max"))) for n, name in names.items()}
