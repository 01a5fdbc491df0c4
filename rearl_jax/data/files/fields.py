"""Fields of a line of a text table: delimiters, quotes and marks of unknown values."""

import csv
import re
from collections.abc import Sequence

BLANKS = " "
"""Delimiter that means any number of blanks."""
UNKNOWN = (
    *("", "NA", "N/A", "n/a", "#N/A", "#N/A N/A", "#NA", "NULL", "Null", "null", "None", "NONE", "none", "<NA>", "nil"),
    *("NaN", "NAN", "nan", "-NaN", "-nan", "1.#QNAN", "-1.#QNAN", "1.#IND", "-1.#IND"),  # with #: C libraries
    *("-", "--", "---", ".", "?", "#DIV/0!", "#VALUE!", "#NUM!", "#REF!", "#NV", "#WERT!"),  # with #: spreadsheets
)
"""Fields that stand for an unknown value."""
_SINGLE_QUOTED = re.compile(r"'[^']*'")


def fields_of(line: str, delimiter: str) -> list[str]:
    """The fields of a line, without single or double quotes and without blanks around them."""
    if delimiter == BLANKS:
        return line.split()
    try:
        found = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        return line.split(delimiter)
    fields = [field.strip() for field in found]
    return [field[1:-1] if _SINGLE_QUOTED.fullmatch(field) else field for field in fields] if "'" in line else fields


def quote_of(header: str, rows: Sequence[str], delimiter: str) -> str:
    """A single quote if it encloses fields: no line has a double quote, and all lines then have as many fields as the
    header; else a double quote.

    Raises:
        csv.Error: A line has single quotes, and a field that is too long to be one.
    """
    lines = [line for line in (header, *rows) if line.strip()]
    if delimiter == BLANKS or any('"' in line for line in lines) or not any("'" in row for row in rows):
        return '"'
    fields = [next(csv.reader([line], delimiter=delimiter, quotechar="'", skipinitialspace=True)) for line in lines]
    enclosed = [sum(f"'{field}'" in line for field in row) for line, row in zip(lines, fields, strict=True)]
    are_all = all(line.count("'") <= 2 * n for line, n in zip(lines, enclosed, strict=True))
    return "'" if are_all and len(set(map(len, fields))) == 1 else '"'
