"""Configuration of the studies of the paper's tables and figures."""

from dataclasses import dataclass

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_finite, check_least, check_positive, check_rising
from rearl_jax.problems import out_of_range


@dataclass(unsafe_hash=True)
class Table1Config:
    """Rows of the comparison of methods"""

    rows: tuple[str, ...] | None = key(
        None, "names of the rows, e.g. [base,matcher_rank,idle]; null = all, without a language model unless llm=true"
    )
    llm: bool = key(False, "add the rows with a language model, see decision.server")
    llm_interval: int = key(
        10, "time between two detections with a language model [s]; not REARL's 1 s, for speed on a CPU"
    )
    llm_runs: int = key(1, "runs of these rows, each one rollout scored on all scenes; one, for speed on a CPU")
    traffic: bool = key(
        False,
        "add REARL on improved traffic that starts as recorded: Base, Base among recorded vehicles, calibrated drivers "
        "(those of model=FILE, or as in `rearl study budget`), calibrated drivers among recorded vehicles; each "
        "without corrections, with idle and with the matcher",
    )
    kept_in: str | None = key(
        None,
        "study whose finished rows are reused if their configuration is the same, e.g. study_table1; null = this study",
    )

    def check(self) -> None:
        check_least(self, 1, "llm_interval", "llm_runs")
        if self.rows is not None and (not self.rows or len(set(self.rows)) != len(self.rows)):
            raise out_of_range("rows", "must name each row once", f"[{', '.join(self.rows)}]")


@dataclass(unsafe_hash=True)
class Table4Config:
    """Inference time with a language model"""

    llm: bool = key(False, "also measure decision steps with a language model, see decision.server")
    llm_batches: tuple[int, ...] = key(
        (1,), "scenarios at a time with a language model; a CPU needs seconds per decision"
    )
    llm_repetitions: int = key(1, "measurements with a language model, after a warm-up")

    def check(self) -> None:
        if not self.llm_batches or min(self.llm_batches) < 1 or len(set(self.llm_batches)) != len(self.llm_batches):
            raise out_of_range("llm_batches", "must be different positive numbers", list(self.llm_batches))
        check_least(self, 1, "llm_repetitions")


@dataclass(unsafe_hash=True)
class StepsConfig:
    """Timed consecutive decision steps"""

    density: float = key(2.0, "vehicles_density of the initial scenes [-]; highway-env, REARL (Bi et al.)")
    seed: int = key(0, "seed of initial scenes and references; every repetition draws new scenes")
    n_references: int = key(15, "synthetic references that the traffic is compared with; REARL (Bi et al.)")
    reference_seconds: int = key(60, "length of the references [s]; REARL (Bi et al.)")
    reference_vehicles: int = key(10, "vehicles of a reference; REARL (Bi et al.)")
    steps: int = key(10, "consecutive decision steps that are timed; REARL (Bi et al.)")
    steps_vehicles: int = key(10, "vehicles per scenario of these steps; REARL (Bi et al.)")
    steps_batches: tuple[int, ...] = key((1, 256), "scenarios at a time in these steps; empty: not measured")
    steps_repetitions: int = key(20, "measurements of these steps")

    def check(self) -> None:
        if self.steps_batches:
            check_rising(self, "steps_batches")
        check_least(self, 1, "n_references", "steps", "steps_repetitions")
        check_least(self, 2, "reference_vehicles", "steps_vehicles")
        check_positive(self, "density")
        check_finite(self, "density")
        check_least(self, 0, "seed")
        if self.reference_seconds < self.steps:
            raise out_of_range("reference_seconds", f"must be at least steps ({self.steps})", self.reference_seconds)
