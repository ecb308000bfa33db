"""Tables as CSV and Parquet files, written in parts."""

from collections.abc import Iterable, Mapping, Sequence
from typing import IO, Any

import pyarrow as pa
import pyarrow.csv as pc
import pyarrow.parquet as pq

Columns = Mapping[str, Sequence[Any]]
"""Columns of a part of a table: texts, whole numbers, or floats, of which NaN becomes an empty cell"""


def write_csv(file: IO[bytes], schema: Mapping[str, type], parts: Iterable[Columns]) -> None:
    """Write a table; the kinds of its columns are str, int and float."""
    known = _schema(schema)
    options = pc.WriteOptions(include_header=False, quoting_style="needed")  # it would quote all names
    file.write((",".join(schema) + "\n").encode())
    with pc.CSVWriter(file, known, write_options=options) as writer:
        for part in parts:
            writer.write_batch(_batch(known, part))


def write_parquet(file: IO[bytes], schema: Mapping[str, type], parts: Iterable[Columns]) -> None:
    """Write a table; the kinds of its columns are str, int and float."""
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
