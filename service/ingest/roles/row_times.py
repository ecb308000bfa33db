"""Finds the times of the rows of a table: their column, its unit, and what is to be checked about them."""

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from service.ingest.roles_by_name import role_of, words_in
from service.ingest.tables.time_of_day import TimeOfDay

_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
_DAY_S = 86_400.0
_TICK_S = 1e-7
_TICKS_BY_NAME = re.compile(r"100[\s_-]*ns", re.IGNORECASE)
_TICKS = {
    (1.0e17, 1.7e17): "100 ns since 1601, as times of Windows and TwinCAT",
    (6.2e17, 6.8e17): "100 ns since the year 1, as times of .NET",
}
"""Values of times of the years from 1965 to 2100 that count steps of 100 ns, and what these are"""
_MILLIONTH_S = _DAY_S / 1e6
_MILLIONTHS = (2.5e10, 7.5e10)
"""Time_ms of WinCC in the years from 1968 to 2105: millionths of a day since 1900, in spite of its name"""
_MIN_RISING_SHARE = 0.99
"""Smallest share of rising steps in a time column: a few rows may be repeated."""
_FEWEST_STEPS = 4
_LONGEST_S, _SHORTEST_S = 0.5, 1e-5
"""A time column with longer or shorter intervals is not in seconds."""
_FASTEST_S = 2e-4
"""A shorter interval is doubted: hardly any record is as fast."""
_MIN_FRACTIONS = 0.5
_MAX_LATE_SHARE = 0.01
"""Largest share of rows with a time that is not after those above"""


class RowTimes(NamedTuple):
    """The times of the rows of a table, or what is known of them without a column of times."""

    column: str | None
    """None: no column has times that can be used"""
    unit_s: float
    """Unit of the times [s]"""
    interval_s: float | None
    """Interval of the rows [s]; None: not known"""
    t: Floats | None
    """Times (N,) [s]; None: not known"""
    asked: str = ""
    """What is to be checked about the times, as the end of a sentence; empty: nothing"""
    apart: tuple[str, ...] = ()
    """Columns that have times of their own, which are others"""


def row_times(
    columns: Mapping[str, Floats], values: Mapping[str, Floats], units: Mapping[str, str], interval_s: float | None
) -> RowTimes:
    """Find the times of the rows.

    Args:
        columns: all values (M,), as they are in the table.
        values: the first N of them, those of torn rows NaN.
        units: by column, may be empty.
        interval_s: interval of the rows as stated by the table, used if no column has the time.
    """
    column, unit_s, asked = _time(values, units)
    if column is None:
        return RowTimes(None, unit_s, _interval_of_rows(values, units) or interval_s, None)
    interval_s = float(np.nanmedian(np.diff(values[column]))) * unit_s
    if _restarts(columns[column] * unit_s):
        asked = f'; "{column}" starts again: {_what_to_do(column, columns)}'
        return RowTimes(None, unit_s, interval_s, None, asked)
    t = TimeOfDay().continuous(values[column] * unit_s * 1e6) * 1e-6
    return RowTimes(column, unit_s, interval_s, t, asked, tuple(_at_other_times(columns, column)))


def _time(values: Mapping[str, Floats], units: Mapping[str, str]) -> tuple[str | None, float, str]:
    """The time column, its unit [s], and what is to be checked about it, see ``RowTimes``."""
    steps_of = {name: np.diff(v[np.isfinite(v)]) for name, v in values.items()}
    rising = [name for name, d in steps_of.items() if d.size and np.mean(d > 0) > _MIN_RISING_SHARE]
    rising.sort(key=lambda name: role_of(name) != "time")
    if not rising:
        return None, 1.0, ""
    name = rising[0]
    steps = steps_of[name]
    if role_of(name) != "time" and np.quantile(steps, 0.9) - np.quantile(steps, 0.1) > steps.mean():
        return None, 1.0, ""  # uneven steps: an angle that only grows
    interval, named = float(np.median(steps)), _named_unit(name, units[name])
    if (counted := _counted(values[name], interval, named)) is not None:
        unit, what = counted
        return name, unit, f" if it counts {what} do"
    if named is not None:
        return name, named, ""
    # A spreadsheet counts days.
    unit = _DAY_S if interval < _SHORTEST_S else next((u for u in (1.0, 1e-3, 1e-6) if interval * u < _LONGEST_S), 1e-9)
    doubted = unit != 1.0 or interval < _FASTEST_S
    return name, unit, f" if it is in {_unit_words(unit)}, as its steps suggest" if doubted else ""


def _counted(values: Floats, interval: float, named: float | None) -> tuple[float, str] | None:
    """The unit [s] of times (N,) whose size shows what they count, and what that is; None: it does not.

    ``interval``: between two rows, as in the file; ``named``: unit by the name of the column [s].
    """
    middle = float(np.nanmedian(values))
    if named in (None, _TICK_S) and interval * _TICK_S < _LONGEST_S:
        for (low, high), what in _TICKS.items():
            if low < middle < high:
                return _TICK_S, what
    # A counter of milliseconds has no fractions.
    fractions = np.mean(values % 1 != 0) > _MIN_FRACTIONS
    if named == _UNITS["ms"] and _MILLIONTHS[0] < middle < _MILLIONTHS[1] and fractions:
        return _MILLIONTH_S, "millionths of a day since 1900, as those of WinCC"
    return None


def _named_unit(name: str, unit: str) -> float | None:
    """The unit of a time column by its name or unit [s]; None: it has none."""
    if _TICKS_BY_NAME.search(unit) or _TICKS_BY_NAME.search(name):
        return _TICK_S
    return next((_UNITS[word] for word in (unit, *words_in(name)) if word in _UNITS), None)


def _unit_words(unit_s: float) -> str:
    words = {unit: name for name, unit in _UNITS.items()} | {_DAY_S: "days"}
    return words[unit_s]


def _what_to_do(fraction: str, columns: Mapping[str, Floats]) -> str:
    """What to do about a time column that starts again, which may be the part of a time below the second."""
    words = {"nsec": "sec", "nsecs": "secs", "nanosec": "sec", "nanosecs": "secs"}
    start, found = fraction[: _start_of_word(fraction)], words.get(fraction[_start_of_word(fraction) :].lower())
    seconds = next((name for name in columns if found and name.lower() == f"{start}{found}".lower()), None)
    if seconds is None:
        return "where rows are missing there, cut the file"
    added = f"{seconds} + 1e-9 {fraction}"
    return f'it is the fraction of "{seconds}"; where rows are missing, write both as one column, {added}'


def _start_of_word(name: str) -> int:
    return len(name) - len(re.split(r"[^A-Za-z]", name)[-1])


def _at_other_times(columns: Mapping[str, Floats], time: str) -> list[str]:
    """Columns behind another time column of the same name, if its times are others: each signal may have its own."""
    found, other, t = list[str](), False, columns[time]
    for name, column in columns.items():
        if name == time or re.fullmatch(rf"{re.escape(time)}_\d+", name):
            other = bool((abs(column - t) > np.median(abs(np.diff(t))) / 2).any())
        elif other:
            found.append(name)
    return found


def _restarts(t: Floats) -> bool:
    """Whether many times (N,) [s] are not after those above, as of a recorder that begins again, or of a fraction."""
    t = TimeOfDay().continuous(t[np.isfinite(t)] * 1e6)
    return bool(np.mean(t[1:] <= np.maximum.accumulate(t)[:-1]) > _MAX_LATE_SHARE)


def _interval_of_rows(values: Mapping[str, Floats], units: Mapping[str, str]) -> float | None:
    """The interval of the rows if their times are rounded, such as to seconds: from the number of rows of many."""
    for name, v in values.items():
        steps = np.flatnonzero(np.diff(v) != 0) + 1
        if role_of(name) == "time" and len(steps) > _FEWEST_STEPS and (np.diff(v) >= 0).all():
            unit_s = _named_unit(name, units[name]) or 1.0
            return unit_s * float((v[steps[-1]] - v[steps[0]]) / (steps[-1] - steps[0]))
    return None
