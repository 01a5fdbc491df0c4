"""NGSIM's tables as published: in feet, with a header, or as the original text files without one."""

import numpy as np
import pandas as pd

FEET = 1.0 / 0.3048
KEYS = {"us-101": 1118846979700, "i-80": 1113433136100}  # global time of frame 0 [ms], 07:49:39 and 15:58:56


def published(place: str = "us-101", start: int = 0, n: int = 60) -> pd.DataFrame:
    """Two cars and a truck in feet; vehicle 2 follows vehicle 1."""
    frames = np.arange(n) + 100
    rows = []
    for vehicle, lane, kind, y, preceding in ((1, 2, 2, 60.0, 0), (2, 2, 2, 30.0, 1), (3, 3, 3, 40.0, 0)):
        rows.append(
            pd.DataFrame(
                {
                    "Vehicle_ID": vehicle,
                    "Frame_ID": frames,
                    "Total_Frames": n,
                    "Global_Time": KEYS[place] + start + 100 * frames,
                    "Local_X": (3.5 * lane - 1.75) * FEET,
                    "Local_Y": (y + 1.2 * np.arange(n)) * FEET,
                    "v_Length": (12.0 if kind == 3 else 4.5) * FEET,
                    "v_Width": (2.5 if kind == 3 else 1.8) * FEET,
                    "v_Class": kind,
                    "v_Vel": 12.0 * FEET,
                    "v_Acc": 0.5 * FEET,
                    "Lane_ID": lane,
                    "Preceding": preceding,
                    "Location": place,
                }
            )
        )
    return pd.concat(rows, ignore_index=True)


def text_of(rows: pd.DataFrame) -> str:
    """The rows as in the original text files."""
    names = (
        "Vehicle_ID Frame_ID Total_Frames Global_Time Local_X Local_Y Global_X Global_Y v_Length v_Width v_Class v_Vel "
        "v_Acc Lane_ID Preceding Following Space_Headway Time_Headway"
    ).split()
    return rows.reindex(columns=names, fill_value=0).to_string(header=False, index=False)
