"""Tasks that analyse recordings."""

from rearl_jax.tasks.task import Task

DATA = (
    Task(
        words="prepare",
        run="rearl_jax.data.prepare:run",
        config="rearl_jax.config:PrepareTask",
        on_file="rearl_jax.data.survey.task:run",
        summary="read recordings, check them, write canonical tables and scenes",
        description=(
            "Reads trajectory recordings (highD family, NGSIM tables, OpenACC, FHWA pairs, canonical tables, shipped "
            "sets), checks every row, converts units once and writes canonical Parquet tables and 60 s scenes. "
            "data=generated first writes new recordings in the highD three-file format. `rearl prepare FILE` says what "
            "an unknown file holds, and the command that reads it."
        ),
        examples=(
            "rearl prepare",
            "rearl prepare unknown.csv",
            "rearl prepare data=highd data.root=/data/highD study=highd",
            "rearl prepare data=generated study=generated generator.n_recordings=4",
        ),
    ),
    Task(
        words="cluster",
        run="rearl_jax.clustering.task:run",
        config="rearl_jax.config:ClusterTask",
        summary="cluster tracks and scenes and pick representative scenes",
        resumes=True,
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
        words="discover",
        run="rearl_jax.discovery.task:run",
        config="rearl_jax.config:DiscoverTask",
        summary="find effects that the traffic model lacks, from measured trajectories",
        resumes=True,
        description=(
            "Calibrates every driver, examines what the model cannot predict, identifies the effect or the measurement "
            "fault that causes it, adds the effect, checks it on other drivers and reports the error before and after "
            "on drivers that were not used in the fit. An interrupted study continues. Prints the verdict, "
            "writes it as verdict.json, the repaired model as model.yaml, Parquet, figures and one HTML page."
        ),
        examples=(
            "rearl discover",
            "rearl discover data=highd data.root=/data/highD study=highd_effects",
            "rearl discover data.root=FOLDER data.format=highd study=NAME",
            "rearl evaluate model=results/highd_effects/model.yaml",
        ),
        implied={"driver": "discover.base=[]"},
        x64=True,
    ),
    Task(
        words="discover blind",
        run="rearl_jax.blind.task:run",
        config="rearl_jax.config:DiscoverBlindTask",
        summary="test discovery on generated data with hidden effects",
        resumes=True,
        description=(
            "Generates data sets with hidden effects and artefacts from an independent generator and from SUMO, stores "
            "a hash of the hidden values, runs discovery on each and scores it. A killed study continues where it "
            "stopped. Prints tables, writes Parquet, figures and one HTML page."
        ),
        examples=(
            "rearl discover blind",
            "rearl discover blind blind.size=full blind.oracle=true study=hidden_effects results.resume=true",
            "rearl discover blind blind.priors=broad blind.n_sets=500 study=broad",
        ),
        x64=True,
    ),
)
