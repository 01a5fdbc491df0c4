"""Check of tasks that take one population of drivers, and the recordings of platoons that these tasks read."""

from rearl_jax.config.data import BadRows, DataConfig, DataFormat
from rearl_jax.config.evaluation import Variant
from rearl_jax.problems import InvalidInputError, Problem, out_of_range


def platoons() -> DataConfig:
    """Shipped recordings of platoons (OpenACC), whose first vehicles have no vehicle ahead; bad rows are dropped."""
    return DataConfig(DataFormat.openacc, on_bad=BadRows.drop_row)


def check_one_population(variant: Variant, model: str | None, reason: str, *, has_drivers: bool) -> None:
    """Raise InvalidInputError for both variants at once, with the reason why not, and for drivers given twice."""
    if variant is Variant.all:
        raise out_of_range("variant", f"must be repaired or calibrated: {reason}", variant.name)
    if model is not None and has_drivers:
        message = "has its own drivers: leave out the keys of driver, or leave out model"
        raise InvalidInputError(Problem("drivers-twice", message, key=f"model={model}"))
