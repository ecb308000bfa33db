"""Tables with one row for each time and each signal or axis, as databases export them.

InfluxDB writes the series one below the other, each below remarks and the names of the columns.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats, Ints
from service.can.user_errors import RecordError
from service.ingest.tables.csv_tables import CsvRows, CsvTable, in_blocks
from service.ingest.tables.table_head import LongKeys

_MOST_SIGNALS = 1000
_MAX_LONE_SHARE = 0.5
"""If more than this share of the times has one signal only, each signal has its own times"""
_MIN_DISTINCT = 0.99
"""Columns tell the signals apart if this share of the rows differs in them or in the time"""
_MIN_GAIN = 0.1
"""A further column does so if this share of the rows more differs: a repeated row is no other signal"""


class _LongRows(NamedTuple):
    """All rows of the file."""

    columns: Mapping[str, Floats]
    """The needed columns (N,), texts as their numbers in ``CsvTable.labels``"""
    values: Sequence[str]
    """The columns with the numbers of the signals"""
    named_by: Sequence[str]
    """The columns that tell the signals apart"""
    signal: Ints
    """Number of the signal of each row (N,)"""


class LongTable:
    """A CSV file with a row for each time and each signal or axis, read as if it had one row for each time.

    The columns are the signals.  If a row holds several numbers of an axis, they are called torque_A1, angle_A1.
    """

    has_names = True

    def __init__(self, path: Path, table: CsvTable, keys: LongKeys) -> None:
        self._path, self._table, self._time, self._keys = path, table, keys.time, keys
        self._units = {name: unit for name, unit in table.units.items() if name == keys.time}

    @property
    def taken(self) -> Sequence[str]:
        """Assumptions about the table, in words."""
        return (*self._table.taken, f'a "{self._time}" has a row for each {_quoted(self._rows.named_by)}')

    @property
    def left_out(self) -> Sequence[str]:
        """See CsvTable."""
        return self._table.left_out

    @property
    def names(self) -> Sequence[str]:
        """The time, and the columns made from the rows of each time."""
        return tuple(self._columns)

    @property
    def units(self) -> Mapping[str, str]:
        """Units of the columns by name, if the rows have them."""
        return self._units if self._columns else {}

    def rows(self, names: Sequence[str]) -> Iterator[CsvRows]:
        """See CsvTable."""
        return in_blocks({name: self._columns[name] for name in names})

    @cached_property
    def _rows(self) -> _LongRows:
        table, keys = self._table, self._keys
        left = {keys.time, *keys.names, *table.texts, *table.dates}
        values = [name for name in table.names if name not in left and keys.value in (None, name)]
        wanted = list(dict.fromkeys([keys.time, *keys.names, *values, *filter(None, [table.unit])]))
        blocks = [rows.columns for rows in table.rows(wanted)]
        read = {name: np.concatenate([np.zeros(0), *(block[name] for block in blocks)]) for name in wanted}
        named_by = _named_by(read[keys.time], {name: read[name] for name in keys.names})
        return _LongRows(read, values, named_by, _numbered([read[name] for name in named_by]))

    @cached_property
    def _columns(self) -> Mapping[str, Floats]:
        read, values, named_by, signal = self._rows
        places = np.unique(signal, return_index=True)[1]
        if len(places) > _MOST_SIGNALS:
            raise RecordError(f"{self._path}: {len(places)} signals, by their names in column {_quoted(named_by)}")
        # Keep the order of the file, as times of day restart at midnight.
        _, first, number, counts = np.unique(
            read[self._time], return_index=True, return_inverse=True, return_counts=True
        )
        if len(values) == 1 and len(places) > 1 and np.mean(counts == 1) > _MAX_LONE_SHARE:
            raise RecordError(
                f"{self._path}: each {_quoted(named_by)} has times of its own, so that torque and motion are not of one"
                " time; export them with a common interval"
            )
        row = np.argsort(np.argsort(first))[number]
        columns = {self._time: read[self._time][np.sort(first)]}
        for value, place in product(values, sorted(places.tolist())):
            mine, column = signal == signal[place], np.full(len(first), np.nan)
            column[row[mine]] = read[value][mine]
            texts = " ".join(filter(None, (self._text(read[key][place]) for key in named_by)))
            name = texts if len(values) == 1 else f"{value}_{texts}"
            columns[name] = column
            if self._table.unit is not None and len(values) == 1:
                self._units[name] = self._text(read[self._table.unit][place])
        return columns

    def _text(self, code: float) -> str:
        """The text of a cell; its number is in ``CsvTable.labels``."""
        return next((text for text, known in self._table.labels.items() if known == code), "")


def _named_by(time: Floats, keys: Mapping[str, Floats]) -> tuple[str, ...]:
    """The fewest columns, with the texts ``keys`` (N,) as numbers, that tell apart all rows of one time (N,)."""
    chosen, share = list[str](), 0.0
    while share < _MIN_DISTINCT and len(chosen) < len(keys):
        shares = {
            name: len(np.unique(_numbered([time, *(keys[other] for other in (*chosen, name))]))) / max(1, len(time))
            for name in keys
            if name not in chosen
        }
        best = max(shares, key=shares.__getitem__)
        if chosen and shares[best] < share + _MIN_GAIN:
            break
        share = shares[best]
        chosen.append(best)
    return tuple(name for name in keys if name in chosen)


def _numbered(columns: Sequence[Floats]) -> Ints:
    """Number of each different row of these columns (N,); NaN is a value like others."""
    number = np.zeros(len(columns[0]), np.int64)
    for column in columns:
        values, of_row = np.unique(column, return_inverse=True)
        number = np.unique(number * len(values) + of_row, return_inverse=True)[1]
    return number


def _quoted(names: Sequence[str]) -> str:
    return " and ".join(f'"{name}"' for name in names)
