"""The command `python -m tests.foreign.convoys FOLDER --effect E --seed S`: writes one Parquet file per recording."""

import argparse
import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from .dataset import ROAD_LENGTH, Dataset, effects, make


def write(dataset: Dataset, folder: Path) -> None:
    """Write the recordings with their metadata, which do not name the effect; lanes are numbered from 0 in files."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, table in enumerate(dataset.tables, start=1):
        name = f"convoy_{number:02d}"
        info = {
            "id": name,
            "frame_rate": dataset.frame_rate,
            "lane_count": {"1": 1},
            "road_length": ROAD_LENGTH,
            "source": "convoys",
            "licence": "MIT",
            "attribution": "generated, nobody to name",
            "generated": True,
            "notes": [dataset.description],
        }
        rows = table.assign(recording=name, lane=table["lane"] - 1)
        arrow = pa.Table.from_pandas(rows, preserve_index=False)
        stated = {**(arrow.schema.metadata or {}), b"rearl_jax.recordings": json.dumps([info]).encode()}
        pq.write_table(arrow.replace_schema_metadata(stated), folder / f"{name}.parquet")


def main() -> None:
    """Make and write the dataset that the arguments name."""
    parser = argparse.ArgumentParser(prog="python -m tests.foreign.convoys", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--effect", choices=("control", *effects()), default="control")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    dataset = make(options.effect, options.seed)
    write(dataset, options.folder)
    print(f"{len(dataset.tables)} recordings at {dataset.frame_rate:.0f} Hz in {options.folder}: {dataset.description}")


if __name__ == "__main__":
    main()
