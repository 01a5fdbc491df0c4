"""The configuration of every task: one record per task, composed of records of key groups.

Standard library only. A key has the same name in every task that uses it; its type, default and meaning are declared
once, in the file of its group.
"""

from dataclasses import dataclass

from rearl_jax.config._key import group_key, key, study_key
from rearl_jax.config.blind import BlindConfig
from rearl_jax.config.clustering import BoConfig, ClusterConfig, KlConfig
from rearl_jax.config.core import CoreConfig, InitConfig
from rearl_jax.config.critical import CriticalConfig
from rearl_jax.config.data import DataConfig, DataFormat
from rearl_jax.config.decision import AdmissibleConfig, DecisionConfig, ExecConfig, MatcherConfig, PolicyName
from rearl_jax.config.detection import DetectionConfig, ReferenceConfig
from rearl_jax.config.discover import DiscoverConfig
from rearl_jax.config.driver import DEFAULT, MODELS, DriverConfig, record_of
from rearl_jax.config.evaluation import ONE_VARIANT_HELP, EvaluationConfig, Method, Variant
from rearl_jax.config.generator import GeneratorConfig
from rearl_jax.config.llm import LlmConfig, PromptConfig
from rearl_jax.config.metrics import HistConfig, MapeConfig, RealismConfig, SafetyConfig, ThwConfig
from rearl_jax.config.mobil import MobilConfig
from rearl_jax.config.paper_start import PaperStart, paper_road, rescaled
from rearl_jax.config.ppo import PpoConfig, PpoPolicyConfig
from rearl_jax.config.real import RealConfig
from rearl_jax.config.report import ReportConfig
from rearl_jax.config.results import FolderConfig, ResultsConfig
from rearl_jax.config.scenes import FeaturesConfig, ScenesConfig, SpacingConfig, SpeedConfig, SplitConfig, TracksConfig
from rearl_jax.config.study import StepsConfig, Table1Config, Table4Config
from rearl_jax.config.sweep import SweepConfig
from rearl_jax.config.validation import ValidationConfig
from rearl_jax.problems import InvalidInputError, Problem, out_of_range


def _first_look() -> DataConfig:
    """Recordings of a first discovery: shipped leader-follower pairs, few enough for a verdict in a minute or two."""
    return DataConfig(DataFormat.i80_slice)


@dataclass(unsafe_hash=True)
class PrepareTask:
    """Canonical tables and scenes from recordings."""

    study: str = study_key("prepare")
    results: ResultsConfig = group_key(ResultsConfig)
    data: DataConfig = group_key(DataConfig)
    generator: GeneratorConfig = group_key(GeneratorConfig)
    tracks: TracksConfig = group_key(TracksConfig)
    scenes: ScenesConfig = group_key(ScenesConfig)
    speed: SpeedConfig = group_key(SpeedConfig)
    features: FeaturesConfig = group_key(FeaturesConfig)
    spacing: SpacingConfig = group_key(SpacingConfig)


@dataclass(unsafe_hash=True)
class ClusterTask:
    """Clusters of tracks and scenes, and representative scenes."""

    study: str = study_key("cluster")
    results: ResultsConfig = group_key(ResultsConfig)
    data: DataConfig = group_key(DataConfig)
    tracks: TracksConfig = group_key(TracksConfig)
    scenes: ScenesConfig = group_key(ScenesConfig)
    speed: SpeedConfig = group_key(SpeedConfig)
    features: FeaturesConfig = group_key(FeaturesConfig)
    spacing: SpacingConfig = group_key(SpacingConfig)
    split: SplitConfig = group_key(SplitConfig)
    kl: KlConfig = group_key(KlConfig)
    cluster: ClusterConfig = group_key(ClusterConfig)
    bo: BoConfig = group_key(BoConfig)


@dataclass(unsafe_hash=True)
class DiscoverTask:
    """Missing effects of the driver model."""

    study: str = study_key("discover")
    results: ResultsConfig = group_key(ResultsConfig)
    data: DataConfig = group_key(DataConfig, _first_look)
    driver: DriverConfig = key(
        record_of("idm"),
        "Car-following model to calibrate, chosen by driver=NAME; the values are the centre of the prior",
    )
    discover: DiscoverConfig = group_key(DiscoverConfig)

    def check(self) -> None:
        """Raise InvalidInputError for a given key that calibration estimates."""
        self.driver.check_prior()

    @property
    def compared(self) -> tuple[DriverConfig, ...]:
        """Car-following models to compare: `driver`, then `discover.base`, by default all if `driver` is left out."""
        others = self.discover.base
        if others is None:
            others = tuple(MODELS) if self.driver == record_of("idm")() else ()
        if self.discover.oracle is not None:
            others = ()  # no effects are searched
        return self.driver, *(record_of(name)() for name in dict.fromkeys(others) if name != self.driver.model)


@dataclass(unsafe_hash=True)
class DiscoverBlindTask:
    """Test of discovery on hidden effects."""

    study: str = study_key("discover_blind")
    results: ResultsConfig = group_key(ResultsConfig)
    blind: BlindConfig = group_key(BlindConfig)
    discover: DiscoverConfig = group_key(DiscoverConfig)


_METHOD_HELP = (
    "control of the vehicles; base: the drivers of `driver` and `mobil`, rearl: these, corrected by `decision` when "
    "the traffic differs too much from its reference, ppo: a trained policy, critical: highway-env's IDM and MOBIL "
    "with classes of drivers"
)


@dataclass(unsafe_hash=True)
class EvaluateTask:
    """Comparison of simulated with measured scenes."""

    study: str = study_key("evaluate")
    method: Method = key(Method.base, _METHOD_HELP)
    model: str | None = key(
        None, "repaired model, a model.yaml written by `rearl discover`; null = the drivers of `driver` and `mobil`"
    )
    variant: Variant = key(
        Variant.all,
        "with model: all = base and rearl, each without and with the effects; calibrated = only `method`, without "
        "effects; repaired = only `method`, with effects",
    )
    results: ResultsConfig = group_key(ResultsConfig)
    data: DataConfig = group_key(DataConfig)
    tracks: TracksConfig = group_key(TracksConfig)
    scenes: ScenesConfig = group_key(ScenesConfig)
    speed: SpeedConfig = group_key(SpeedConfig)
    features: FeaturesConfig = group_key(FeaturesConfig)
    spacing: SpacingConfig = group_key(SpacingConfig)
    split: SplitConfig = group_key(SplitConfig)
    hist: HistConfig = group_key(HistConfig)
    mape: MapeConfig = group_key(MapeConfig)
    thw: ThwConfig = group_key(ThwConfig)
    safety: SafetyConfig = group_key(SafetyConfig)
    realism: RealismConfig = group_key(RealismConfig)
    init: InitConfig = group_key(InitConfig)
    core: CoreConfig = group_key(CoreConfig)
    driver: DriverConfig = key(
        record_of(DEFAULT), "Car following, sizes and classes of the drivers; driver=NAME chooses the model"
    )
    mobil: MobilConfig = group_key(MobilConfig)
    kl: KlConfig = group_key(KlConfig)
    cluster: ClusterConfig = group_key(ClusterConfig)
    bo: BoConfig = group_key(BoConfig)
    detection: DetectionConfig = group_key(DetectionConfig)
    reference: ReferenceConfig = group_key(ReferenceConfig)
    decision: DecisionConfig = group_key(DecisionConfig)
    matcher: MatcherConfig = group_key(MatcherConfig)
    llm: LlmConfig = group_key(LlmConfig)
    prompt: PromptConfig = group_key(PromptConfig)
    admissible: AdmissibleConfig = group_key(AdmissibleConfig)
    exec: ExecConfig = group_key(ExecConfig)
    ppo: PpoPolicyConfig = group_key(PpoPolicyConfig)
    critical: CriticalConfig = group_key(CriticalConfig)
    eval: EvaluationConfig = group_key(EvaluationConfig)

    @property
    def seeds(self) -> str:
        """Seeds of the rollouts and of the held-out scenes, as in the metadata of every table."""
        return f"eval.seed={self.eval.seed}, split.seed={self.split.seed}"


@dataclass(unsafe_hash=True)
class SweepThresholdsTask(EvaluateTask):
    """Comparison of detection thresholds."""

    study: str = study_key("sweep_thresholds")
    method: Method = key(Method.rearl, "rearl; the other methods have no detection thresholds")
    variant: Variant = key(Variant.repaired, ONE_VARIANT_HELP)
    sweep: SweepConfig = group_key(SweepConfig)


@dataclass(unsafe_hash=True)
class SweepScaleTask(PaperStart, EvaluateTask):
    """Many rollouts in constant memory."""

    study: str = study_key("sweep_scale")
    method: Method = key(Method.rearl, _METHOD_HELP)
    variant: Variant = key(Variant.repaired, ONE_VARIANT_HELP)
    # Not int, which OmegaConf refuses to read 1e6 as.
    n_rollouts: float = key(
        100_000.0, "number of rollouts, spread evenly over the scenes of eval.subset; a whole number such as 1e6"
    )

    def check(self) -> None:
        """Raise InvalidInputError for an invalid number of rollouts."""
        if not (float(self.n_rollouts).is_integer() and 1 <= self.n_rollouts < 2**31):
            raise out_of_range("n_rollouts", f"must be a whole number from 1 to {2**31 - 1:,}", self.n_rollouts)


@dataclass(unsafe_hash=True)
class TrainPpoTask:
    """Training of the policy of method=ppo."""

    study: str = study_key("train_ppo")
    results: ResultsConfig = group_key(ResultsConfig)
    ppo: PpoConfig = group_key(PpoConfig)
    admissible: AdmissibleConfig = group_key(AdmissibleConfig)
    core: CoreConfig = group_key(CoreConfig, paper_road)


@dataclass(unsafe_hash=True)
class ValidateTask:
    """Comparison of the traffic model with highway-env."""

    study: str = study_key("validate")
    results: ResultsConfig = group_key(ResultsConfig)
    validation: ValidationConfig = group_key(ValidationConfig)


_METHOD_OF_ROWS_HELP = "base; each row of the table sets its own method"


@dataclass(unsafe_hash=True)
class StudyTable1Task(PaperStart, EvaluateTask):
    """Comparison of methods: Table 1 of the paper."""

    study: str = study_key("study_table1")
    method: Method = key(Method.base, _METHOD_OF_ROWS_HELP)
    variant: Variant = key(Variant.all, "all; model=FILE adds rows with and without its effects")
    table1: Table1Config = group_key(Table1Config)

    def check(self) -> None:
        """Raise InvalidInputError for keys that every row sets itself."""
        if self.method is not Method.base:
            message = "is set by the rows: leave it out and choose rows with table1.rows=[...]"
            raise InvalidInputError(Problem("set-by-task", message, key="method", value=self.method.name))
        if self.decision.policy is not PolicyName.matcher:
            message = (
                "is set by the rows: choose rows with table1.rows=[...], or table1.llm=true for the language model"
            )
            policy = self.decision.policy.name
            raise InvalidInputError(Problem("set-by-task", message, key="decision.policy", value=policy))


@dataclass(unsafe_hash=True)
class StudyFig6Task(StudyTable1Task):
    """Errors by second: Fig. 6 of the paper."""

    study: str = study_key("study_fig6")


@dataclass(unsafe_hash=True)
class StudyTable3Task(PaperStart, SweepThresholdsTask):
    """Threshold pairs: Table 3 of the paper."""

    study: str = study_key("study_table3")


@dataclass(unsafe_hash=True)
class StudyFig7Task(PaperStart, EvaluateTask):
    """Errors of base and their percentiles: Fig. 7 of the paper."""

    study: str = study_key("study_fig7")
    method: Method = key(Method.base, "base; no other method is simulated")
    variant: Variant = key(Variant.repaired, ONE_VARIANT_HELP)
    sweep: SweepConfig = group_key(SweepConfig)

    def check(self) -> None:
        """Raise InvalidInputError for another method."""
        if self.method is not Method.base:
            message = "must be base, because thresholds are percentiles of its errors"
            raise InvalidInputError(Problem("set-by-task", message, key="method", value=self.method.name))


@dataclass(unsafe_hash=True)
class StudyFig8Task(ClusterTask):
    """Clusters of scenes on a map: Fig. 8 of the paper."""

    study: str = study_key("study_fig8")
    speed: SpeedConfig = group_key(SpeedConfig, rescaled)


@dataclass(unsafe_hash=True)
class StudyTable4Task:
    """Inference time: Table 4 of the paper."""

    study: str = study_key("study_table4")
    results: ResultsConfig = group_key(ResultsConfig)
    loop: StepsConfig = group_key(StepsConfig)
    table4: Table4Config = group_key(Table4Config)
    decision: DecisionConfig = group_key(DecisionConfig)
    llm: LlmConfig = group_key(LlmConfig)
    prompt: PromptConfig = group_key(PromptConfig)

    def check(self) -> None:
        """Raise InvalidInputError for a policy that this study does not measure."""
        if self.decision.policy not in (PolicyName.matcher, PolicyName.llm):
            message = (
                "must be matcher or llm, the policies with a row in this table; table4.llm=true adds a language model"
            )
            raise out_of_range("decision.policy", message, self.decision.policy.name)


@dataclass(unsafe_hash=True)
class StudyRealTask(DiscoverTask):
    """Discovery in real recordings."""

    study: str = study_key("study_real")
    real: RealConfig = group_key(RealConfig)

    def check(self) -> None:
        """Raise InvalidInputError for keys whose values follow from the chosen sets of recordings."""
        super().check()
        self.real.check_discovery(self.discover)


@dataclass(unsafe_hash=True)
class ReportTask:
    """Report of a finished study in one file."""

    study: str = key("evaluate", "name of the finished study: its folder under results.root, as study_table1/rows/base")
    results: FolderConfig = group_key(FolderConfig)
    report: ReportConfig = group_key(ReportConfig)


@dataclass(unsafe_hash=True)
class DoctorTask:
    """Check of the installation."""

    results: FolderConfig = group_key(FolderConfig)
    data: DataConfig = group_key(DataConfig)
    decision: DecisionConfig = group_key(DecisionConfig)
    llm: LlmConfig = group_key(LlmConfig)
