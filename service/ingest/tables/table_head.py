"""Reads the head of a CSV table: the lines above the numbers, and the format of the numbers.

Exports of drives and spreadsheets start with remarks, the names of the columns, and often a line of units.
"""

import csv
import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import combinations, islice, takewhile
from pathlib import Path
from typing import NamedTuple

from service.can.user_errors import RecordError
from service.ingest.roles_by_name import is_axis
from service.ingest.tables.table_cells import DAY, FLAGS, GROUPED, HALF_DAY, OTHER_MARK, is_date, is_number_or_date

_SAMPLE_LINES = 300
"""Lines read to find where the numbers start, and the format of numbers and dates."""
_BELOW_NAMES = 16
"""Most lines between the names and the numbers: units, descriptions; the scope of TwinCAT has so many."""
_DECIMAL_COMMA = re.compile(r"\s*[-+]?\d+,\d+([eE][-+]?\d+)?\s*")
_DECIMAL_POINT = re.compile(r"\s*[-+]?\d*\.\d+([eE][-+]?\d+)?\s*")
_THREE_DIGITS = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")
_FEWEST_TIMES = 3
_MONTHS = 12
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\ufffd]")
_REMARK = ("#", "%")
_INFLUX_OTHERS = {"_time", "_value", "_start", "_stop", "result", "table"}
"""Columns of InfluxDB that name no signal"""
UNIT_NAMES = ("unit", "units", "einheit")
"""Names of a column of units"""


class LongKeys(NamedTuple):
    """The columns of a table with a row for each time and each signal or axis."""

    time: str
    names: tuple[str, ...]
    """Those that name the signal or axis, and perhaps others of texts"""
    value: str | None = None
    """That of the numbers; None: all others"""


class Head(NamedTuple):
    """The head of a table; ``lines``: number of lines above the numbers."""

    encoding: str
    delimiter: str
    lines: int
    names: tuple[str, ...] | None
    """None: the table has numbers only"""
    units: Mapping[str, str]
    """Units of the columns by name, if a line below the names has them"""
    width: int
    """Cells in a row"""
    sample: tuple[tuple[str, ...], ...]
    """The first rows"""
    empty: tuple[str, ...] = ()
    """Names behind the last cell of the rows"""

    @property
    def _cells(self) -> list[str]:
        return [cell for row in self.sample for cell in row]

    @property
    def decimal_mark(self) -> str:
        """The decimal mark of the numbers in the first rows."""
        cells = self._cells
        for mark, other in OTHER_MARK.items():
            if any((mark in c or c.count(other) > 1) and GROUPED[mark].fullmatch(c) for c in cells):
                return mark
        commas = any(_DECIMAL_COMMA.fullmatch(cell) for cell in cells)
        return "," if commas and not any(_DECIMAL_POINT.fullmatch(cell) for cell in cells) else "."

    @property
    def day_first(self) -> bool:
        """Whether 01/02/2026 is 1 February: if the rows show it, or, if they do not, with a 24-hour clock."""
        days = self._slashed_days
        if any(int(second) > _MONTHS for _, second in days):
            return False
        return any(int(first) > _MONTHS for first, _ in days) or not any(map(HALF_DAY.search, self._cells))

    @property
    def _slashed_days(self) -> list[tuple[str, str]]:
        found = filter(None, map(DAY.match, self._cells))
        return [(day[1], day[3]) for day in found if day[2] == "/"]

    @property
    def taken(self) -> tuple[str, ...]:
        """Assumptions about dates and numbers that are ambiguous in the first rows."""
        words, days = list[str](), self._slashed_days
        if days and max(int(number) for day in days for number in day) <= _MONTHS:
            order = "day/month" if self.day_first else "month/day"
            words.append(f"dates such as {'/'.join(days[0])}/... are taken as {order}/year")
        commas = list(filter(_DECIMAL_COMMA.fullmatch, self._cells if self.decimal_mark == "," else []))
        if commas and all(map(_THREE_DIGITS.fullmatch, commas)):
            words.append(
                f"{commas[0]} is taken as {commas[0].replace(',', '.')}; if commas separate thousands, leave them out"
            )
        if any(self.empty):
            words.append(f"the rows end before the names: no cells are taken as those of {', '.join(self.empty)}")
        return tuple(words)

    def dates(self, names: Sequence[str]) -> set[str]:
        """The columns that hold dates or times of day in the first rows."""
        return {name for row in self.sample for name, cell in zip(names, row, strict=False) if is_date(cell)}

    def flags(self, names: Sequence[str]) -> set[str]:
        """The columns that hold TRUE and FALSE in the first rows."""
        return {name for row in self.sample for name, cell in zip(names, row, strict=False) if cell.lower() in FLAGS}

    def keys(self, times: Collection[str]) -> LongKeys | None:
        """The columns with the time and the names if a time has a row for each signal or axis; otherwise None.

        ``times``: columns that may be the time.  The rows are sorted by time, or by signal: then only one column
        besides the time and the number of the axis has numbers, and at least one has texts.
        """
        cells_of = zip(*(row for row in self.sample if len(row) == self.width), strict=True)
        columns = dict(zip(self.names or (), cells_of, strict=False))
        if columns.keys() >= {"_time", "_field", "_value"}:
            tags = (name for name in columns if name and not name[:1].isdigit() and name not in _INFLUX_OTHERS)
            return LongKeys("_time", tuple(tags), "_value")
        for time in (name for name in columns if name in times):
            cells = columns[time]
            ends = [k for k in range(1, len(cells)) if cells[k] != cells[k - 1]]
            size = ends[0] if len(ends) >= _FEWEST_TIMES else 1
            if size > 1 and ends == list(range(size, len(cells), size)):
                groups = {name: [cells[end - size : end] for end in ends] for name, cells in columns.items()}
                if (names := self._distinct_in_each(groups, size)) is not None:
                    return LongKeys(time, names)
            texts = [name for name in columns if name != time and self.is_text(name)]
            numbers = [name for name in columns if name != time and len(set(columns[name])) == 1 and is_axis(name)]
            if texts and len({*columns} - {*texts, *numbers}) == 2:
                return LongKeys(
                    time, tuple(n for n in columns if n in {*texts, *numbers} and n.lower() not in UNIT_NAMES)
                )
        return None

    def _distinct_in_each(self, groups: Mapping[str, Sequence[Sequence[str]]], size: int) -> tuple[str, ...] | None:
        """A column, or two of which one has texts, with the same cells in all groups of ``size`` rows, no cell twice.

        ``groups``: cells of the rows of each group, by column.
        """
        same = [name for name, cells in groups.items() if len({tuple(sorted(group)) for group in cells}) == 1]
        alone = ((name,) for name in same)
        two = (pair for pair in combinations(same, 2) if any(map(self.is_text, pair)))
        for names in (*alone, *two):
            each = {
                frozenset(zip(*group, strict=True)) for group in zip(*(groups[name] for name in names), strict=True)
            }
            if len(each) == 1 and len(next(iter(each))) == size:
                return names
        return None

    def is_text(self, name: str) -> bool:
        """Whether a column has only texts in the first rows."""
        at = (self.names or ()).index(name)
        cells = [row[at] for row in self.sample if at < len(row) and row[at]]
        return bool(cells) and not any(map(is_number_or_date, cells))


def read_head(path: Path) -> Head:
    """The head of a file.

    Raises:
        OSError: the file cannot be read.
        RecordError: the file is no text, or is empty.
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


_Row = tuple[int, list[str]]
"""The number of the line in which a row ends, and its cells"""


def head_of(lines: Sequence[str], encoding: str = "utf-8-sig") -> Head:
    """The head of a table from its first lines."""
    delimiter = _delimiter(lines)
    rows = _rows(lines, delimiter)
    width, first = _numbers_in(rows)
    above = _rows_of_names(rows, width, first)
    if not above and first > 0 and not rows[0][1][0].startswith(_REMARK):
        # The number of names differs from the number of cells below: a fault of the table.
        above, width = [(0, rows[0][1])], len(rows[0][1])
    if not above:
        start = rows[first - 1][0] if first else 0
        return Head(encoding, delimiter, start, None, {}, width, _cells(rows[first:]))
    # Names differ, and are no numbers if they need not be.
    at, names = max(above, key=lambda place: (not _has_numbers(place[1]), len({*place[1]} - {""})))
    names = [names[0].lstrip("".join(_REMARK) + " ") or names[0], *names[1:]]
    first = first if first <= at + 1 + _BELOW_NAMES else at + 1
    below = [row for _, row in rows[at + 1 : first] if len(row) == width]
    if names[0] and not all(names) and below and all(below[0]):  # "Axis 1", "" above "Position", "Torque"
        groups = [next(filter(None, names[place::-1])) for place in range(width)]
        names = [f"{group} {name}" for group, name in zip(groups, below.pop(0), strict=True)]
    units = next(iter(below), [])
    distinct, empty = _distinct(names[:width]), tuple(names[width:])
    known = {name: unit.strip("[]() ") for name, unit in zip(distinct, units, strict=False)}
    return Head(encoding, delimiter, rows[first - 1][0], distinct, known, width, _cells(rows[first:]), empty)


def _rows(lines: Sequence[str], delimiter: str) -> list[_Row]:
    """The rows that are not empty."""
    text = map(str.rstrip, lines) if delimiter == " " else lines
    reader = csv.reader(text, delimiter=delimiter, skipinitialspace=True)
    rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if row]
    if delimiter == " ":  # "# t torque"
        rows = [(line, row[1:] if row[0] in _REMARK and row[1:] else row) for line, row in rows]
    return rows


def _numbers_in(rows: Sequence[_Row]) -> tuple[int, int]:
    """The usual number of cells in a row of numbers, and the place of the first such row."""
    numeric = [(k, row) for k, (_, row) in enumerate(rows) if _has_numbers(row)]
    if not numeric:
        return len(rows[0][1]), len(rows)
    width = Counter(len(row) for _, row in numeric).most_common(1)[0][0]
    # A line above the table may hold a number behind a word, such as "Offset 0".
    words = [(k, _words_before_numbers(row)) for k, row in numeric if len(row) == width]
    usual = Counter(count for _, count in words).most_common(1)[0][0]
    return width, next(k for k, count in words if count <= usual)


def _rows_of_names(rows: Sequence[_Row], width: int, first: int) -> list[tuple[int, list[str]]]:
    """Rows above the numbers that may be the names of the columns, with their places; the first of these kinds.

    As many names as cells, in no remark, then in one; more names, such as the "Comment" of LabVIEW, whose column has no
    cells; one name less, where rows end with a separator.
    """
    cells = [(k, row) for k, (_, row) in enumerate(rows[:first])]
    words = [(k, row) for k, row in cells if _could_be_names(row)]
    fitting = [(k, row) for k, row in words if len(row) == width]
    plain_text = [(k, row) for k, row in fitting if not row[0].startswith(_REMARK)]
    found = plain_text or fitting or [(k, row) for k, row in words if len(row) > width]
    if not found and not any(row[-1] for _, row in rows[first:] if len(row) == width):
        found = [(k, [*row, ""]) for k, row in cells if len(row) == width - 1]
    return found


def _encoding(start: bytes) -> str:
    """The encoding of a text from its first bytes; cp1252, as of spreadsheets in Windows, if it is not Unicode."""
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
    """The first of tab, semicolon, bar, comma that half of the lines have; a space if half are numbers with spaces."""
    full = [line.strip("\r\n") for line in lines if line.strip()]
    shares = {d: sum(d in line for line in full) for d in "\t;|,"}
    cells = [line.split() for line in full]
    shares[" "] = sum(len(row) > 1 and 2 * sum(map(is_number_or_date, row)) >= len(row) for row in cells)
    return next((d for d, count in shares.items() if 2 * count >= len(full)), ",")


def _has_numbers(row: Sequence[str]) -> bool:
    """Whether a row has a number or a date; a lone "1" may be a unit."""
    cells = [cell for cell in row if cell]
    numbers = list(filter(is_number_or_date, cells))
    return bool(numbers) and (len(numbers) == len(cells) or any(cell != "1" for cell in numbers))


def _words_before_numbers(row: Sequence[str]) -> int:
    """Number of filled cells before the first number of a row."""
    return sum(map(bool, takewhile(lambda cell: not is_number_or_date(cell), row)))


def _distinct(names: Iterable[str]) -> tuple[str, ...]:
    """Names of columns: an empty one is that of its place, and the second "x" is called "x_2"."""
    found: dict[str, None] = {}
    for place, name in enumerate(names):
        same = (name or str(place), *(f"{name}_{k}" for k in range(2, place + 2)))
        found[next(other for other in same if other not in found)] = None
    return tuple(found)


def _could_be_names(row: Sequence[str]) -> bool:
    """Whether most cells of a row are filled; remarks of a spreadsheet end with empty cells."""
    return 2 * sum(map(bool, row)) > len(row)


def _cells(rows: Sequence[tuple[int, list[str]]]) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(row) for _, row in rows)
