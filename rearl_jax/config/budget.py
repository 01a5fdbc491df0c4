"""The task of the error budget, and its keys.

Base is traffic from highway-env's start with the drivers of the keys `driver` and `mobil`.
"""

from dataclasses import dataclass

from rearl_jax.config import EvaluateTask
from rearl_jax.config._key import group_key, key, study_key
from rearl_jax.config.core import InitConfig, InitialSource
from rearl_jax.config.discover import DiscoverConfig
from rearl_jax.config.evaluation import Method, SeedScope, Variant
from rearl_jax.config.paper_start import drawn_start
from rearl_jax.config.scenes import BoundarySource, Direction, ScenesConfig, SpeedNorm
from rearl_jax.problems import InvalidInputError, Problem, out_of_range

START, BOUNDARY, CALIBRATED, FOUND = "start", "boundary", "calibrated", "found"
LANE_CHANGES, VARIATION, REARL = "lane_changes", "variation", "rearl"

COMPONENTS = (START, BOUNDARY, CALIBRATED, FOUND, LANE_CHANGES, VARIATION, REARL)
"""Names of all components, in the order in which they are added to Base."""

NEEDS = {BOUNDARY: START, FOUND: CALIBRATED, LANE_CHANGES: CALIBRATED, VARIATION: CALIBRATED}
"""Component that another component requires. Replayed surrounding vehicles require recorded initial states. Effects,
lane changes and fluctuations require the calibrated drivers, because they were estimated together.
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
        "without model: calibrate the drivers on the recordings outside the evaluated scenes; false: leave them out",
    )

    def check(self) -> None:
        """Raise InvalidInputError for an unknown or repeated component, or one whose required component is missing."""
        if not self.components or len(set(self.components)) != len(self.components):
            named = f"[{', '.join(self.components)}]"
            raise out_of_range("components", "must name each component once, and at least one", named)
        for number, name in enumerate(self.components):
            if name not in COMPONENTS:
                raise out_of_range("components", f"must be some of {', '.join(COMPONENTS)}", name)
            if name in NEEDS and NEEDS[name] not in self.components[:number]:
                message = f"must name {NEEDS[name]} before {name}, which needs it"
                raise InvalidInputError(Problem("component-missing", message, key="components", value=name))


def _measured_scenes() -> ScenesConfig:
    """Scenes of one carriageway each; all recorded vehicles that are not simulated are replayed."""
    return ScenesConfig(direction=Direction.per_direction, boundary=BoundarySource.measured)


@dataclass(unsafe_hash=True)
class StudyBudgetTask(EvaluateTask):
    """Error budget of simulated scenes."""

    study: str = study_key("study_budget")
    method: Method = key(Method.base, "base; each row of the budget sets its own method")
    variant: Variant = key(Variant.all, "all; the rows switch the parts of model=FILE on and off")
    scenes: ScenesConfig = group_key(ScenesConfig, _measured_scenes)
    init: InitConfig = group_key(InitConfig, drawn_start)
    budget: BudgetConfig = group_key(BudgetConfig)
    discover: DiscoverConfig = group_key(DiscoverConfig)

    def check(self) -> None:
        """Raise InvalidInputError for keys whose values follow from the rows, or that do not fit recorded positions."""
        fixed = {"method": Method.base, "variant": Variant.all, "init.source": InitialSource.seed}
        given = {"method": self.method, "variant": self.variant, "init.source": self.init.source}
        for name, usual in fixed.items():
            if given[name] is not usual:
                message = "is set by the rows: leave it out, and choose components with budget.components=[...]"
                raise InvalidInputError(Problem("set-by-task", message, key=name, value=given[name].name))
        if self.speed.norm is not SpeedNorm.none:
            message = "must be none: rescaled speeds do not fit recorded positions"
            raise out_of_range("speed.norm", message, self.speed.norm.name)
        if self.eval.seed_scope is not SeedScope.run_x_scene:
            message = "must be run_x_scene: every rollout starts from its own scene"
            raise out_of_range("eval.seed_scope", message, self.eval.seed_scope.name)
        if self.decision.policy.is_outside:
            message = "must be a policy inside the compiled program, such as matcher or idle"
            raise out_of_range("decision.policy", message, self.decision.policy.name)
