"""Configuration of the clusterings: tracks by shape, scenes by the tracks in them, and the search for parameters.

Defaults marked "REARL" are stated in the paper (Bi et al.).
"""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_finite, check_least, check_within
from rearl_jax.problems import out_of_range


class CurveDistance(Enum):
    """Distance between a track and a centre."""

    discrete_resampled = "discrete_resampled"
    """Discrete Frechet distance, the centre's edges subdivided to `kl.centre_points` points."""
    discrete_raw = "discrete_raw"
    """Discrete Frechet distance to the centre's vertices alone."""
    continuous = "continuous"
    """Continuous Frechet distance; slow, for small data."""


class KlInit(Enum):
    """Initial centres."""

    pam = "pam"
    """k-medoids of a sample: BUILD, then SWAP."""
    gonzalez_pam = "gonzalez_pam"
    """k-medoids of a sample: farthest-first, then SWAP."""
    gonzalez = "gonzalez"
    """Farthest-first over all tracks."""


class KlUpdate(Enum):
    """Update of a centre."""

    fsa = "fsa"
    """Moves every vertex to the centre of the smallest ball around the points aligned to it (Frechet centring)."""
    mean = "mean"
    """Moves every vertex to the mean of the points aligned to it."""
    medoid = "medoid"
    """Replaces the centre by the simplified member with the smallest mean distance to a sample of the members."""


class SceneVector(Enum):
    """Units counted in the vector of a scene, its shares of the track clusters."""

    unique_tracks = "unique_tracks"
    """Every track of the scene that belongs to a cluster, once."""
    slot_weighted = "slot_weighted"
    """Every vehicle of every snapshot, so that a track counts once per snapshot."""


class Representative(Enum):
    """Representative of a cluster of scenes."""

    medoid = "medoid"
    """The member nearest to the centroid."""
    slot_mean = "slot_mean"
    """The mean of all members, vehicle by vehicle in the order of each snapshot."""


class FitOn(Enum):
    """Scenes, with their tracks, that clusterings are fitted on."""

    not_eval = "not_eval"
    """All except evaluation and tuning scenes, and scenes that share traffic with these."""
    all = "all"
    """All."""


@dataclass(unsafe_hash=True)
class KlConfig:
    """Clustering of tracks: k centres of at most l vertices under the Frechet distance"""

    k: int = key(3, "number of clusters of tracks; REARL")
    l: int = key(12, "largest number of vertices of a centre; not stated by REARL")  # noqa: E741 - the name in the field
    iterations: int = key(3, "largest number of updates of the centres; fewer if the cost stops decreasing; REARL")
    weights: tuple[float, float, float] = key(
        (1.0, 1.0, 0.5), "weights of speed, position and distance, each scaled to 0 to 1"
    )
    distance: CurveDistance = key(
        CurveDistance.discrete_resampled,
        "Frechet distance: discrete_resampled, discrete_raw or continuous (small data)",
    )
    centre_points: int = key(48, "points of a centre for kl.distance=discrete_resampled")
    init: KlInit = key(KlInit.pam, "initial centres: pam, gonzalez_pam or gonzalez (as in klcluster)")
    update: KlUpdate = key(KlUpdate.fsa, "update of a centre: fsa = Frechet centring (REARL), mean or medoid")
    sample: int = key(300, "tracks among which the initial centres are sought")
    members: int = key(500, "members of a cluster, drawn at random, that update its centre")
    ball_steps: int = key(60, "iterations of Badoiu and Clarkson's smallest enclosing ball")
    seed: int = key(0, "seed of the samples")

    def check(self) -> None:
        check_least(self, 1, "k", "iterations", "ball_steps", "members")
        if self.l < 2:
            raise out_of_range("l", "must be at least 2 (a centre has a start and an end)", self.l)
        if self.centre_points < self.l:
            raise out_of_range("centre_points", f"must be at least l = {self.l}", self.centre_points)
        if self.sample < self.k:
            raise out_of_range("sample", f"must be at least k = {self.k}", self.sample)
        if not all(weight > 0 for weight in self.weights):
            raise out_of_range("weights", "must be > 0", ", ".join(map(str, self.weights)))
        check_finite(self, "weights")
        check_least(self, 0, "seed")


@dataclass(unsafe_hash=True)
class ClusterConfig:
    """Clustering of scenes and their representatives"""

    n_clusters: int = key(15, "number of clusters of scenes; fewer if there are fewer different scenes; REARL")
    n_init: int = key(10, "restarts of k-means")
    vector: SceneVector = key(
        SceneVector.unique_tracks,
        "shares of the track clusters in a scene: unique_tracks (each track counts once) or slot_weighted (once per "
        "snapshot)",
    )
    representative: Representative = key(Representative.medoid, "medoid: a recorded scene, or slot_mean")
    fit_on: FitOn = key(FitOn.not_eval, "not_eval: without evaluation and tuning scenes, all: with them (REARL)")
    seed: int = key(0, "seed of k-means and t-SNE")

    def check(self) -> None:
        check_least(self, 1, "n_clusters", "n_init")
        check_within(self, 0, 2**32 - 1, "seed")


@dataclass(unsafe_hash=True)
class BoConfig:
    """Bayesian optimisation of kl.k, kl.l and kl.iterations"""

    enabled: bool = key(False, "search for the best values first; false = use kl.k, kl.l and kl.iterations as given")
    n_calls: int = key(500, "largest number of evaluations; the search stops when the grid is exhausted; REARL")
    n_initial: int = key(10, "random evaluations before the first fit; default of scikit-optimize's gp_minimize")
    share: float = key(0.05, "share of the tracks that an evaluation clusters [-]; REARL")
    k: tuple[int, ...] = key((2, 3, 4, 5, 6, 7, 8), "values of kl.k to try")
    l: tuple[int, ...] = key(  # noqa: E741 - the name in the field
        (4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24), "values of kl.l to try"
    )
    iterations: tuple[int, ...] = key((1, 2, 3, 4, 5, 6), "values of kl.iterations to try")
    penalty: float = key(
        0.01, "penalty on the silhouette for a centre of 24 vertices, proportional to the vertices [-]"
    )
    seed: int = key(0, "seed of the sample of tracks and of the search")

    def check(self) -> None:
        for name, least in (("k", 2), ("l", 2), ("iterations", 1)):
            values = getattr(self, name)
            if not values or min(values) < least or len(set(values)) != len(values):
                raise out_of_range(name, f"must be different values of at least {least}", values)
        check_least(self, 1, "n_calls", "n_initial")
        if not 0 < self.share <= 1:
            raise out_of_range("share", "must be above 0 and at most 1", self.share)
        check_least(self, 0, "penalty", "seed")
        check_finite(self, "penalty")
