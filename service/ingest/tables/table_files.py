"""Reads tables from .csv, .parquet and .mat files in blocks of rows; writes .csv and .parquet."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
import scipy.io
from scipy.io.matlab import MatReadError

from monitor_core.arrays import Floats
from monitor_core.wording import did_you_mean
from service.can.user_errors import RecordError
from service.ingest.tables.csv_tables import ROWS, CsvRows, CsvTable, in_blocks, numbers
from service.ingest.tables.long_tables import LongTable

_TEXTS = (".csv", ".txt", ".tsv", ".dat", ".lvm")
TABLE_SUFFIXES = (*_TEXTS, ".parquet", ".mat")
_MOST_COLUMNS = 100
"""A matrix with more columns is not offered column by column"""


def open_table(path: Path) -> TableFile:
    """Open the table in a file, by its suffix.

    Raises:
        RecordError: the file cannot be read or is not what its suffix says.
    """
    if path.suffix.lower() in _TEXTS:
        table = CsvTable(path)
        return table if table.keys is None else LongTable(path, table, table.keys)
    return ParquetTable(path) if path.suffix.lower() == ".parquet" else MatTable(path)


def check_columns(path: Path, table: TableFile, wanted: Mapping[str, str]) -> None:
    """Check that the wanted columns exist; ``wanted``: purpose of each column by its name.

    Raises:
        RecordError: a column does not exist; the text suggests existing ones.
    """
    known = set(table.names)
    for name, purpose in wanted.items():
        if name not in known:
            hint = did_you_mean(name, table.names)
            raise RecordError(f'{path}: no column "{name}" for {purpose}: {hint}')


class ParquetTable:
    """A Parquet file.

    The elements of lists, as of the joint states of ROS, are columns called position[0], position[1] ...
    """

    has_names, left_out, taken = True, list[str](), tuple[str, ...]()

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._file = pq.ParquetFile(path)
            schema = self._file.schema_arrow
            lists = {field.name: self._length(field.name) for field in schema if _is_list(field.type)}
        except OSError as error:
            raise RecordError(f"cannot read {path}: {error.strerror or error}") from None
        except pa.ArrowException as error:
            raise RecordError(f"{path} is no Parquet file: {error}") from None
        self.units = {field.name: "s" for field in schema if pa.types.is_timestamp(field.type)}
        """Units of the columns by name: dates become seconds"""
        self._elements = {f"{name}[{k}]": (name, k) for name, length in lists.items() for k in range(length)}
        self.names: Sequence[str] = (*(name for name in schema.names if not lists.get(name)), *self._elements)
        """Names of all columns"""

    def _length(self, name: str) -> int:
        """The length of the first list in a column; 0: there is none."""
        first = next(self._file.iter_batches(batch_size=1, columns=[name]), None)
        found = None if first is None or not first.num_rows else first.column(0)[0].as_py()
        return len(found or ())

    def rows(self, names: Sequence[str]) -> Iterator[CsvRows]:
        """See CsvTable."""
        read, total = 0, self._file.metadata.num_rows
        columns = {self._elements.get(name, (name, 0))[0] for name in names}
        batches = self._file.iter_batches(batch_size=ROWS, columns=list(columns))
        while True:
            try:
                batch = next(batches, None)
            except (pa.ArrowException, OSError) as error:
                raise RecordError(f"{self._path} is damaged after row {read}: {error}") from None
            if batch is None:
                return
            read += batch.num_rows
            yield CsvRows({name: self._numbers(name, batch) for name in names}, read / total)

    def _numbers(self, name: str, batch: pa.RecordBatch) -> Floats:
        column, place = self._elements.get(name, (name, None))
        cells = batch.column(column)
        try:
            return numbers(cells if place is None else pc.list_element(cells, place))
        except pa.ArrowException:
            what = f"{cells.type}, not numbers" if place is None else "lists of other lengths, or no numbers"
            raise RecordError(f'{self._path}: column "{column}" holds {what}') from None


def _is_list(kind: pa.DataType) -> bool:
    return pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)


class MatTable:
    """A MATLAB file up to version 7.

    A variable in a structure is called structure.variable, the second column of a matrix is called matrix(:,2).
    """

    has_names, left_out, units, taken = True, list[str](), dict[str, str](), tuple[str, ...]()

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            path.open("rb").close()  # gives a better error message
            content = scipy.io.loadmat(path, simplify_cells=True, appendmat=False)
        except OSError as error:
            raise RecordError(f"cannot read {path}: {error.strerror or error}") from None
        except NotImplementedError:
            raise RecordError(f"{path} is of MATLAB version 7.3: save it with -v7, or as .csv") from None
        except (MatReadError, ValueError, TypeError, LookupError, EOFError, zlib.error) as error:
            raise RecordError(f"{path} is damaged or no MATLAB file: {error}") from None
        self._arrays = dict(_flat(content))

    @property
    def names(self) -> Sequence[str]:
        """Names of all variables."""
        return tuple(self._arrays)

    def rows(self, names: Sequence[str]) -> Iterator[CsvRows]:
        """See CsvTable."""
        columns = {name: self._vector(name) for name in names}
        lengths = {name: len(column) for name, column in columns.items()}
        if len(set(lengths.values())) > 1:
            raise RecordError(f"{self._path}: the variables differ in length: {lengths}")
        return in_blocks(columns)

    def _vector(self, name: str) -> Floats:
        array = np.asarray(self._arrays[name])
        if array.dtype.kind not in "fiub":
            raise RecordError(f'{self._path}: variable "{name}" holds no real numbers')
        if array.size != max(array.shape, default=1):
            raise RecordError(f'{self._path}: variable "{name}" is no vector, its size is {array.shape}')
        return array.reshape(-1).astype(np.float64)


def _flat(content: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{name}.")
        elif not name.startswith("__"):
            yield above + name, value
            if isinstance(value, np.ndarray) and value.ndim == 2 and 1 < value.shape[1] <= _MOST_COLUMNS:
                yield from ((f"{above}{name}(:,{k})", column) for k, column in enumerate(value.T, 1))


TableFile = CsvTable | LongTable | ParquetTable | MatTable
"""A table file of any kind"""


# --- Writing tables ---------------------------------------------------------------------------------------------------


Columns = Mapping[str, Sequence[Any]]
"""Columns of one part of a table: texts, integers or floats; NaN becomes an empty cell"""


def write_csv(file: IO[bytes], schema: Mapping[str, type], parts: Iterable[Columns]) -> None:
    """Write a table; ``schema``: str, int or float by column."""
    known = _schema(schema)
    options = pa_csv.WriteOptions(include_header=False, quoting_style="needed")  # arrow would quote all names
    file.write((",".join(schema) + "\n").encode())
    with pa_csv.CSVWriter(file, known, write_options=options) as writer:
        for part in parts:
            writer.write_batch(_batch(known, part))


def write_parquet(file: IO[bytes], schema: Mapping[str, type], parts: Iterable[Columns]) -> None:
    """Write a table; ``schema``: str, int or float by column."""
    known = _schema(schema)
    with pq.ParquetWriter(file, known, compression="zstd") as writer:
        for part in parts:
            writer.write_batch(_batch(known, part))


_KINDS: Mapping[type, Any] = {str: pa.string(), int: pa.int64(), float: pa.float64()}


def _schema(columns: Mapping[str, type]) -> pa.Schema:
    return pa.schema([(name, _KINDS[kind]) for name, kind in columns.items()])


def _batch(schema: pa.Schema, part: Columns) -> pa.RecordBatch:
    arrays = [pa.array(part[field.name], field.type, from_pandas=True) for field in schema]
    return pa.record_batch(arrays, schema=schema)
