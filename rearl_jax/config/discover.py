"""Keys of discovery, the search for effects that a calibrated car-following model lacks."""

from dataclasses import dataclass

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_least
from rearl_jax.config.driver import MODELS
from rearl_jax.problems import out_of_range


@dataclass(unsafe_hash=True)
class DiscoverConfig:
    """Search for missing effects in measured trajectories."""

    seed: int = key(
        0, "seed of the split of drivers, of the drives simulated by the calibrated model and of the resampling"
    )
    replicates: int = key(
        30,
        "simulations of all drives by the calibrated model, in which no effect is missing; the evidence of candidates "
        "is compared with them; with fewer than 20 its threshold is uncertain",
    )
    max_drivers: int = key(
        240,
        "largest number of drivers, drawn at random from those who follow long enough, of each group if "
        "discover.by names a label; more drivers reveal weaker effects",
    )
    confidence: float = key(0.9, "confidence level of all intervals [-]")
    draws: int = key(1000, "bootstrap resamples of drivers for the intervals of errors")
    by: str | None = key(
        None,
        "label by which drivers are grouped, each group with its own verdict: one of the format (openacc: model, "
        "acc, setting; fhwa: leader, person), a further column of a canonical table that is constant per track, or "
        "recording, vehicle_class, direction, lane; auto: kinds of drivers are found without labels",
    )
    same: str | None = key(
        None,
        "label that identifies the same driver or car in different tracks and recordings; null: the label of the "
        "format (openacc: model, fhwa: person), none for other formats",
    )
    base: tuple[str, ...] | None = key(
        None,
        "car-following models compared with that of driver, which is kept unless another one predicts drivers outside "
        f"the fit significantly better: some of {', '.join(MODELS)}; null: all of them if driver is left out, "
        "else none; []: none. Nothing is compared with discover.oracle",
    )
    lane_changes: bool = key(
        True,
        "include early response to the next leader, and relaxation after a change of leader, in the calibrated model "
        "if at least ten leaders change",
    )
    page: bool = key(
        True, "also write page, figures, maps and residuals; false: only verdict, model and tables, for many data sets"
    )
    oracle: str | None = key(
        None,
        "name of a known effect of generated data: it is fitted without a search, and its error is reported as that of "
        "an oracle",
    )

    def check(self) -> None:
        check_least(self, 0, "seed")
        check_least(self, 2, "replicates")
        if self.max_drivers < 9:
            raise out_of_range("max_drivers", "must be at least 9, three for each part of the data", self.max_drivers)
        if not 0.5 <= self.confidence < 1.0:
            raise out_of_range("confidence", "must be within 0.5 and 1", self.confidence)
        check_least(self, 100, "draws")
        for name in self.base or ():
            if name not in MODELS:
                raise out_of_range("base", f"must be some of {', '.join(MODELS)}", name)
        if self.base is not None and len(set(self.base)) < len(self.base):
            raise out_of_range("base", "must name each model once", list(self.base))
        if self.by is not None and self.oracle is not None:
            raise out_of_range("by", "must be null if discover.oracle names the missing effect", self.by)
