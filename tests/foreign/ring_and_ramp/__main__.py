"""Write one data set: python -m tests.foreign.ring_and_ramp FOLDER --effect NAME --seed N."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from . import EFFECTS, make


def main() -> None:
    """Write FOLDER/*.parquet (one file per recording) and FOLDER.truth.json."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--effect", choices=EFFECTS, required=True)
    parser.add_argument("--seed", type=int, required=True)
    args = parser.parse_args()
    table, truth = make(args.effect, args.seed)
    args.folder.mkdir(parents=True, exist_ok=True)
    for number, part in table.groupby("recording"):
        part.reset_index(drop=True).to_parquet(args.folder / f"recording_{number:02d}.parquet", index=False)
    target = args.folder.with_name(args.folder.name + ".truth.json")
    target.write_text(json.dumps(truth, indent=1) + "\n")


if __name__ == "__main__":
    main()
