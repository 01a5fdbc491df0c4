"""Rates of a blind study with broad priors by stratum: model, measurement, lane changes, size of the effect."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from rearl_jax.blind.cases import BROAD, BROAD_CONTROL
from rearl_jax.blind.questions import Judged, changes_the_model, claims_anything, error_surely_rose
from rearl_jax.blind.scores import rate_of

ALL = "all"
"""Stratum of all data sets."""

IDMS = ("idm", "highway_env_idm", "sumo_idm")
"""Car-following models that are IDM."""

LARGE_EFFECT = 0.5
"""Ratio of the effect's acceleration to the drivers' noise from which an effect is large [-]."""


def by_stratum(cases: Iterable[Judged]) -> list[dict]:
    """One row per stratum, empty without broad priors.

    Columns: `n` data sets, `n_false` with a false name; `n_effects` with a hidden effect, `n_named` in which it is
    named; `n_controls`, `n_claimed` in which an effect is named or the verdict is `improved`; `n_intervals` of
    parameters, `n_covered` that contain the truth; `n_changed` models changed by an effect, `n_rose` with a
    significantly larger error on other drivers. Each pair has its rate and the exact interval.
    """
    members: dict[str, list[Judged]] = {}
    for case in cases:
        if case.group in (BROAD, BROAD_CONTROL):
            for name in _strata(case):
                members.setdefault(name, []).append(case)
    return [{"stratum": name, **_row(members[name])} for name in sorted(members, key=_sort_key)]


def redraws(cases: Iterable[Judged]) -> dict[str, int]:
    """Number of rejected draws by reason, over all data sets."""
    counts = Counter[str]()
    for case in cases:
        counts.update(case.truth.get("redraws", {}))
    return dict(counts)


def _strata(case: Judged) -> Iterator[str]:
    truth, chain = case.truth, case.truth["scenario"]["chain"]
    yield ALL
    yield f"model {truth['base']}"
    yield "model is IDM" if truth["base"] in IDMS else "model is not IDM"
    yield "smoothed before release" if truth["is_smoothed"] else "not smoothed"
    yield "many lane changes" if truth["has_many_changes"] else "few lane changes"
    yield "speed from a sensor" if chain["speed"] == "sensor" else "speed from positions"
    yield f"lane column by {chain['lane']}"
    yield "correlated position noise" if truth["scenario"]["noise_time"] else "white position noise"
    noise = truth["scenario"]["driver_noise"]
    if truth["planted"] and noise > 0.0:
        is_large = truth["effect_size"] >= LARGE_EFFECT * noise
        yield "large effect" if is_large else "small effect"


def _sort_key(stratum: str) -> tuple[bool, str]:
    return stratum != ALL, stratum


def _row(cases: Sequence[Judged]) -> dict:
    effects = [case for case in cases if case.group == BROAD]
    controls = [case for case in cases if case.group == BROAD_CONTROL]
    changed = [case for case in cases if changes_the_model(case)]
    pairs = {
        "false": ("n", len(cases), sum(bool(case.judgement.false_names) for case in cases)),
        "named": ("n_effects", len(effects), sum(case.is_named for case in effects)),
        "claimed": ("n_controls", len(controls), sum(map(claims_anything, controls))),
        "covered": ("n_intervals", sum(case.n_intervals for case in cases), sum(case.n_covered for case in cases)),
        "rose": ("n_changed", len(changed), sum(map(error_surely_rose, changed))),
    }
    row = {}
    for name, (total, n_cases, n_hits) in pairs.items():
        row |= {total: n_cases, f"n_{name}": n_hits, **rate_of(n_hits, n_cases, (name, f"{name}_low", f"{name}_high"))}
    return row
