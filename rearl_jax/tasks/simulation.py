"""Tasks that simulate traffic."""

from rearl_jax.tasks.task import Task

CLOSED_LOOP = ("detection", "reference", "decision", "matcher", "llm", "prompt", "admissible", "exec")
"""Groups of keys that have an effect only on methods with decisions."""

SIMULATION = (
    Task(
        words="evaluate",
        run="rearl_jax.evaluation.task:run",
        config="rearl_jax.config:EvaluateTask",
        summary="simulate held-out scenes and compare them with the measured ones",
        description=(
            "Simulates every held-out scene several times from its first recorded snapshot (the paper draws the start: "
            "init.source=seed speed.norm=minmax), with common random numbers, and measures the distance between "
            "simulated and recorded traffic, next to the reference rows real against real (other recorded scenes) and "
            "noise floor (two samples of one scene). Prints a table, writes Parquet, figures and one HTML page."
        ),
        examples=(
            "rearl evaluate",
            "rearl evaluate data=highd data.root=/data/highD study=highd_base",
            "rearl evaluate -m scenes.stride=60,30 study=overlap",
            "rearl evaluate -m detection.h_pct=5,10,20,30 detection.m_pct=5,10,20,30 study=pairs",
            "rearl evaluate --sweep cues",
            "rearl evaluate init.source=seed speed.norm=minmax",
            "rearl evaluate method=ppo init.source=seed speed.norm=minmax",
            "rearl evaluate method=critical critical.proposer=search",
            "rearl evaluate model=results/discover/model.yaml",
        ),
        collect="rearl_jax.sweep.cells:collect",
        implied=dict.fromkeys(CLOSED_LOOP, "method=rearl") | {"ppo": "method=ppo", "critical": "method=critical"},
    ),
    Task(
        words="train ppo",
        run="rearl_jax.baselines.task:run",
        config="rearl_jax.config:TrainPpoTask",
        summary="train the policy of method=ppo in the traffic model, without data",
        resumes=True,
        description=(
            "Trains one policy for all vehicles by proximal policy optimisation on highway-env's reward: speed, right "
            "lanes, no crash. It sees the four nearest vehicles and takes an admissible action every second. A killed "
            "training continues where it stopped. Prints the learning curve, writes it as Parquet and figure, and the "
            "weights."
        ),
        examples=(
            "rearl train ppo",
            "rearl train ppo ppo.seed=1 ppo.car_steps=5e6 study=long",
            "rearl evaluate method=ppo ppo.weights=results/long/weights.eqx init.source=seed speed.norm=minmax",
        ),
    ),
    Task(
        words="sweep thresholds",
        run="rearl_jax.sweep.task:run",
        config="rearl_jax.config:SweepThresholdsTask",
        summary="try pairs of detection thresholds on the tuning scenes",
        resumes=True,
        description=(
            "Takes percentiles of the errors of base on the threshold scenes as thresholds, simulates the "
            "tuning scenes under every pair of them in one program and picks the pair with the least Hellinger "
            "distance plus spacing error; states whether the scenes can distinguish it from the next. Prints a table, "
            "writes Parquet and figures."
        ),
        examples=(
            "rearl sweep thresholds",
            "rearl sweep thresholds data=highd data.root=/data/highD study=highd_thresholds",
            "rearl sweep thresholds sweep.h_pct=[10,30] sweep.m_pct=[5]",
            "rearl sweep thresholds scenes.boundary=measured",
        ),
    ),
    Task(
        words="sweep scale",
        run="rearl_jax.sweep.scale:run",
        config="rearl_jax.config:SweepScaleTask",
        summary="simulate very many rollouts in constant memory and measure their cost",
        resumes=True,
        description=(
            "Simulates and scores as many rollouts of the held-out scenes as asked for, every one from another initial "
            "state, and writes them part by part; a killed study continues where it stopped. Before that, measures the "
            "cost of a rollout by the number simulated at a time. Reports rollouts and agent-substeps per second and "
            "memory over time. Prints a table, writes Parquet and a figure."
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
        resumes=True,
        description=(
            "Runs the same scenes in this package's core and in highway-env and compares them at every tick: "
            "positions, speeds, headings, lane changes and crashes, in float64 and float32. Writes the "
            "table, the error over time and the cause of every difference that is left."
        ),
        examples=("rearl validate", "rearl validate study=check"),
        x64=True,
    ),
)
