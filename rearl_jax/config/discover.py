"""Keys of discovery: what the traffic model lacks, found in measured trajectories."""

from dataclasses import dataclass

from rearl_jax.config._key import key
from rearl_jax.problems import out_of_range


@dataclass(unsafe_hash=True)
class DiscoverConfig:
    """Closing the loop with measured data."""

    seed: int = key(0, "of the split of drivers, the simulated nulls and the resampling")
    replicates: int = key(
        30,
        "drives simulated again without any missing effect, against which evidence is measured; fewer than 20 "
        "make the threshold itself uncertain",
    )
    max_drivers: int = key(
        240, "drivers used at most, drawn at random from those who follow long enough; more take longer and see more"
    )
    confidence: float = key(0.9, "of all intervals [-]")
    draws: int = key(1000, "resamples of drivers for the intervals of errors")
    page: bool = key(
        True, "write page, figures, maps and residuals too; false: verdict, model and tables only, for many data sets"
    )
    oracle: str | None = key(
        None,
        "name of an effect whose error is reported as that of an oracle, nothing else is looked for; for generated "
        "data whose effect is known",
    )

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        if self.replicates < 2:
            raise out_of_range("replicates", "must be at least 2", self.replicates)
        if self.max_drivers < 9:
            raise out_of_range("max_drivers", "must be at least 9, three for each part of the data", self.max_drivers)
        if not 0.5 <= self.confidence < 1.0:
            raise out_of_range("confidence", "must be within 0.5 and 1", self.confidence)
        if self.draws < 100:
            raise out_of_range("draws", "must be at least 100", self.draws)
