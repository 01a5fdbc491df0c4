"""(k,l)-clustering of curves: k centres of at most l vertices that are near to all curves under the Frechet distance.

The first centres are simplified curves of a sample, chosen as k-medoids; then each vertex of a centre moves to the
points of member curves that are aligned to it (Frechet centring). Distances to all curves are one compiled program.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Float32, Int

from rearl_jax.clustering.continuous import continuous_distances
from rearl_jax.clustering.frechet import aligned, discrete_distances, subdivided
from rearl_jax.clustering.medoids import build, farthest_first, swap
from rearl_jax.clustering.simplify import shortcut_errors, simplified
from rearl_jax.config.clustering import CurveDistance, KlConfig, KlInit, KlUpdate
from rearl_jax.problems import out_of_range


@dataclass(frozen=True)
class Centres:
    """Centres and their distances to the curves.

    Attributes:
        vertices: Vertices of the centres.
        distances: Frechet distance of every curve to every centre.
    """

    vertices: Float[np.ndarray, "centres features vertices"]
    distances: Float32[np.ndarray, "centres curves"]

    @property
    def labels(self) -> Int[np.ndarray, " curves"]:
        """Nearest centre of every curve, the first of equally near ones."""
        return self.distances.argmin(axis=0)

    @property
    def cost(self) -> float:
        """Mean distance of the curves to their nearest centre."""
        return float(self.distances.min(axis=0).mean(dtype=np.float64))


class Curves:
    """Curves to cluster, and a sample of them whose simplifications are candidates for the first centres.

    What depends neither on k nor on l is computed once, because a search over both needs it many times.
    """

    def __init__(self, curves: Float32[np.ndarray, "features points curves"], kl: KlConfig) -> None:
        """Keeps the curves and draws the sample.

        Args:
            curves: Scaled and weighted features [-].
            kl: Distance, sample and seed. Clusters k and vertices l come with each call; k is checked here.

        Raises:
            ValueError: Fewer curves than clusters.
        """
        if curves.shape[2] < kl.k:
            message = f"must be at most the {curves.shape[2]} tracks: lower it or read more data"
            raise out_of_range("kl.k", message, kl.k)
        self.curves = np.ascontiguousarray(curves)
        self._distance, self._centre_points = kl.distance, kl.centre_points
        n_curves = curves.shape[2]
        chosen = np.random.default_rng(kl.seed).choice(n_curves, min(kl.sample, n_curves), replace=False)
        self.sample = np.ascontiguousarray(curves[:, :, np.sort(chosen)])
        self._among_sample: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def distances(
        self, centres: Float[np.ndarray, "centres features vertices"], curves: np.ndarray | None = None
    ) -> Float32[np.ndarray, "centres curves"]:
        """Distance of every curve (of all, or of those given) to every centre."""
        curves = self.curves if curves is None else curves
        if self._distance is CurveDistance.continuous:
            return continuous_distances(curves.astype(np.float64), centres).astype(np.float32)
        if self._distance is CurveDistance.discrete_resampled:
            centres = subdivided(centres, max(self._centre_points, centres.shape[2]))
        return discrete_distances(curves, centres)

    def among_sample(self, n_vertices: int) -> tuple[np.ndarray, Float32[np.ndarray, "candidates curves"]]:
        """The sample simplified to `n_vertices`, and its distances to the sample itself."""
        if n_vertices not in self._among_sample:
            candidates = simplified(self.sample, self._sample_errors, n_vertices)
            self._among_sample[n_vertices] = candidates, self.distances(candidates, self.sample)
        return self._among_sample[n_vertices]

    @cached_property
    def _sample_errors(self) -> Float[np.ndarray, "curves points points"]:
        return shortcut_errors(self.sample)


def cluster_curves(
    curves: Curves, kl: KlConfig, progress: Callable[[int, int], None] = lambda done, total: None
) -> tuple[Centres, list[float]]:
    """The best centres found, and the cost of every iterate, the first centres first.

    Args:
        curves: Curves to cluster.
        kl: Parameters.
        progress: Called with the number of iterates so far and its upper limit.

    Source: Buchin, Driemel, van de L'Isle & Nusser, klcluster: Center-based clustering of trajectories,
    SIGSPATIAL 2019.
    """
    tried = []
    for centres in iterates(curves, kl):
        tried.append(centres)
        progress(len(tried), kl.iterations + 1)
    progress(kl.iterations + 1, kl.iterations + 1)
    costs = [centres.cost for centres in tried]
    return tried[int(np.argmin(costs))], costs


def iterates(curves: Curves, kl: KlConfig) -> Iterator[Centres]:
    """First centres, then those after each update, up to `kl.iterations` or an update that does not lower the cost."""
    vertices = first_centres(curves, kl)
    centres = Centres(vertices, curves.distances(vertices))
    yield centres
    rng = np.random.default_rng([kl.seed, 1])
    for _ in range(kl.iterations):
        last_cost = centres.cost
        vertices = move_centres(curves, centres, kl, rng)
        centres = Centres(vertices, curves.distances(vertices))
        yield centres
        if not centres.cost < last_cost:
            return


def first_centres(curves: Curves, kl: KlConfig) -> Float[np.ndarray, "centres features vertices"]:
    """Simplified curves to begin with: by `kl.init` the medoids of the sample (PAM), medoids found from its farthest
    curves, or the farthest of all curves.
    """
    if kl.init is KlInit.gonzalez:
        return _gonzalez(curves, kl)
    candidates, distances = curves.among_sample(kl.l)
    start = farthest_first(distances, kl.k) if kl.init is KlInit.gonzalez_pam else build(distances, kl.k)
    return candidates[swap(distances, start)]


def _gonzalez(curves: Curves, kl: KlConfig) -> Float[np.ndarray, "centres features vertices"]:
    """A random curve simplified, then always the curve farthest from all centres so far."""
    n_curves = curves.curves.shape[2]
    chosen = int(np.random.default_rng([kl.seed, 2]).integers(n_curves))
    centres: list[np.ndarray] = []
    nearest = np.full(n_curves, np.inf, dtype=np.float32)
    for _ in range(kl.k):
        curve = curves.curves[:, :, chosen : chosen + 1]
        centres.append(simplified(curve, shortcut_errors(curve), kl.l)[0])
        nearest = np.minimum(nearest, curves.distances(centres[-1][None])[0])
        chosen = int(nearest.argmax())
    return np.stack(centres)


def move_centres(
    curves: Curves, centres: Centres, kl: KlConfig, rng: np.random.Generator
) -> Float[np.ndarray, "centres features vertices"]:
    """Centres moved to their members; a centre without members stays."""
    labels = centres.labels
    result = centres.vertices.copy()
    for label in range(len(result)):
        members = np.flatnonzero(labels == label)
        if not len(members):
            continue
        max_members = kl.sample if kl.update is KlUpdate.medoid else kl.members
        members = np.sort(rng.choice(members, min(max_members, len(members)), replace=False))
        chosen = np.ascontiguousarray(curves.curves[:, :, members])
        if kl.update is KlUpdate.medoid:
            candidates = simplified(chosen, shortcut_errors(chosen), result.shape[2])
            result[label] = candidates[curves.distances(candidates, chosen).sum(axis=1).argmin()]
        else:
            result[label] = _centred(chosen, result[label], kl)
    return result


def _centred(
    members: Float32[np.ndarray, "features points curves"], centre: Float[np.ndarray, "features vertices"], kl: KlConfig
) -> Float[np.ndarray, "features vertices"]:
    """The centre, each vertex moved to the middle of the points of members that are aligned to it."""
    members = members.astype(np.float64)
    middle = enclosing_ball if kl.update is KlUpdate.fsa else _mean
    coupled = aligned(members, centre)
    return np.stack([middle(members[:, aligned_points], kl.ball_steps) for aligned_points in coupled], axis=1)


def enclosing_ball(points: Float[np.ndarray, "features points"], steps: int) -> Float[np.ndarray, " features"]:
    """Centre of about the smallest ball around the points: from their mean, step i goes 1/(i+1) of the way to the
    farthest; the best of all steps.

    Source: Badoiu & Clarkson, Smaller core-sets for balls, SODA 2003.
    """
    centre, squared_radius = points.mean(axis=1), np.inf
    best = centre
    for step in range(1, steps + 1):
        squared = ((points - centre[:, None]) ** 2).sum(axis=0)
        farthest = int(squared.argmax())
        if squared[farthest] < squared_radius:
            best, squared_radius = centre, squared[farthest]
        centre = centre + (points[:, farthest] - centre) / (step + 1)
    return best


def _mean(points: Float[np.ndarray, "features points"], steps: int) -> Float[np.ndarray, " features"]:
    """Mean of the points; `steps` is not used, but `enclosing_ball` has it."""
    return points.mean(axis=1)
