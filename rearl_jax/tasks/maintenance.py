"""The task that checks the installation."""

from rearl_jax.tasks.task import Task

MAINTENANCE = (
    Task(
        words="doctor",
        run="rearl_jax.doctor.task:run",
        config="rearl_jax.config:DoctorTask",
        summary="check the installation: JAX, memory, folders, recordings, servers, extras",
        uses_jax=False,
        failures="n_fail",
        description=(
            "Looks at Python and JAX with its devices, cores, memory, the cache and the folder of results, free space, "
            "the recordings (one is read), the server of a language model if one is named, and the packages. One "
            "line per check, ok, warn or fail, with a remedy. Writes nothing. Exit code 1 if a check has failed."
        ),
        examples=(
            "rearl doctor",
            "rearl doctor data=highd data.root=/data/highD results.root=/scratch/results",
            "rearl doctor decision=llm decision.server=http://HOST:8000/v1",
            "rearl doctor --json | jq '.checks[] | select(.status != \"ok\")'",
        ),
    ),
)
