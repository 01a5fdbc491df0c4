"""Tasks that compare results with the paper's tables and figures, and the task `report`."""

from rearl_jax.tasks.task import Task

STUDIES = (
    Task(
        words="study table1",
        run="rearl_jax.study.table1:run",
        config="rearl_jax.config:StudyTable1Task",
        summary="the methods in one table, compared with the paper's Table 1",
        resumes=True,
        description=(
            "Evaluates every row (base, PPO, CRITICAL, the closed loop with its controls, with table1.llm=true a "
            "language model) as `rearl evaluate` does with the paper's start, each in a folder of its own below rows/, "
            "and compares them with the figures of the paper, with a list of differences. table1.traffic=true adds "
            "REARL on improved traffic: with replayed vehicles, with calibrated drivers, with both. An interrupted "
            "study continues. Prints the table and conclusions, writes Parquet, a figure and one HTML page."
        ),
        examples=(
            "rearl study table1",
            "rearl study table1 table1.rows=[base,matcher_rank,idle] study=three",
            "rearl study table1 table1.rows=[base] table1.traffic=true study=better",
            "rearl study table1 data=highd data.root=/data/highD study=highd_table1",
            "rearl study table1 table1.llm=true decision.server=http://HOST:8000/v1 table1.llm_interval=1",
        ),
    ),
    Task(
        words="study table3",
        run="rearl_jax.study.table3:run",
        config="rearl_jax.config:StudyTable3Task",
        summary="the threshold pairs, compared with the paper's Table 3",
        resumes=True,
        description=(
            "Runs `rearl sweep thresholds` with the paper's start in the folder sweep/ and compares thresholds, best "
            "pair and Pareto set with the known values of the paper. Prints a table, writes Parquet, a figure and one "
            "HTML page."
        ),
        examples=("rearl study table3", "rearl study table3 data=highd data.root=/data/highD study=highd_table3"),
    ),
    Task(
        words="study table4",
        run="rearl_jax.study.table4:run",
        config="rearl_jax.config:StudyTable4Task",
        summary="the time of ten consecutive decisions, compared with the paper's Table 4",
        resumes=True,
        description=(
            "Measures ten consecutive decision steps, one scenario and many at a time, detection and decision "
            "apart, and compares them with the paper's inference times. Reads no data: the "
            "references are synthetic. Prints a table, writes Parquet, a figure and one HTML page."
        ),
        examples=("rearl study table4", "rearl study table4 table4.llm=true decision.server=http://HOST:8000/v1"),
    ),
    Task(
        words="study fig6",
        run="rearl_jax.study.fig6:run",
        config="rearl_jax.config:StudyFig6Task",
        summary="the errors of the methods second by second, as in the paper's Fig. 6",
        resumes=True,
        description=(
            "Evaluates the rows of Table 1 and shows Hellinger distance and spacing error of every row second by "
            "second, with base and real against real. table1.kept_in=study_table1 uses the rows that `rearl study "
            "table1` has evaluated. Prints a table, writes Parquet, a figure and one HTML page."
        ),
        examples=("rearl study fig6", "rearl study fig6 table1.kept_in=study_table1"),
    ),
    Task(
        words="study fig7",
        run="rearl_jax.study.fig7:run",
        config="rearl_jax.config:StudyFig7Task",
        summary="the errors of base and their percentiles, as in the paper's Fig. 7",
        resumes=True,
        description=(
            "Simulates base on the threshold scenes and shows the distributions of Hellinger distance and spacing "
            "error with the percentiles that become thresholds, and the paper's. Prints a table, writes Parquet, a "
            "figure and one HTML page."
        ),
        examples=("rearl study fig7", "rearl study fig7 mape.definition=C"),
    ),
    Task(
        words="study fig8",
        run="rearl_jax.study.fig8:run",
        config="rearl_jax.config:StudyFig8Task",
        summary="the clusters of scenes and their representatives, as in the paper's Fig. 8",
        resumes=True,
        description=(
            "Runs `rearl cluster` in the folder cluster/ and shows the scenes on a t-SNE map with clusters and "
            "representatives, and the paper's numbers. Prints a table, writes Parquet, figures and one HTML page."
        ),
        examples=("rearl study fig8", "rearl study fig8 data=highd data.root=/data/highD study=highd_fig8"),
    ),
    Task(
        words="study real",
        run="rearl_jax.study.real.task:run",
        config="rearl_jax.config:StudyRealTask",
        summary="what the driver model is missing in the shipped real recordings; compares time gaps with known ones",
        resumes=True,
        description=(
            "Makes a discovery of each set of recordings (I-80, FHWA by leader, ZalaZone by setting and by car), "
            "as `rearl discover` does, in a folder of its own below sets/, and puts verdicts and errors by calibration "
            "protocol into one table. Known time gaps of these vehicles at equilibrium are compared with those "
            "of the calibrated drivers. data.recordings other than * replaces the pattern of each set. A "
            "killed study continues where it stopped. Prints the tables, writes Parquet and one HTML page."
        ),
        examples=(
            "rearl study real",
            "rearl study real real.sets=[fhwa,openacc] study=time_gaps",
            "rearl study real real.sets=[own] data=openacc data.root=/data/platoons discover.by=setting study=platoons",
        ),
        implied={"driver": "discover.base=[]"},
        x64=True,
    ),
    Task(
        words="study budget",
        run="rearl_jax.study.budget.task:run",
        config="rearl_jax.config.budget:StudyBudgetTask",
        summary="divides the error of simulated scenes among its causes, from Base to real against real",
        resumes=True,
        description=(
            "Adds components to Base, one at a time, in the stated order and in every other admissible one: start and "
            "desired speeds as recorded, replayed vehicles, calibrated drivers, effects that discovery found, "
            "calibrated lane changes, variation within drivers, REARL. Divides the reduction of every error into "
            "Shapley shares with intervals, and compares the rest with real against real. Effects and lane changes "
            "come from model=FILE; without it drivers are calibrated on the recordings outside the scored scenes. The "
            "road has the lanes of the recordings. A killed study continues where it stopped. Prints tables, writes "
            "Parquet, a figure and one HTML page."
        ),
        examples=(
            "rearl study budget",
            "rearl study budget data=table data.root=/data/motorway study=motorway_budget",
            "rearl study budget data=table data.root=/data/jam scenes.seconds=10 hist.low=0 study=jam",
            "rearl study budget model=results/discover/model.yaml study=with_effects",
            "rearl study budget budget.components=[start,boundary,rearl] study=three",
        ),
    ),
    Task(
        words="study stability",
        run="rearl_jax.study.stability.task:run",
        config="rearl_jax.config.stability:StudyStabilityTask",
        summary="compares string stability, flow and collisions of simulated traffic with theory and recordings",
        resumes=True,
        description=(
            "Simulates platoons behind an oscillating first vehicle, rings, and a queue that discharges, for every "
            "car-following model or a repaired one, and compares amplification, waves, capacity, outflow, wave "
            "speed and collisions with the linear analysis, and amplification also with measured followers. A killed "
            "study continues where it stopped. Prints tables, writes Parquet, verdict.json, figures and one HTML page."
        ),
        examples=(
            "rearl study stability",
            "rearl study stability stability.models=[idm,gipps] stability.measured=false study=two",
            "rearl study stability model=results/discover/model.yaml data=i80_slice study=repaired_traffic",
        ),
        x64=True,
    ),
    Task(
        words="report",
        run="rearl_jax.report.task:run",
        config="rearl_jax.config:ReportTask",
        summary="a finished study as one HTML file, with replays of simulated and recorded scenes",
        description=(
            "Reads the folder of a finished `rearl evaluate`, `discover`, `discover blind`, `sweep thresholds` or "
            "`study ...` and writes its page.html again: the result in one sentence, tables with intervals, figures, "
            "data and licence, the command that repeats it. Of `rearl evaluate` some scenes are simulated again, "
            "checked against the figures stored by the study, and replayed together with the recorded ones. The file "
            "needs only a browser."
        ),
        examples=(
            "rearl report",
            "rearl report study=highd_effects",
            "rearl report study=study_table1/rows/matcher_rank report.n_scenes=5 report.run=2",
            "rearl report study=evaluate report.scenes=[3,17] report.path=for_the_meeting.html",
        ),
    ),
)
