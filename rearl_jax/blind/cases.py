"""The data sets of a blind study: hidden effects, strengths and repetitions, declared before any random draw."""

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase

import numpy as np

from rearl_jax.blind.sumo import EFFECTS
from rearl_jax.blind.traffic.catalogue import LANE_CHOICE, LISTED, UNLISTED
from rearl_jax.blind.traffic.drawing import SUMO_BASES
from rearl_jax.blind.traffic.measurement import ARTEFACTS
from rearl_jax.blind.traffic.models import BASES
from rearl_jax.blind.traffic.scenario import FREE_CHANGES, Planted, Scenario
from rearl_jax.config.blind import BlindConfig, StudyPriors, StudySize
from rearl_jax.problems import out_of_range

FOUR_TIMES = {"n_vehicles": 78, "duration": 120.0, "lane_changes": 48}
"""Four times the driver-seconds of the default: twice the drivers for twice as long."""

CONTROLS: Mapping[str, Mapping[str, int | float]] = {
    "default": {},
    "coloured_noise": {"noise_time": 0.3},
    "mixed_drivers": {"spread": 1.5},
    "dense": {"pace": 0.55, "spacing": 0.9},
    "sparse": {"pace": 1.1, "spacing": 1.5},
    "restless_drivers": {"driver_noise": 0.3},
    "long": {"duration": 180.0, "lane_changes": 36},
    "short": {"n_vehicles": 183, "duration": 14.0, "lane_changes": 30},
    "camera": {"n_vehicles": 150, "duration": 90.0, "lane_changes": 40, "view": 420.0, "frame_rate": 25.0},
}
"""Configurations of data sets in which nothing is hidden."""

CONFUSABLE = (
    ("grade", "speed_limit"),
    ("lane_desired_speed", "speed_limit"),
    ("speed_dependent_time_gap", "resignation"),
    ("several_leaders", "leader_acceleration"),
    ("leader_class", "leader_length"),
    ("lane_friction", "no_undertaking"),
)
"""Pairs of similar effects; a data set contains one of the two."""

CANCELLING = ("reaction_delay", "anticipation")
"""Two effects of which only the difference is observable."""

TWO = (
    ("reaction_delay", "grade"),
    ("reaction_delay", "variance_driven_time_gap"),
    ("several_leaders", "speed_limit"),
    ("leader_acceleration", "lane_friction"),
    ("speed_dependent_time_gap", "grade"),
    ("variance_driven_time_gap", "lane_friction"),
    ("resignation", "speed_limit"),
    ("relaxation", "leader_acceleration"),
    ("rear_pressure", "reaction_delay"),
    ("leader_class", "speed_limit"),
    ("asymmetry", "grade"),
    ("weather", "several_leaders"),
)
"""Pairs of effects in one data set."""

SUMO_MODELS = ("idm", "idm_no_passing_right", "idm_limit", "idm_action_steps", "eidm", "krauss", "acc", "cacc")
"""Car-following models and rules of SUMO, the second source."""

BROAD, BROAD_CONTROL = "broad", "broad_control"
"""Sets with broad priors: one effect of the library at its usual strength, and none."""

CONTROL_SHARE = 0.25
"""Share of controls among the data sets with broad priors [-]."""

REPEATS: Mapping[StudySize, Mapping[str, int]] = {
    StudySize.medium: {
        "named": 2, "artefact": 2, "control": 3, "half": 1, "half_four_times": 1, "unlisted": 1, "two": 1,
        "sumo": 1,
    },
    StudySize.full: {
        "named": 10, "artefact": 10, "control": 12, "half": 5, "half_four_times": 5, "quarter": 2, "double": 2,
        "unlisted": 5, "two": 3, "confusable": 3, "cancelling": 10, "short": 2, "lane_choice": 3,
        "lane_choice_control": 10, "sumo": 5,
    },
}  # fmt: skip
"""Data sets of each kind in each set."""


@dataclass(frozen=True)
class Case:
    """One data set.

    Attributes:
        group: The set that the data set belongs to.
        variant: The hidden effect, or the kind of control.
        planted: Effects hidden by the generator.
        changes: Fields of the scenario that differ from the default; with broad priors those that are not drawn.
        source: `traffic`, the generator of this package, `sumo`, or `broad`, one of both with broad priors.
        base: Car-following model of a data set with broad priors.
        width: Width of the broad priors [-].
        name: Name of its folder, without information on the content; empty until the study is drawn.
        seed: Seed of the data set, drawn with the study.
    """

    group: str
    variant: str
    planted: tuple[Planted, ...] = ()
    changes: Mapping[str, int | float] = field(default_factory=dict)
    source: str = "traffic"
    base: str = "idm"
    width: float = 1.0
    name: str = ""
    seed: int = 0

    @property
    def scenario(self) -> Scenario:
        """The scenario for the generator."""
        return Scenario(seed=self.seed, planted=self.planted, **self.changes)  # type: ignore[arg-type]


def list_cases(blind: BlindConfig, master_seed: int) -> list[Case]:
    """All data sets of a study in random order.

    Raises:
        ValueError: `blind.sets` selects no data set.
    """
    all_kinds = list(_broad_kinds(blind, master_seed)) if blind.priors is StudyPriors.broad else _kinds(blind.size)
    kinds = [kind for kind in all_kinds if fnmatchcase(kind.group, blind.sets)]
    kinds = [kind for kind in kinds if blind.sumo or kind.source != "sumo"]
    if not kinds:
        groups = ", ".join(dict.fromkeys(kind.group for kind in all_kinds))
        raise out_of_range("blind.sets", f"must select some of {groups}", blind.sets)
    seeds = np.random.SeedSequence(master_seed).generate_state(len(kinds) + 1)
    cases = []
    for number, (kind, seed) in enumerate(zip(kinds, seeds, strict=False)):  # the last seed is that of the order
        name = hashlib.sha256(f"{master_seed} {number}".encode()).hexdigest()[:10]
        cases.append(replace(kind, name=name, seed=int(seed)))
    return [cases[index] for index in np.random.default_rng(int(seeds[-1])).permutation(len(cases))]


def _broad_kinds(blind: BlindConfig, master_seed: int) -> Iterator[Case]:
    """All data sets with broad priors: controls, then effects of the library in equal numbers, in random order."""
    rng = np.random.default_rng([master_seed, 10])
    n_controls = max(1, round(CONTROL_SHARE * blind.n_sets))
    n_rounds = -(-(blind.n_sets - n_controls) // len(LISTED))
    effects = np.concatenate([rng.permutation(list(LISTED)) for _ in range(n_rounds)] or [[]])
    fixed = {"followers": blind.followers, "duration": blind.duration}
    changes = {name: value for name, value in fixed.items() if value is not None}
    for number in range(blind.n_sets):
        name = None if number < n_controls else str(effects[number - n_controls])
        base = str(rng.choice([*BASES, "sumo"] if blind.sumo and (name is None or name in EFFECTS) else [*BASES]))
        base = str(rng.choice(SUMO_BASES)) if base == "sumo" else base
        common = {"changes": changes, "source": "broad", "base": base, "width": blind.width}
        if name is None:
            yield Case(BROAD_CONTROL, "nothing hidden", **common)
        else:
            yield Case(BROAD, name, (Planted(name),), **common)


def _kinds(size: StudySize) -> list[Case]:
    """All data sets of a size, each kind repeated; without names and seeds."""
    if size is StudySize.small:
        kinds = (
            Case("control", "default"),
            Case("named", "reaction_delay", (Planted("reaction_delay"),)),
            Case("named", "grade", (Planted("grade"),)),
            Case("artefact", "lens", (Planted("lens"),)),
            Case("unlisted", "rain", (Planted("rain"),)),
            Case("two", "reaction_delay+grade", (Planted("reaction_delay"), Planted("grade"))),
        )
        return [replace(kind, changes={"n_recordings": 1}) for kind in kinds]
    repeats = REPEATS[size]
    return [kind for kind in _every_kind() for _ in range(repeats.get(kind.group, 0))]


def _every_kind() -> Iterator[Case]:
    """Every kind of data set once."""
    yield from _single("named", LISTED)
    yield from _single("artefact", ARTEFACTS)
    yield from (Case("control", name, (), changes) for name, changes in CONTROLS.items())
    yield from _single("half", LISTED, 0.5)
    yield from _single("half_four_times", LISTED, 0.5, FOUR_TIMES)
    yield from _single("quarter", LISTED, 0.25)
    yield from _single("double", LISTED, 2.0)
    yield from _single("unlisted", UNLISTED)
    for pair in TWO:
        yield Case("two", "+".join(pair), tuple(Planted(name) for name in pair))
    yield from _single("confusable", dict.fromkeys(name for pair in CONFUSABLE for name in pair))
    yield Case("cancelling", "+".join(CANCELLING), tuple(Planted(name) for name in CANCELLING))
    short = ("reaction_delay", "grade", "several_leaders", "variance_driven_time_gap", "leader_class", "rear_pressure")
    yield from _single("short", short, 1.0, CONTROLS["short"])
    yield from _single("lane_choice", LANE_CHOICE, 1.0, FREE_CHANGES)
    yield Case("lane_choice_control", "free_changes", (), FREE_CHANGES)
    for model in SUMO_MODELS:
        yield Case("sumo", model, source="sumo")


def _single(
    group: str, names: Iterable[str], strength: float = 1.0, changes: Mapping[str, int | float] = CONTROLS["default"]
) -> Iterator[Case]:
    """A data set for each effect, which alone is hidden in it."""
    return (Case(group, name, (Planted(name, strength),), changes) for name in names)
