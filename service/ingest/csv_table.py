"""CSV files: separated by comma, semicolon or tabulator, with or without a line of names."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc

from service.can.user_errors import RecordError
from service.ingest.rows import Rows

_BLOCK_BYTES = 1 << 20
_EMPTY = ["", "NA", "N/A", "#N/A", "null", "NULL", "NaN", "nan"]


class CsvTable:
    """A CSV file.  If its first line holds numbers only, it has no names: columns are "0", "1", ...

    Raises:
        RecordError: it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            with path.open(encoding="utf-8-sig", newline="") as file:
                first = file.readline()
        except OSError as error:
            raise RecordError(f"cannot read {path}: {error.strerror}") from None
        except UnicodeDecodeError:
            raise RecordError(f"{path} is no CSV file: its first line is not UTF-8 text") from None
        if not first.strip():
            raise RecordError(f"{path}: the first line must hold names of columns, or numbers; it is empty")
        self._delimiter = max(",;\t", key=first.count)
        cells = [
            cell.strip()
            for cell in next(csv.reader([first], delimiter=self._delimiter, skipinitialspace=True))
        ]
        self.has_names = not all(_is_number(cell) for cell in cells)
        self.names: Sequence[str] = cells if self.has_names else [str(i) for i in range(len(cells))]

    def rows(self, names: Sequence[str]) -> Iterator[Rows]:
        """See Table."""
        size = max(1, self._path.stat().st_size)
        with self._path.open("rb") as file:
            try:
                for batch in self._reader(file, names):
                    columns = {name: np.asarray(batch.column(name), np.float64) for name in names}
                    yield Rows(columns, min(1.0, file.tell() / size))
            except pa.ArrowException as error:
                raise self._fault(names) or RecordError(f"{self._path}: {error}") from None

    def _reader(self, file: BinaryIO, names: Sequence[str]) -> pc.CSVStreamingReader:
        return pc.open_csv(
            file,
            pc.ReadOptions(
                column_names=list(self.names), skip_rows=int(self.has_names), block_size=_BLOCK_BYTES
            ),
            pc.ParseOptions(delimiter=self._delimiter),
            pc.ConvertOptions(
                column_types=dict.fromkeys(names, pa.float64()),
                include_columns=list(names),
                null_values=_EMPTY,
            ),
        )

    def _fault(self, names: Sequence[str]) -> RecordError | None:
        """The first wrong line: arrow reports neither the line nor, in a block, the name of the column."""
        wanted = [(name, self.names.index(name)) for name in names]
        with self._path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
            reader = csv.reader(file, delimiter=self._delimiter)
            for row in reader:
                where = f"{self._path}, line {reader.line_num}"
                if row and len(row) != len(self.names):
                    return RecordError(f"{where}: {len(row)} cells in a table of {len(self.names)} columns")
                if reader.line_num == 1 and self.has_names:
                    continue
                for name, i in wanted if row else ():
                    if row[i] not in _EMPTY and not _is_number(row[i]):
                        comma = ": write decimal points" if _is_number(row[i].replace(",", ".")) else ""
                        return RecordError(
                            f'{where}: column "{name}" holds {row[i]!r}, which is no number{comma}'
                        )
        return None


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
