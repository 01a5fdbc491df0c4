"""Ids of tracks that are not whole numbers: they are numbered in the order of their first rows and kept as a label."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from rearl_jax.data.checks.leaders import is_absent
from rearl_jax.data.checks.placeholders import is_placeholder
from rearl_jax.data.numbers import numbers_of
from rearl_jax.data.problems import bad_recording, source_row

LABEL = "track_name"
"""Label that holds the id in the source, if this is not a number that the canonical table can hold."""
IDS = ("track_id", "leader_id")
"""Columns that name vehicles."""
MAX_EXACT_ID = 2**53
"""Largest id up to which float64 represents every whole number."""
NO_LEADER = frozenset({"", "none", "null", "nan", "na", "n/a", "<na>", "-", "-1", "0"})
"""Spellings of "no leader" in sources, in lower case; if a vehicle has such an id, that vehicle is meant."""
# A number in exponential notation: digits are lost if the exponent exceeds the number of digits of the fraction.
_ROUNDED = r"^[+-]?\d(?:\.(?P<fraction>\d*))?[eE]\+?(?P<exponent>\d+)$"
_MAX_DAMAGED_SHARE = 0.02  # of the rows; if fewer ids are not numbers, and each occurs once, they are damaged rows


def numbered(rows: pd.DataFrame, file: str, spelling: Mapping[str, str]) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """The rows with whole numbers in `track_id` and `leader_id`, the ids of the source as LABEL, and notes.

    Ids that are whole numbers stay as they are. The index of the rows holds the row numbers of the source; `spelling`
    the names in the file of canonical columns that have others there.

    Raises:
        BadRecordingError: A few ids are not numbers where the others are.
    """
    texts = _texts(pd.Series(rows["track_id"]))
    if texts is None:
        return _with_numeric_leaders(rows, file, spelling), ()
    known = texts.notna().to_numpy()
    column = spelling.get("track_id", "track_id")
    _require_all_digits(texts, rows, file, column)
    numbers = _whole_numbers(texts)
    is_number = np.isfinite(numbers)
    if is_number[known].all() and _are_distinct(pd.Series(texts[known]), numbers[known]):
        return _with_numeric_leaders(rows.assign(track_id=numbers), file, spelling), ()
    rare = known & ~is_number
    if rare.any() and rare.sum() <= _MAX_DAMAGED_SHARE * known.sum() and not pd.Series(texts[rare]).duplicated().any():
        text = f"{texts.iloc[int(np.argmax(rare))]!r} is not a number, as the other ids are"
        row, remedy = source_row(rows, rare), "write the number of the vehicle there"
        raise bad_recording("value-unreadable", text, remedy, file, column=column, row=row)
    codes, names = pd.factorize(texts)
    rows = rows.assign(track_id=np.where(codes < 0, np.nan, codes + 1.0), **{LABEL: texts})
    kind = _kind(pd.Series(texts[known]), is_number[known])
    notes = [
        f"ids of tracks are {kind}: {len(names)} tracks numbered in order of appearance, "
        f"1 is {names[0]}; the label {LABEL} holds them"
    ]
    if "leader_id" in rows:
        _require_exact_leaders(pd.Series(rows["leader_id"]), file, spelling.get("leader_id", "leader_id"))
        leader = _as_texts(pd.Series(rows["leader_id"]))
        code = pd.Series(np.arange(1.0, len(names) + 1.0), index=names)
        has_none = leader.isna() | (leader.str.lower().isin(NO_LEADER) & ~leader.isin(names))
        absent = pd.Series(leader[~has_none & ~leader.isin(names)])
        others, inverse = np.unique(absent.astype(str), return_inverse=True)
        number = leader.map(code).astype(np.float64)
        number[absent.index] = len(names) + 1.0 + inverse
        rows = rows.assign(leader_id=number.to_numpy())
        if len(others):
            notes.append(f"{len(others)} stated leaders are not vehicles of the recording, such as {others[0]}")
    return rows, tuple(notes)


def _with_numeric_leaders(rows: pd.DataFrame, file: str, spelling: Mapping[str, str]) -> pd.DataFrame:
    """The rows with numbers in `leader_id`. Words for "no leader" become unknown, and so do 0, -1 and placeholders that
    are not the id of a vehicle.
    """
    if "leader_id" not in rows:
        return rows
    tracks = rows["track_id"].to_numpy(np.float64, na_value=np.nan)
    if pd.api.types.is_numeric_dtype(rows["leader_id"]):
        leaders = pd.Series(rows["leader_id"])
        is_none = is_absent(leaders.to_numpy(np.float64, na_value=np.nan), tracks)
        return rows.assign(leader_id=leaders.mask(is_none)) if is_none.any() else rows
    texts = _as_texts(pd.Series(rows["leader_id"]))
    numbers = pd.Series(pd.to_numeric(texts, errors="coerce"), index=rows.index).astype(np.float64)
    bad = (numbers.isna() & texts.notna() & ~texts.str.lower().isin(NO_LEADER)).to_numpy()
    if bad.any():
        text = f"{texts.iloc[int(np.argmax(bad))]!r} is not the id of a vehicle"
        remedy = "write the number of the leader there, or leave it empty"
        column = spelling.get("leader_id", "leader_id")
        raise bad_recording("value-unreadable", text, remedy, file, column=column, row=source_row(rows, bad))
    return rows.assign(leader_id=numbers.mask(is_absent(numbers.to_numpy(), tracks)))


def _require_all_digits(texts: pd.Series, rows: pd.DataFrame, file: str, column: str) -> None:
    """Raise BadRecordingError if ids such as 1.0e+17 lack digits and are those of several vehicles at a time."""
    parts = texts.str.extract(_ROUNDED)
    exponent = numbers_of(parts["exponent"].fillna("0"))
    rounded = exponent > numbers_of(parts["fraction"].str.len().fillna(0))
    clocks = [rows[name] for name in ("frame", "time") if name in rows][:1]
    if not rounded.any() or not clocks:
        return
    twice = rounded & pd.concat([texts, *clocks], axis=1).duplicated().to_numpy()
    if twice.any():
        example = texts.iloc[int(np.argmax(twice))]
        text = f"ids have lost digits: {example} is written for several vehicles at the same time"
        remedy = "write the ids in full, as whole numbers or texts"
        raise bad_recording("ids-rounded", text, remedy, file, column=column, row=source_row(rows, twice))


def _require_exact_leaders(leaders: pd.Series, file: str, column: str) -> None:
    """Raise BadRecordingError for leaders that are float64 numbers too large to be exact, as of a column with gaps."""
    if not pd.api.types.is_float_dtype(leaders.dtype):
        return
    size = leaders.abs().to_numpy(np.float64, na_value=np.nan)
    inexact = (size > MAX_EXACT_ID) & ~is_placeholder(size)
    if inexact.any():
        text = "ids of leaders have lost digits: the column holds float64 numbers beyond 2^53"
        remedy = "write them in full, as whole numbers or texts"
        raise bad_recording("ids-rounded", text, remedy, file, column=column, row=source_row(leaders, inexact))


def _texts(ids: pd.Series) -> pd.Series | None:
    """The ids as texts; None if they are numbers that stay as they are."""
    if pd.api.types.is_integer_dtype(ids.dtype):
        return _as_texts(ids) if (ids.abs() > MAX_EXACT_ID).any() else None
    return None if pd.api.types.is_numeric_dtype(ids.dtype) else _as_texts(ids)


def _as_texts(ids: pd.Series) -> pd.Series:
    known = ids.notna().to_numpy()
    if pd.api.types.is_float_dtype(ids.dtype) and (np.isfinite(ids[known]) & (ids[known] == np.rint(ids[known]))).all():
        whole = [int(number) if is_known else 0 for number, is_known in zip(ids, known, strict=True)]
        ids = pd.Series(whole, ids.index, object)  # 7 is written 7, not 7.0
    texts = pd.Series(np.full(len(ids), None, dtype=object), index=ids.index)
    texts[known] = pd.Series(ids[known]).astype(str).str.strip()
    return pd.Series(texts.where(texts != "", None))


def _whole_numbers(texts: pd.Series) -> np.ndarray:
    """Whole numbers up to MAX_EXACT_ID, NaN for other texts."""
    numbers = numbers_of(texts)
    fits = np.isfinite(numbers) & (np.abs(numbers) <= MAX_EXACT_ID)
    return np.where(fits & (numbers == np.rint(np.where(fits, numbers, 0.0))), numbers, np.nan)


def _are_distinct(texts: pd.Series, numbers: np.ndarray) -> bool:
    """True if different ids are different numbers; 12 and 12.0 are the same id, 7 and 007 are not."""
    plain = texts.str.replace(r"\.0*$", "", regex=True)
    return plain.nunique() == np.unique(numbers).size


def _kind(texts: pd.Series, is_number: np.ndarray) -> str:
    """Description of ids that have to be numbered."""
    if is_number.all():
        return "numbers with leading zeros"
    is_beyond = is_number.any() or texts.str.fullmatch(r"[+-]?\d+(\.0*)?").all()
    return "numbers beyond 2^53" if is_beyond else "names"
