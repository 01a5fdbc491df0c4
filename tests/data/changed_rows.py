"""Sound rows with faults put in."""

import pandas as pd


def with_values(rows: pd.DataFrame, row: int, **values) -> pd.DataFrame:
    """The rows with other values of any type in one of them."""
    changed = rows.copy()
    for name, value in values.items():
        changed[name] = changed[name].astype(object)
        changed.loc[row, name] = value
    return changed
