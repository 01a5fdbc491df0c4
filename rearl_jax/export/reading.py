"""The task `rearl import`: vehicle types of SUMO as a population of drivers.

Writes into the study folder `model.yaml` (which `model=FILE` loads in every task that simulates traffic),
`said.parquet` (translation of each attribute), `config.json` and, last of all, `summary.json`.
"""

import hashlib
from pathlib import Path
from typing import Any

from rearl_jax.code_version import __version__
from rearl_jax.config.export import ImportTask
from rearl_jax.document.document import Document, Section
from rearl_jax.document.table import table_of
from rearl_jax.document.terminal import print_document
from rearl_jax.export.population_of_types import population_of_types
from rearl_jax.export.translations import translation_table
from rearl_jax.export.vehicle_types import read_types
from rearl_jax.models.file import write_model
from rearl_jax.models.record import RepairedModel, Source
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.results import Study

FILE = "model.yaml"
"""Name of the population's file."""


def run(config: ImportTask) -> dict[str, Any]:
    """The summary: `car_following`, `n_types`, `n_classes`, `n_read`, `n_unread`.

    Raises:
        MissingInputError: There is no such file.
        InvalidInputError: No file is named, or it has no types that can be read as drivers.
    """
    if config.sumo.file is None:
        message = "must name a file of SUMO with vType elements"
        raise InvalidInputError(Problem("key-missing", message, key="sumo.file"))
    types = read_types(config.sumo.file, config.sumo.types)
    name, classes, attributes = population_of_types(types, config.sumo.speed_limit)
    identity = f"sumo-{hashlib.sha256(Path(config.sumo.file).read_bytes()).hexdigest()[:12]}"
    study = Study(config.results.root, config.study, config, "import", identity)
    if (stored := study.begin(resume=config.results.resume)) is not None:
        return stored
    source = Source(identity, config.study, __version__)
    path = study.recorded_path(FILE)
    write_model(path, RepairedModel(source, population=classes, baseline=classes, car_following=name))
    translations = translation_table(attributes)
    study.write_table("said", translations)
    n_read = sum(attribute.where is not None for attribute in attributes)
    summary = {
        "car_following": name,
        "n_types": len(types),
        "n_classes": len(classes),
        "n_read": n_read,
        "n_unread": len(translations) - n_read,
    }
    columns = {"what": "attribute", "where": "here", "remark": "remark"}
    attributes_table = table_of("Attributes of the vehicle types", translations, columns)
    print_document(
        Document(
            title="Import from SUMO",
            verdict=f"{len(types)} vehicle types of SUMO are {', '.join(classes)} drivers of {name} in {path}; "
            f"{summary['n_unread']} of {len(translations)} attributes have no counterpart.",
            sections=(Section("Attributes", tables=(attributes_table,)),),
            command="import",
            generated=False,
        )
    )
    study.write_summary(summary)
    return summary
