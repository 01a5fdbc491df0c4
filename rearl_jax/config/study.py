"""Configuration of the studies of the paper's tables and figures."""

from dataclasses import dataclass

from rearl_jax.config._key import key


@dataclass(unsafe_hash=True)
class Table1Config:
    """Rows of the comparison of methods"""

    rows: tuple[str, ...] | None = key(
        None, "names of the rows, e.g. [base,matcher_rank,idle]; null = all, without a language model unless llm=true"
    )
    llm: bool = key(False, "add the rows with a language model, see decision.server")
    llm_interval: int = key(10, "time between two detections where a language model decides [s]; own choice for a CPU")
    llm_runs: int = key(1, "runs of these rows, each one rollout that is scored on all scenes; own choice for a CPU")
    kept_in: str | None = key(
        None,
        "study whose finished rows are reused if their configuration is the same, e.g. study_table1; null = this study",
    )

    def check(self) -> None:
        """Raise ValueError for a value outside its range."""
        for name in ("llm_interval", "llm_runs"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        if self.rows is not None and (not self.rows or len(set(self.rows)) != len(self.rows)):
            raise ValueError(f"rows must name each row once, got [{', '.join(self.rows)}]")


@dataclass(unsafe_hash=True)
class Table4Config:
    """Inference time with a language model"""

    llm: bool = key(False, "also measure decision steps with a language model, see decision.server")
    llm_batches: tuple[int, ...] = key(
        (1,), "scenarios at a time with a language model; a CPU needs seconds per decision"
    )
    llm_repetitions: int = key(1, "measurements with a language model, after a warm-up")

    def check(self) -> None:
        """Raise ValueError for a value outside its range."""
        if not self.llm_batches or min(self.llm_batches) < 1 or len(set(self.llm_batches)) != len(self.llm_batches):
            raise ValueError(f"llm_batches must be different positive numbers, got {list(self.llm_batches)}")
        if self.llm_repetitions < 1:
            raise ValueError(f"llm_repetitions must be at least 1, got {self.llm_repetitions}")
