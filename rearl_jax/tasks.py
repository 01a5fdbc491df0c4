"""The tasks of `rearl`: their words, what they do, where their function and their configuration record are.

Standard library only: `rearl --help` reads this file and nothing heavier. A task's own module is imported
when the task runs.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Task:
    """One task. `run`, `config` and `collect` are addresses `module:name`; the function takes the record.

    `collect` puts the cells of a multirun together: it takes the record with what all cells share, and for each cell
    the values of the swept keys. `implied` names overrides that keys of a group imply.
    """

    words: str
    run: str
    config: str
    summary: str
    description: str
    examples: tuple[str, ...]
    x64: bool = False
    collect: str | None = None
    implied: dict[str, str] = field(default_factory=dict)

    @property
    def config_name(self) -> str:
        """Name of the task's file in conf/ without its ending, `bench core` -> `bench_core`."""
        return self.words.replace(" ", "_")

    def load_config(self) -> type:
        """The class of the task's configuration record."""
        return _load(self.config)

    def defaults(self) -> Any:
        """The configuration record with every key at its default."""
        return self.load_config()()

    def load_run(self) -> Callable[[Any], dict]:
        """The function of the task; importing it imports JAX and whatever else the task needs."""
        return _load(self.run)

    def load_collect(self) -> Callable[[Any, list[dict[str, str]]], None]:
        """The function that puts cells together."""
        assert self.collect is not None
        return _load(self.collect)


CLOSED_LOOP = ("detection", "reference", "decision", "matcher", "llm", "prompt", "admissible", "exec")
"""Groups of keys that mean something only where decisions are made."""

TASKS = (
    Task(
        words="prepare",
        run="rearl_jax.data.prepare:run",
        config="rearl_jax.config:PrepareTask",
        summary="read recordings, check them, write canonical tables and scenes",
        description=(
            "Reads trajectory recordings (highD family, NGSIM tables, OpenACC, canonical tables, the shipped "
            "US-101 set), checks every row, converts units once and writes canonical Parquet tables and 60 s "
            "scenes. data=generated first writes new recordings in the highD three-file format."
        ),
        examples=(
            "rearl prepare",
            "rearl prepare data=highd data.root=/data/highD study=highd",
            "rearl prepare data=generated study=generated generator.n_recordings=4",
        ),
    ),
    Task(
        words="cluster",
        run="rearl_jax.clustering.task:run",
        config="rearl_jax.config:ClusterTask",
        summary="cluster tracks and scenes and pick representative scenes",
        description=(
            "Clusters all tracks by speed, position and spacing under the Frechet distance ((k,l)-clustering), "
            "scenes by the shares of these clusters (k-means), and picks the representative scenes that "
            "detection uses. bo.enabled=true first searches k, l and the iterations. Prints a table, writes "
            "Parquet and figures."
        ),
        examples=(
            "rearl cluster",
            "rearl cluster data=highd data.root=/data/highD study=highd_clusters",
            "rearl cluster bo.enabled=true bo.n_calls=100 study=search",
        ),
    ),
    Task(
        words="evaluate",
        run="rearl_jax.evaluation.task:run",
        config="rearl_jax.config:EvaluateTask",
        summary="simulate held-out scenes and compare them with the measured ones",
        description=(
            "Simulates every held-out scene several times with common random numbers and measures how far "
            "the simulated traffic is from the recorded one, beside the reference rows real against real and "
            "noise floor. Prints a table, writes Parquet, figures and one HTML page."
        ),
        examples=(
            "rearl evaluate",
            "rearl evaluate data=highd data.root=/data/highD study=highd_base",
            "rearl evaluate -m scenes.stride=60,30 study=overlap",
            "rearl evaluate -m detection.h_pct=5,10,20,30 detection.m_pct=5,10,20,30 study=pairs",
            "rearl evaluate --sweep cues",
            "rearl evaluate method=ppo",
            "rearl evaluate method=critical critical.proposer=search",
        ),
        collect="rearl_jax.sweep.cells:collect",
        implied=dict.fromkeys(CLOSED_LOOP, "method=rearl") | {"ppo": "method=ppo", "critical": "method=critical"},
    ),
    Task(
        words="train ppo",
        run="rearl_jax.baselines.task:run",
        config="rearl_jax.config:TrainPpoTask",
        summary="train the policy of method=ppo in the traffic model, without data",
        description=(
            "Trains one policy for all vehicles by proximal policy optimisation on highway-env's reward: speed, right "
            "lanes, no crash. It sees the four nearest vehicles and takes an admissible action every second. A killed "
            "training goes on where it was. Prints the learning curve, writes it as Parquet and figure, and the "
            "weights."
        ),
        examples=(
            "rearl train ppo",
            "rearl train ppo ppo.seed=1 ppo.car_steps=5e6 study=long",
            "rearl evaluate method=ppo ppo.weights=results/long/weights.eqx",
        ),
    ),
    Task(
        words="sweep thresholds",
        run="rearl_jax.sweep.task:run",
        config="rearl_jax.config:SweepThresholdsTask",
        summary="try pairs of detection thresholds on the tuning scenes",
        description=(
            "Takes percentiles of what the method base reaches on the threshold scenes as thresholds, simulates the "
            "tuning scenes under every pair of them in one program and picks the pair with the least Hellinger "
            "distance plus spacing error; says whether the scenes can tell it from the next. Prints a table, writes "
            "Parquet and figures."
        ),
        examples=(
            "rearl sweep thresholds",
            "rearl sweep thresholds data=highd data.root=/data/highD study=highd_thresholds",
            "rearl sweep thresholds sweep.h_pct=[10,30] sweep.m_pct=[5]",
        ),
    ),
    Task(
        words="sweep scale",
        run="rearl_jax.sweep.scale:run",
        config="rearl_jax.config:SweepScaleTask",
        summary="stream very many rollouts in constant memory and say what they cost",
        description=(
            "Simulates and scores as many rollouts of the held-out scenes as asked for, every one from another initial "
            "state, and writes them part by part; a killed study goes on where it was. Before that, measures the cost "
            "of a rollout by the number simulated at a time. Reports rollouts and agent-substeps per second and memory "
            "over time. Prints a table, writes Parquet and a figure."
        ),
        examples=(
            "rearl sweep scale",
            "rearl sweep scale n_rollouts=1e6 study=million",
            "rearl sweep scale method=base n_rollouts=1e6",
        ),
    ),
    Task(
        words="validate",
        run="rearl_jax.validation.task:run",
        config="rearl_jax.config:ValidateTask",
        summary="compare the traffic core with highway-env, tick by tick",
        description=(
            "Runs the same scenes in this package's core and in highway-env and compares them at every tick: "
            "positions, speeds, headings, lane changes and crashes, in float64 and float32. Writes the "
            "table, the error over time and the cause of every difference that is left."
        ),
        examples=("rearl validate", "rearl validate study=check"),
        x64=True,
    ),
    Task(
        words="bench core",
        run="rearl_jax.bench.core:run",
        config="rearl_jax.config:BenchCoreTask",
        summary="measure the traffic core beside highway-env, SUMO and a C program",
        description=(
            "Measures agent-substeps per CPU-second, compile time and peak memory of the traffic core, and "
            "in the same run highway-env, libsumo (extra `bench`) and a vectorised C program where a "
            "compiler is found. The ratios are the result."
        ),
        examples=("rearl bench core", "rearl bench core study=laptop"),
    ),
    Task(
        words="bench loop",
        run="rearl_jax.bench.loop:run",
        config="rearl_jax.config:BenchLoopTask",
        summary="measure what detection and decisions cost beside the traffic core",
        description=(
            "Measures, in turn within one run, the CPU time of Base rollouts, of the closed loop that is never "
            "triggered and of the closed loop that always is, by vehicles and scenarios at a time; then the time of "
            "ten consecutive decision steps. Reads no data: the references are synthetic. Prints tables, writes "
            "Parquet and a figure."
        ),
        examples=(
            "rearl bench loop",
            "rearl bench loop loop.vehicles=[10] loop.batches=[256,1200] study=laptop",
        ),
    ),
    Task(
        words="study table1",
        run="rearl_jax.study.table1:run",
        config="rearl_jax.config:StudyTable1Task",
        summary="the methods beside each other and beside the paper's Table 1",
        description=(
            "Evaluates every row (base, PPO, CRITICAL, the closed loop with its controls, with table1.llm=true a "
            "language model) as `rearl evaluate` does, each in a folder of its own below rows/, and puts them beside "
            "the figures of the paper, with what differs between the two. A killed study goes on where it was. Prints "
            "the table and what follows from it, writes Parquet, a figure and one HTML page."
        ),
        examples=(
            "rearl study table1",
            "rearl study table1 table1.rows=[base,matcher_rank,idle] study=three",
            "rearl study table1 data=highd data.root=/data/highD study=highd_table1",
            "rearl study table1 table1.llm=true decision.server=http://HOST:8000/v1 table1.llm_interval=1",
        ),
    ),
    Task(
        words="study table3",
        run="rearl_jax.study.table3:run",
        config="rearl_jax.config:StudyTable3Task",
        summary="the threshold pairs beside the paper's Table 3",
        description=(
            "Runs `rearl sweep thresholds` in the folder sweep/ and puts thresholds, best pair and Pareto set beside "
            "what is known of the paper's. Prints a table, writes Parquet, a figure and one HTML page."
        ),
        examples=("rearl study table3", "rearl study table3 data=highd data.root=/data/highD study=highd_table3"),
    ),
    Task(
        words="study table4",
        run="rearl_jax.study.table4:run",
        config="rearl_jax.config:StudyTable4Task",
        summary="the time of ten consecutive decisions beside the paper's Table 4",
        description=(
            "Measures ten consecutive decision steps as `rearl bench loop` does, one scenario and many at a time, "
            "detection and decision apart, and puts them beside the paper's inference times. Reads no data: the "
            "references are synthetic. Prints a table, writes Parquet, a figure and one HTML page."
        ),
        examples=("rearl study table4", "rearl study table4 table4.llm=true decision.server=http://HOST:8000/v1"),
    ),
    Task(
        words="study fig6",
        run="rearl_jax.study.fig6:run",
        config="rearl_jax.config:StudyFig6Task",
        summary="the errors of the methods second by second, as in the paper's Fig. 6",
        description=(
            "Evaluates the rows of Table 1 and shows Hellinger distance and spacing error of every row second by "
            "second, beside base and real against real. table1.kept_in=study_table1 uses the rows that `rearl study "
            "table1` has evaluated. Prints a table, writes Parquet, a figure and one HTML page."
        ),
        examples=("rearl study fig6", "rearl study fig6 table1.kept_in=study_table1"),
    ),
    Task(
        words="study fig7",
        run="rearl_jax.study.fig7:run",
        config="rearl_jax.config:StudyFig7Task",
        summary="the errors of base and their percentiles, as in the paper's Fig. 7",
        description=(
            "Simulates base on the threshold scenes and shows the distributions of Hellinger distance and spacing "
            "error with the percentiles that become thresholds, beside the paper's. Prints a table, writes Parquet, a "
            "figure and one HTML page."
        ),
        examples=("rearl study fig7", "rearl study fig7 mape.definition=C"),
    ),
    Task(
        words="study fig8",
        run="rearl_jax.study.fig8:run",
        config="rearl_jax.config:StudyFig8Task",
        summary="the clusters of scenes and their representatives, as in the paper's Fig. 8",
        description=(
            "Runs `rearl cluster` in the folder cluster/ and shows the scenes on a t-SNE map with clusters and "
            "representatives, beside the paper's numbers. Prints a table, writes Parquet, figures and one HTML page."
        ),
        examples=("rearl study fig8", "rearl study fig8 data=highd data.root=/data/highD study=highd_fig8"),
    ),
    Task(
        words="bench requests",
        run="rearl_jax.bench.requests:run",
        config="rearl_jax.config:BenchRequestsTask",
        summary="measure how fast a language model is asked",
        description=(
            "Asks the questions of a closed loop that is triggered every second: of a server that takes a fixed time "
            "for each, and of a real one where it is named; in turn through our client and through a plain load "
            "generator that neither parses nor keeps anything. Reads no data. Prints a table, writes Parquet."
        ),
        examples=(
            "rearl bench requests",
            "rearl bench requests requests.server=local llm.max_in_flight=2",
        ),
    ),
)


def conf_dir() -> Path:
    """The folder of the configuration files: inside the package in a wheel, beside it in a checkout.

    Raises:
        FileNotFoundError: Neither exists, the installation is incomplete.
    """
    return _beside("conf")


def sweeps_dir() -> Path:
    """The folder of the sweep files, which lies where `conf_dir` does.

    Raises:
        FileNotFoundError: There is none, the installation is incomplete.
    """
    return _beside("sweeps")


def _beside(name: str) -> Path:
    package = Path(__file__).resolve().parent
    for folder in (package / name, package.parent / name):
        if folder.is_dir():
            return folder
    raise FileNotFoundError(f"{package / name} is missing: incomplete installation, install again")


def _load(address: str) -> Any:
    module, _, name = address.partition(":")
    return getattr(import_module(module), name)
