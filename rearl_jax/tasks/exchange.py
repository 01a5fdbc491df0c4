"""Tasks that exchange drivers with other programs."""

from rearl_jax.tasks.task import Task

EXCHANGE = (
    Task(
        words="export",
        run="rearl_jax.export.task:run",
        config="rearl_jax.config.export:ExportTask",
        summary="write calibrated drivers for SUMO, highway-env or OpenSCENARIO",
        description=(
            "Draws drivers from a population and writes each as a vehicle type of SUMO, as attributes of highway-env's "
            "IDMVehicle or as a controller of OpenSCENARIO, which keeps the correlations of the parameters. Prints "
            "where every part of the model went and what the other program cannot represent. export.compare=true "
            "simulates the exported drivers in SUMO and here behind the same measured leaders and gives the difference."
        ),
        examples=(
            "rearl export model=results/discover/model.yaml",
            "rearl export model=results/discover/model.yaml export.compare=true",
            "rearl export driver=krauss driver.time_gap_sd=.3 export.n_types=200 study=krauss_types",
            "rearl export driver=idm to=highway_env",
        ),
        x64=True,
    ),
    Task(
        words="import",
        run="rearl_jax.export.reading:run",
        config="rearl_jax.config.export:ImportTask",
        summary="read vehicle types of SUMO as a population of drivers",
        description=(
            "Reads the vTypes of a SUMO file, with the probabilities of their distribution, and writes the population "
            "as model.yaml: means, spreads and correlations of the parameters of each class of vehicles. Prints which "
            "attributes were read, which are SUMO's defaults and which have no counterpart here."
        ),
        examples=(
            "rearl import sumo.file=types.add.xml",
            "rearl evaluate model=results/import/model.yaml variant=calibrated",
        ),
    ),
)
