"""Columns of tables read as numbers."""

import numpy as np
import pandas as pd
from jaxtyping import Float


def numbers_of(column: pd.Series) -> Float[np.ndarray, " rows"]:
    """Values of a column as numbers; NaN for values that are not numbers."""
    return pd.Series(pd.to_numeric(column, errors="coerce")).to_numpy(np.float64, na_value=np.nan)
