"""The head of a CSV table: what stands above its rows of numbers, and how they are written.

Exports of drives and spreadsheets begin with remarks, the names of columns, and often a line of their units.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from service.can.user_errors import RecordError

_SAMPLE_LINES = 300
"""By which it is seen where the numbers begin, and how numbers and dates are written."""
_BELOW_NAMES = 3
"""At most so many lines stand between the names and the numbers: units, descriptions."""
_DECIMAL_COMMA, _DECIMAL_POINT = (
    re.compile(r"\s*[-+]?\d+,\d+([eE][-+]?\d+)?\s*"),
    re.compile(r"\s*[-+]?\d*\.\d+([eE][-+]?\d+)?\s*"),
)
_GERMAN_DAY = re.compile(r"(\d\d?)\.(\d\d?)\.(\d{4}),?\s+")
_BEFORE_ZONE = re.compile(r"\s+(?=([-+]\d\d:?\d\d|Z)$)")
_FEWEST_TIMES = 3
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\ufffd]")
_REMARK = ("#", "%")


class Head(NamedTuple):
    """What stands above the numbers; ``lines``: how many lines that is."""

    encoding: str
    delimiter: str
    lines: int
    names: tuple[str, ...] | None
    """None: the table has numbers only"""
    units: Mapping[str, str]
    """Of the columns, by name, where a line below the names has them"""
    width: int
    """Cells in a row"""
    sample: tuple[tuple[str, ...], ...]
    """The first rows"""

    @property
    def decimal_mark(self) -> str:
        """Of the numbers in the first rows."""
        cells = [cell for row in self.sample for cell in row]
        commas = any(_DECIMAL_COMMA.fullmatch(cell) for cell in cells)
        return "," if commas and not any(_DECIMAL_POINT.fullmatch(cell) for cell in cells) else "."

    def dates(self, names: Sequence[str]) -> set[str]:
        """The columns that hold dates or times of day in the first rows."""
        return {name for row in self.sample for name, cell in zip(names, row, strict=False) if _is_date(cell)}

    def keys(self) -> tuple[int, int] | None:
        """Places of two columns, the first of which has each value in a row for each value of the second; else None."""
        columns = list(zip(*(row for row in self.sample if len(row) == self.width), strict=True))
        for time, cells in enumerate(columns):
            ends = [k for k in range(1, len(cells)) if cells[k] != cells[k - 1]]
            size = ends[0] if len(ends) >= _FEWEST_TIMES else 1
            if size == 1 or ends != list(range(size, len(cells), size)):
                continue
            for key, names in enumerate(columns):
                each = {tuple(sorted(names[end - size : end])) for end in ends}
                if len(each) == 1 and len(set(*each)) == size:
                    return time, key
        return None


def read_head(path: Path) -> Head:
    """The head of a file.

    Raises:
        OSError: it cannot be read.
        RecordError: it is no text, or its first line is empty.
    """
    with path.open("rb") as file:
        encoding = _encoding(file.read(1 << 16))
    with path.open(encoding=encoding, errors="replace", newline="") as text:
        lines = list(islice(text, _SAMPLE_LINES))
    if not any(map(str.strip, lines)):
        raise RecordError(f"{path}: the first line must hold names of columns, or numbers; it is empty")
    if any(_CONTROL.search(line) for line in lines[:1]):
        raise RecordError(f"{path} is no CSV file: its first line is no text")
    return head_of(lines, encoding)


def head_of(lines: Sequence[str], encoding: str = "utf-8-sig") -> Head:
    """The head of a table whose first lines these are."""
    delimiter = _delimiter(lines)
    reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=True)
    rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if row]
    widths = Counter(len(row) for _, row in rows if _has_numbers(row))
    width = widths.most_common(1)[0][0] if widths else len(rows[0][1])
    fitting = [(k, row) for k, (_, row) in enumerate(rows) if len(row) == width]
    first = next((k for k, row in fitting if _has_numbers(row)), len(rows))
    words = [(k, row) for k, row in fitting if k < first and _could_be_names(row)]
    above = [(k, row) for k, row in words if not row[0].startswith(_REMARK)] or words
    if not above and first > 0 and not rows[0][1][0].startswith(_REMARK):
        # Names of another number than the cells below: a fault of the table.
        above, width = [(0, rows[0][1])], len(rows[0][1])
    if not above:
        start = rows[first - 1][0] if first else 0
        return Head(encoding, delimiter, start, None, {}, width, _cells(rows[first:]))
    at, names = above[0]
    names = [names[0].lstrip("".join(_REMARK) + " ") or names[0], *names[1:]]
    first = first if first <= at + 1 + _BELOW_NAMES else at + 1
    units = next((row for _, row in rows[at + 1 : first] if len(row) == width), [])
    known = {name: unit.strip("[]() ") for name, unit in zip(names, units, strict=False)}
    return Head(encoding, delimiter, rows[first - 1][0], tuple(names), known, width, _cells(rows[first:]))


def is_number(cell: str) -> bool:
    """Whether a cell with a decimal point is one."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def seconds_of(cell: str) -> float | None:
    """Seconds since 1970, or since midnight where it is a time of day; None: the cell holds neither."""
    text = _BEFORE_ZONE.sub("", _GERMAN_DAY.sub(_iso_day, cell.strip()))
    try:
        date = datetime.fromisoformat(text if "-" in text[:10] else f"1970-01-01 {text}")
    except ValueError:
        return None
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()


def _iso_day(day: re.Match[str]) -> str:
    return f"{day[3]}-{day[2]:0>2}-{day[1]:0>2} "


def _encoding(start: bytes) -> str:
    """Of a text that begins so: of a spreadsheet in Windows, where it is not UTF-8."""
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if start[1:2] == b"\0":
        return "utf-16-le"
    lines = [line for line in start.split(b"\n")[:-1] or [start] if not line.isascii()]
    return "utf-8-sig" if any(map(_is_utf8, lines)) or not lines else "cp1252"


def _is_utf8(line: bytes) -> bool:
    try:
        line.decode()
    except UnicodeDecodeError:
        return False
    return True


def _delimiter(lines: Sequence[str]) -> str:
    """The first of tab, semicolon and comma that half of the lines have."""
    full = [line for line in lines if line.strip()]
    return next((d for d in "\t;," if 2 * sum(d in line for line in full) >= len(full)), ",")


def _is_date(cell: str) -> bool:
    return ":" in cell and seconds_of(cell) is not None


def _has_numbers(row: Sequence[str]) -> bool:
    """Whether a row holds a number or a date; "1" may be a unit."""
    numbers = [is_number(cell.replace(",", ".")) or _is_date(cell) for cell in row if cell]
    return any(numbers) and (all(numbers) or any(n and cell != "1" for n, cell in _with(numbers, row)))


def _with(numbers: Sequence[bool], row: Sequence[str]) -> Iterable[tuple[bool, str]]:
    return zip(numbers, [cell for cell in row if cell], strict=True)


def _could_be_names(row: Sequence[str]) -> bool:
    """Whether most cells of a row have something: remarks of a spreadsheet end with empty ones."""
    return 2 * sum(map(bool, row)) > len(row)


def _cells(rows: Sequence[tuple[int, list[str]]]) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(row) for _, row in rows)
