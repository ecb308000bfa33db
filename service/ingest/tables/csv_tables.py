"""CSV tables.

A date with a time of day is read as seconds since 1970, in UTC if it names no time zone.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc

from monitor_core.arrays import Floats
from service.can.user_errors import RecordError, too_many
from service.ingest.roles_by_name import role_of
from service.ingest.tables.table_cells import is_number, plain, seconds_of
from service.ingest.tables.table_head import UNIT_NAMES, read_head

ROWS = 8192
"""Rows of a block"""
_BLOCK_BYTES = 1 << 20
_EMPTY = ["", "NA", "N/A", "#N/A", "null", "NULL", "NaN", "nan"]


_LISTS = ("[", "(", "{", "array(")
"""Starts of cells with several values, as programs write lists, tuples and arrays"""


class CsvRows(NamedTuple):
    """Columns by name, with NaN for an empty cell; ``done``: part of the file that has been read, 0 to 1."""

    columns: Mapping[str, Floats]
    done: float


def in_blocks(columns: Mapping[str, Floats]) -> Iterator[CsvRows]:
    """The rows of columns of equal length (N,), in blocks."""
    total = len(next(iter(columns.values())))
    for i in range(0, total, ROWS):
        block = {name: column[i : i + ROWS] for name, column in columns.items()}
        yield CsvRows(block, min(1.0, (i + ROWS) / total))


class CsvTable:
    """A CSV file.  Without a line of names, the columns are called "0", "1", ...

    Cells are separated by tabs, semicolons, bars, commas or spaces.  If not by commas, numbers may have a decimal
    comma.

    Raises:
        RecordError: the file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._head = read_head(path)
        except OSError as error:
            raise RecordError(f"cannot read {path}: {error.strerror}") from None
        names = self._head.names
        self.has_names = names is not None
        self.names: Sequence[str] = tuple(map(str, range(self._head.width))) if names is None else names
        """Names of all columns"""
        """Units of the columns by name, if a line below the names has them"""
        self._decimal, self._day_first = self._head.decimal_mark, self._head.day_first
        self.taken = self._head.taken
        """Assumptions about ambiguous dates and numbers, in words"""
        self.dates = self._head.dates(self.names)
        """The columns of dates or times of day"""
        self.units = {**self._head.units, **dict.fromkeys(self.dates, "s")}
        self._flags = self._head.flags(self.names)
        self.keys = self._head.keys({*self.dates, *(name for name in self.names if role_of(name) == "time")})
        """If a time has several rows: the columns with the time, and with the names of signals and axes; otherwise
        None"""
        self.texts = [name for name in self.names if self.keys and self._head.is_text(name)]
        """If a time has several rows: the columns of texts"""
        self.unit = next((name for name in self.texts if name.lower() in UNIT_NAMES), None)
        """If a time has several rows: the column of units"""
        self.labels: dict[str, float] = {}
        """The numbers that ``rows`` returns for texts in the columns of names and units"""
        self.left_out: list[str] = []
        """Lines that could not be read, with line number and fault; complete when all rows have been read"""

    def rows(self, names: Sequence[str]) -> Iterator[CsvRows]:
        """Read the rows of these columns, which must exist, in blocks.

        A torn last line is left out, and so are unreadable lines, up to one in a hundred; see ``left_out``.

        Raises:
            RecordError: too many cells are no numbers, or the file is damaged.
        """
        size, read = max(1, self._path.stat().st_size), 0
        with self._path.open("rb") as file:
            try:
                for batch in self._reader(file, names):
                    columns = {name: self._column(name, batch) for name in names}
                    read += batch.num_rows
                    yield CsvRows(columns, min(1.0, file.tell() / size))
                return
            except pa.ArrowException:
                pass  # a faulty line, which must be named, or thousands separators
        yield from self._rows_by_line(names, read)

    def _column(self, name: str, batch: pa.RecordBatch) -> Floats:
        column = batch.column(name)
        if not pa.types.is_string(column.type):
            return numbers(column)
        cells = column.fill_null("").dictionary_encode()
        try:
            known = np.array([self._number(name, cell or "") for cell in cells.dictionary.to_pylist()], np.float64)
        except ValueError as error:
            raise pa.ArrowInvalid(str(error)) from None
        return np.asarray(known[cells.indices.to_numpy()])

    def _rows_by_line(self, names: Sequence[str], skipped: int) -> Iterator[CsvRows]:
        """Read the remaining rows line by line, after arrow has failed; this is slower.

        ``skipped``: rows already read.
        """
        found, torn, read, cells = list[str](), list[str](), 0, list[list[float]]()
        for line, row, ends in self._lines():
            if fault := self._fault(row, names):
                cut = ends and len(row) <= len(self.names)
                (torn if cut else found).append(f"line {line}: {fault}")
                if too_many(len(found), read):
                    break
                continue
            read += 1
            if read > skipped:
                cells.append([self._number(name, row[self.names.index(name)]) for name in names])
            if len(cells) == ROWS:
                yield self._block(names, cells)
                cells = []
        if too_many(len(found), read, ended=True):
            raise RecordError(f"{self._path}, {found[0]}")
        self.left_out = [*found, *torn]
        if cells:
            yield self._block(names, cells)

    @staticmethod
    def _block(names: Sequence[str], cells: list[list[float]]) -> CsvRows:
        return CsvRows(dict(zip(names, np.array(cells, np.float64).T, strict=True)), 1.0)

    def _lines(self) -> Iterator[tuple[int, list[str], bool]]:
        """Each non-empty line below the names: its number, its cells, and whether the file ends within it."""
        with self._path.open("rb") as file:
            file.seek(-min(2, self._path.stat().st_size), 2)
            cut = file.read().rstrip(b"\0")[-1:] not in (b"\n", b"\r")
        with self._path.open(encoding=self._head.encoding, errors="replace", newline="") as text:
            spaced = self._head.delimiter == " "
            lines = map(str.rstrip, text) if spaced else text
            reader = csv.reader(lines, delimiter=self._head.delimiter, skipinitialspace=spaced)
            before: tuple[int, list[str]] | None = None
            for row in reader:
                if not row or reader.line_num <= self._head.lines or self._is_head(row):
                    continue
                if before is not None:
                    yield *before, False
                before = reader.line_num, row
            if before is not None:
                yield *before, cut

    def _is_head(self, row: Sequence[str]) -> bool:
        """Whether a line is a remark, or has the names of the columns again, above a further series of a database."""
        again = self.keys is not None and row[-1] == self.names[-1] and row[1:] == list(self.names[1:])
        return row[0].startswith("#") or again

    def _reader(self, file: BinaryIO, names: Sequence[str]) -> pc.CSVStreamingReader:
        return pc.open_csv(
            _single_spaced(file) if self._head.delimiter == " " else file,
            pc.ReadOptions(
                column_names=list(self.names),
                skip_rows=self._head.lines,
                block_size=_BLOCK_BYTES,
                encoding=self._head.encoding.removesuffix("-sig"),
            ),
            pc.ParseOptions(delimiter=self._head.delimiter),
            pc.ConvertOptions(
                column_types={n: pa.string() if self._as_text(n) else pa.float64() for n in names},
                include_columns=list(names),
                null_values=_EMPTY,
                strings_can_be_null=True,
                decimal_point=self._decimal,
            ),
        )

    def _fault(self, row: Sequence[str], names: Sequence[str]) -> str:
        """The fault of a line; empty: none."""
        if len(row) != len(self.names):
            return f"{len(row)} cells in a table of {len(self.names)} columns"
        for name in names:
            cell = row[self.names.index(name)]
            number, is_date = plain(cell, self._decimal), name in self.dates
            date = seconds_of(cell, self._day_first) if is_date else None
            if not (cell in _EMPTY or self._is_key(name) or is_number(number) or date is not None):
                hint = ": write decimal points" if is_number(cell.replace(",", ".")) else ""
                hint = ": write a date as 2026-03-02 08:00:00.005" if ":" in cell else hint
                hint = ": give each of its values a column" if cell.startswith(_LISTS) else hint
                kind = "date" if is_date else "number"
                return f'column "{name}" holds {cell!r}, which is no {kind}{hint}'
        return ""

    def _as_text(self, name: str) -> bool:
        return name in self.dates or name in self._flags or self._is_key(name)

    def _is_key(self, name: str) -> bool:
        return self.keys is not None and name in (*self.keys.names, self.unit)

    def _number(self, name: str, cell: str) -> float:
        if cell in _EMPTY:
            return float("nan")
        if self._is_key(name):
            return self.labels.setdefault(cell, len(self.labels))
        seconds = seconds_of(cell, self._day_first) if name in self.dates else None
        return float(plain(cell, self._decimal)) if seconds is None else seconds


def _single_spaced(file: Any) -> Any:  # arrow's stubs know no streams of arrow
    return pa.TransformInputStream(pa.PythonFile(file, "r"), _SingleSpaces())


class _SingleSpaces:
    """Makes the spaces between cells single ones, and removes those at both ends of a line, block by block."""

    def __init__(self) -> None:
        self._rest = b""

    def __call__(self, block: pa.Buffer) -> bytes:
        data = self._rest + bytes(block)
        end = data.rfind(b"\n") + 1 if len(block) else len(data)
        lines, self._rest = data[:end], data[end:]
        if lines[:1] != b" " and not any(pair in lines for pair in (b"  ", b"\n ", b" \n", b" \r")):
            return lines
        return b"\n".join(b" ".join(line.split()) for line in lines.split(b"\n"))


def numbers(column: pa.Array[Any]) -> Floats:
    """The numbers of a column (N,), with NaN for an empty cell; dates become seconds since 1970.

    Raises:
        pa.ArrowException: the column holds neither numbers nor dates.
    """
    scale = 1.0
    if pa.types.is_timestamp(column.type):
        column, scale = column.cast(pa.timestamp("ns", column.type.tz)).cast(pa.int64()), 1e-9
    found = column.cast(pa.float64(), safe=False)
    return scale * np.asarray(found.to_numpy(zero_copy_only=False), np.float64)
