"""Keys of the study of the error budget."""

from dataclasses import dataclass

from rearl_jax.config._key import key
from rearl_jax.problems import InvalidInputError, Problem, out_of_range

START, BOUNDARY, CALIBRATED, FOUND = "start", "boundary", "calibrated", "found"
LANE_CHANGES, VARIATION, REARL = "lane_changes", "variation", "rearl"

COMPONENTS = (START, BOUNDARY, CALIBRATED, FOUND, LANE_CHANGES, VARIATION, REARL)
"""Names of all components, in the stated order."""

NEEDS = {BOUNDARY: START, FOUND: CALIBRATED, LANE_CHANGES: CALIBRATED, VARIATION: CALIBRATED}
"""Component without which another one cannot be: recorded vehicles drive around recorded ones, and effects, lane
changes and fluctuations were estimated together with the calibrated drivers.
"""


@dataclass(unsafe_hash=True)
class BudgetConfig:
    """Components that are added to Base"""

    components: tuple[str, ...] = key(
        COMPONENTS,
        f"components in the stated order: some of {', '.join(COMPONENTS)}; those that the recordings or the model do "
        "not have are left out and named",
    )
    calibrate: bool = key(
        True,
        "without model: calibrate the drivers on the recordings outside the judged scenes; false: leave them out",
    )

    def check(self) -> None:
        """Raise InvalidInputError for an unknown component, one that is named twice, or one that lacks another."""
        if not self.components or len(set(self.components)) != len(self.components):
            named = f"[{', '.join(self.components)}]"
            raise out_of_range("components", "must name each component once, and at least one", named)
        for number, name in enumerate(self.components):
            if name not in COMPONENTS:
                raise out_of_range("components", f"must be some of {', '.join(COMPONENTS)}", name)
            if name in NEEDS and NEEDS[name] not in self.components[:number]:
                message = f"must name {NEEDS[name]} before {name}, which needs it"
                raise InvalidInputError(Problem("component-missing", message, key="components", value=name))
