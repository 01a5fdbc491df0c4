"""Times that are written as text: dates with a time of day, times of day, or numbers."""

from datetime import UTC, datetime

import numpy as np
import pandas as pd

from rearl_jax.data.problems import bad_recording, source_row

_DAYS = ("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%Y/%m/%d", "%Y.%m.%d", "%Y%m%d")
_CLOCKS = ("%H:%M:%S.%f", "%I:%M:%S.%f %p")
_FORMATS = (*(f"{day} {clock}" for day in _DAYS for clock in _CLOCKS), *_CLOCKS, "%M:%S.%f")
_CYCLES = {**dict.fromkeys(_CLOCKS, 86400.0), "%M:%S.%f": 3600.0}
"""Time after which times of day without a date restart [s]: a day, or an hour for minutes and seconds."""
_NEAR_END = 0.1  # share of that time; a recording that passes the restart has times so near to it before and after
_NO_DAY = datetime(1900, 1, 1, tzinfo=UTC).timestamp()  # s; date that pandas gives to times of day
_OFFSET = r":\d\d(?:\.\d+)?\s*(?:[Zz]|[+-]\d\d(?::?\d\d)?)$"
"""End of a time that states its offset from UTC, such as :00Z or :00.5+02:00."""
_MAX_DAMAGED_SHARE = 0.05
"""Share of the times that may be unreadable before the column is not a column of times."""


def seconds_of(times: pd.Series, file: str, column: str) -> tuple[pd.Series, str | None]:
    """Texts as numbers, or as seconds since 1970 (or midnight) if they are dates and times; and how they are written.

    The second value is None for numbers. The index of the texts holds the row numbers of the source.

    Raises:
        BadRecordingError: One of them cannot be read, only some state their offset from UTC, or day and month cannot be
            distinguished although it matters.
    """
    texts = times.astype(str).str.strip().where(times.notna(), None)
    numbers = pd.Series(pd.to_numeric(texts.str.replace(",", ".", regex=False), errors="coerce"), index=times.index)
    n_known = int(texts.notna().sum())
    if numbers.notna().sum() >= (1.0 - _MAX_DAMAGED_SHARE) * n_known:
        _require_all(texts, numbers.notna(), "a number", file, column)
        return numbers.astype(np.float64), None
    # A fraction is added to whole seconds, so that one format reads both.
    plain = texts.str.replace(r"(:\d+),(\d+)", r"\1.\2", regex=True)
    # Except after the minutes of an offset from UTC such as +02:00.
    plain = plain.str.replace(r"(?<![+-]\d\d)(:\d\d)(\s*[AaPp][Mm])?$", r"\1.0\2", regex=True)
    plain = plain.str.replace(r"(\.\d{6})\d+", r"\1", regex=True)
    found = {form: _parsed(plain, form) for form in ("ISO8601", *_FORMATS)}
    counts = {form: int(values.notna().sum()) for form, values in found.items()}
    best = max(counts, key=lambda form: counts[form])
    if counts[best] < (1.0 - _MAX_DAMAGED_SHARE) * n_known:
        example = next((text for text in texts if text is not None), "")
        text = f"{example!r} is not a number, and no date and time that is known"
        remedy = "write the time in s, or as 2024-05-31T08:00:00.25"
        raise bad_recording("time-unreadable", text, remedy, file, column=column)
    _require_all(texts, found[best].notna(), f"a time as the others are ({best})", file, column)
    has_offset = texts.str.contains(_OFFSET)[texts.notna()].astype(bool)
    if has_offset.nunique() > 1:
        text = "some times state their offset from UTC, and others do not"
        row = source_row(has_offset, (has_offset != has_offset.iloc[0]).to_numpy())
        raise bad_recording("time-ambiguous", text, "write all with it, or all without", file, column=column, row=row)
    rivals = [form for form in counts if counts[form] == counts[best] and form != best]
    for form in rivals:
        if not np.allclose(np.diff(found[form].to_numpy()), np.diff(found[best].to_numpy()), equal_nan=True):
            text = f"the times can be read as {best} and as {form}"
            remedy = "write the dates as 2024-05-31"
            raise bad_recording("time-ambiguous", text, remedy, file, column=column)
    cycle = _CYCLES.get(best)
    if cycle is None or (continued := _past_the_end(found[best], cycle)) is None:
        return found[best], best
    return continued, f"{best}, which begins anew on the way"


def _past_the_end(seconds: pd.Series, cycle: float) -> pd.Series | None:
    """Times of day that continue to rise after the end of the day, or of the hour; None if they do not pass it."""
    known = np.unique(seconds.dropna().to_numpy())
    if not known.size or known[0] > _NEAR_END * cycle or known[-1] < (1.0 - _NEAR_END) * cycle:
        return None
    gaps = np.diff(known)
    widest = int(np.argmax(gaps)) if gaps.size else 0
    if not gaps.size or gaps[widest] <= 0.5 * cycle:
        return None
    return seconds.mask(seconds <= known[widest], seconds + cycle)


def is_moment(texts: pd.Series) -> bool:
    """True if a few texts are dates and times."""
    try:
        return seconds_of(texts, "", "")[1] is not None
    except ValueError:
        return False


def _parsed(texts: pd.Series, form: str) -> pd.Series:
    """Seconds since 1970, or since midnight for times of day; NaN where the format does not fit."""
    moments = pd.Series(pd.to_datetime(texts, format=form, errors="coerce", utc=True), index=texts.index)
    seconds = (moments - pd.Timestamp(0, tz="UTC")) / pd.Timedelta(seconds=1)
    if "%d" not in form and form != "ISO8601":
        seconds = seconds - _NO_DAY
    return seconds.astype(np.float64)


def _require_all(texts: pd.Series, is_read: pd.Series, expected: str, file: str, column: str) -> None:
    """Raise BadRecordingError for the first text that is known and was not read as what is expected."""
    bad = (texts.notna() & ~is_read).to_numpy()
    if bad.any():
        text, remedy = f"{texts.iloc[int(np.argmax(bad))]!r} is not {expected}", "correct the time"
        raise bad_recording("value-unreadable", text, remedy, file, column=column, row=source_row(texts, bad))
