"""Bayesian optimisation of k, l and the number of iterations on a sample of the tracks.

The grid is finite, so every proposal is the exact optimum over all untested cells. Each round depends only on the
rounds before it, which are in the trace; a search resumed from its trace therefore ends like an uninterrupted one.
"""

import hashlib
import json
import logging
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float, Float32, Int

from rearl_jax.clustering.kl import Centres, Curves, iterates
from rearl_jax.config._schema import as_plain
from rearl_jax.config.clustering import BoConfig, KlConfig
from rearl_jax.results import Study, read_metadata

log = logging.getLogger(__name__)

TRACE = "bo_trace"
"""Name of the trace in the study's folder."""

ACQUISITIONS = ("ei", "pi", "lcb")
"""Expected improvement, probability of improvement, lower confidence bound (of the negative objective)."""

_MARGIN, _KAPPA, _ETA = 0.01, 1.96, 1.0
"""Margin of improvement, width of the bound and learning rate of GP-Hedge, on standardised objectives [-]. Source:
defaults of scikit-optimize's gp_minimize.
"""

_REFIT_INTERVAL = 25
"""Rounds between two fits of the kernel, after twice as many rounds; before, it is fitted every round."""

_FULL_PENALTY_VERTICES = 24
"""Number of vertices for which the penalty is `bo.penalty`."""


@dataclass(frozen=True)
class Evaluation:
    """One row of the trace.

    Attributes:
        round: Number of the round, from 0.
        k, l, iterations: Tested parameters.
        silhouette: Mean simplified silhouette.
        objective: Silhouette minus the penalty for vertices; largest is best.
        chosen_by: Acquisition that proposed it, or `random`.
        ei, pi, lcb: Cell each acquisition proposed; -1 in random rounds.
        gain_ei, gain_pi, gain_lcb: Sums of the model's predictions for each acquisition's earlier proposals.
    """

    round: int
    k: int
    l: int  # noqa: E741 - the name in the field
    iterations: int
    silhouette: float
    objective: float
    chosen_by: str
    ei: int = -1
    pi: int = -1
    lcb: int = -1
    gain_ei: float = 0.0
    gain_pi: float = 0.0
    gain_lcb: float = 0.0

    @property
    def cell(self) -> tuple[int, int, int]:
        return self.k, self.l, self.iterations


def search(
    curves: Float32[np.ndarray, "features points curves"],
    kl: KlConfig,
    bo: BoConfig,
    study: Study | None = None,
    data_id: str = "",
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[KlConfig, pd.DataFrame]:
    """The best parameters found, and the trace.

    Args:
        curves: All training curves.
        kl: Keys of the clustering; the search replaces `k`, `l` and `iterations`.
        bo: The grid and the budget.
        study: Folder in which the trace is stored after every evaluation and from which the search is resumed; None
            keeps the trace in memory only.
        data_id: Identity of the data; a trace of other data is not resumed.
        progress: Called with the number of evaluations and their total.
    """
    grid = np.array(list(product(bo.k, bo.l, bo.iterations)))
    n_calls = min(bo.n_calls, len(grid))
    metadata = {"search": _identity(kl, bo, data_id)}
    trace = [] if study is None else _earlier_trace(study.path / f"{TRACE}.parquet", metadata["search"])[:n_calls]
    objective = Objective(curves, kl, bo)
    while len(trace) < n_calls:
        trace.append(_next(trace, grid, bo, objective))
        progress(len(trace), n_calls)
        if study is not None:
            study.write_table(TRACE, _table(trace), **metadata)
    best = max(trace, key=lambda row: row.objective)
    log.info("best of %d evaluations: k = %d, l = %d, iterations = %d", len(trace), *best.cell)
    return with_cell(kl, best.cell), _table(trace)


class Objective:
    """Simplified silhouette on a sample of the tracks, minus a small penalty for vertices.

    mean((b - a) / max(a, b)) with a and b the distances of a curve to the nearest and the second nearest centre.

    Source: Hruschka, de Castro & Campello, ICDM 2004, simplified silhouette; REARL does not state its objective.
    """

    def __init__(self, curves: Float32[np.ndarray, "features points curves"], kl: KlConfig, bo: BoConfig) -> None:
        n_curves = curves.shape[2]
        # A share of few tracks may be too small for the largest k.
        size = min(n_curves, max(round(bo.share * n_curves), 10 * max(bo.k)))
        chosen = np.random.default_rng([bo.seed, 0]).choice(n_curves, size, replace=False)
        self._kl, self._penalty, self._max_iterations = kl, bo.penalty, max(bo.iterations)
        largest = with_cell(kl, (max(bo.k), max(bo.l), self._max_iterations))
        self._curves = Curves(curves[:, :, np.sort(chosen)], largest)
        self._runs: dict[tuple[int, int], list[Centres]] = {}

    def __call__(self, k: int, l: int, iterations: int) -> tuple[float, float]:  # noqa: E741
        """Silhouette and objective."""
        if (k, l) not in self._runs:
            # A run with fewer iterations is the beginning of a run with more.
            self._runs[k, l] = list(iterates(self._curves, with_cell(self._kl, (k, l, self._max_iterations))))
        best = min(self._runs[k, l][: iterations + 1], key=lambda centres: centres.cost)
        silhouette = simplified_silhouette(best.distances)
        return silhouette, silhouette - self._penalty * l / _FULL_PENALTY_VERTICES


def simplified_silhouette(distances: Float32[np.ndarray, "centres curves"]) -> float:
    """mean((b - a) / max(a, b)); 0 for a curve equally near to two centres."""
    nearest, second = np.sort(distances.astype(np.float64), axis=0)[:2]
    return float(np.mean(np.where(second > 0, (second - nearest) / np.where(second > 0, second, 1), 0)))


def with_cell(kl: KlConfig, cell: tuple[int, int, int]) -> KlConfig:
    """The configuration with k, l and iterations of a cell, and at least as many points and samples as these need."""
    k, l, iterations = cell  # noqa: E741
    return replace(
        kl, k=k, l=l, iterations=iterations, centre_points=max(kl.centre_points, l), sample=max(kl.sample, k)
    )


def _next(trace: list[Evaluation], grid: Int[np.ndarray, "cells 3"], bo: BoConfig, objective: Objective) -> Evaluation:
    """One more evaluation."""
    rng = np.random.default_rng([bo.seed, 1, len(trace)])
    index = {tuple(cell): i for i, cell in enumerate(grid.tolist())}
    tested = np.array([index[row.cell] for row in trace], dtype=np.int64)
    untested = np.setdiff1d(np.arange(len(grid)), tested)
    if len(trace) < bo.n_initial:
        cell = int(rng.choice(untested))
        extra: dict[str, Any] = {"chosen_by": "random"}
    else:
        cell, extra = _proposed(trace, grid, tested, untested, rng)
    k, l, iterations = (int(value) for value in grid[cell])  # noqa: E741
    silhouette, value = objective(k, l, iterations)
    return Evaluation(len(trace), k, l, iterations, silhouette, value, **extra)


def _proposed(
    trace: list[Evaluation],
    grid: Int[np.ndarray, "cells 3"],
    tested: Int[np.ndarray, " rounds"],
    untested: Int[np.ndarray, " rest"],
    rng: np.random.Generator,
) -> tuple[int, dict[str, Any]]:
    """The next cell by GP-Hedge, and what the trace keeps of the choice.

    GP-Hedge draws one of the acquisitions, the more likely the better a Gaussian process rates its earlier proposals.

    Source: Hoffman, Brochu & de Freitas, Portfolio allocation for Bayesian optimization, UAI 2011.
    """
    from scipy.stats import norm

    mean, deviation, best = _posterior(grid, tested, np.array([row.objective for row in trace]))
    last = trace[-1]
    gains = np.array([last.gain_ei, last.gain_pi, last.gain_lcb])
    if last.chosen_by != "random":
        # The last proposal of each acquisition is judged by the model that includes the last outcome.
        gains = gains + mean[[last.ei, last.pi, last.lcb]]
    mean, deviation = mean[untested], deviation[untested]
    improvement = mean - best - _MARGIN
    z = improvement / deviation
    scores = (improvement * norm.cdf(z) + deviation * norm.pdf(z), norm.cdf(z), mean + _KAPPA * deviation)
    proposals = [int(untested[np.argmax(score)]) for score in scores]
    weight = np.exp(_ETA * (gains - gains.max()))
    choice = int(rng.choice(len(ACQUISITIONS), p=weight / weight.sum()))
    record: dict[str, Any] = dict(zip(ACQUISITIONS, proposals, strict=True))
    record |= {f"gain_{name}": float(gain) for name, gain in zip(ACQUISITIONS, gains, strict=True)}
    return proposals[choice], {"chosen_by": ACQUISITIONS[choice], **record}


def _posterior(
    grid: Int[np.ndarray, "cells 3"], tested: Int[np.ndarray, " rounds"], objective: Float[np.ndarray, " rounds"]
) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean and standard deviation of the standardised objective on the whole grid, and the best value tested."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import Matern, WhiteKernel

    unit_grid = (grid - grid.min(axis=0)) / np.maximum(np.ptp(grid, axis=0), 1)
    spread = objective.std()
    values = (objective - objective.mean()) / (spread if spread > 0 else 1.0)
    n_fit = len(tested) if len(tested) < 2 * _REFIT_INTERVAL else len(tested) - len(tested) % _REFIT_INTERVAL
    # scikit-learn states no types; pyright takes those of the defaults.
    matern = Matern(np.full(3, 0.5), (0.05, 20.0), nu=2.5)  # pyright: ignore[reportArgumentType]
    kernel = matern + WhiteKernel(1e-2, (1e-6, 1.0))
    with warnings.catch_warnings():
        # A length scale at its bound is a valid result: the objective hardly depends on that key.
        warnings.filterwarnings("ignore", message=".*(close to the specified|lbfgs failed to converge).*")
        fitted = GaussianProcessRegressor(kernel, random_state=0).fit(unit_grid[tested[:n_fit]], values[:n_fit])
        model = GaussianProcessRegressor(fitted.kernel_, optimizer=None)  # pyright: ignore[reportArgumentType]
        model.fit(unit_grid[tested], values)
        mean, deviation = model.predict(unit_grid, return_std=True)
    return mean, np.maximum(deviation, 1e-9), float(values.max())


def _identity(kl: KlConfig, bo: BoConfig, data_id: str) -> str:
    """Text that is equal for searches that may resume each other's traces: all but the number of calls is the same."""
    keys = {"kl": as_plain(kl), "bo": {**as_plain(bo), "n_calls": None}, "data": data_id}
    return hashlib.sha256(json.dumps(keys, sort_keys=True).encode()).hexdigest()[:16]


def _earlier_trace(path: Path, identity: str) -> list[Evaluation]:
    """The evaluations of an earlier search; none, with a warning, if the file is damaged or of another search."""
    if not path.exists():
        return []
    try:
        if read_metadata(path).get("search") != identity:
            log.warning("%s is the trace of another search: the search starts again", path)
            return []
        rows = pd.read_parquet(path).to_dict("records")
        return [Evaluation(**{str(name): value for name, value in row.items()}) for row in rows]
    except (OSError, ValueError, TypeError) as error:  # pyarrow's errors are ValueErrors
        log.warning("%s cannot be read (%s): the search starts again", path, error)
        return []


def _table(trace: list[Evaluation]) -> pd.DataFrame:
    return pd.DataFrame([asdict(row) for row in trace])
