"""Finds the columns of a table that are the time, and torque and motion of each axis, by names and values.

A name says what a column may be; the values decide.  Times increase.  A speed is the slope of an angle.  The torque of
an axis follows from its motion as that of a rigid mass with friction.
"""

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats
from service.config.unit_names import MeasuredQuantity, current_in, unit_in, unit_of, without_unit
from service.ingest.axis_columns import TimeOfDay
from service.ingest.roles_by_name import (
    axis_name,
    axis_number,
    commanded_role,
    is_gripper,
    is_load,
    own_word,
    owners,
    role_of,
    role_with,
    words_in,
)
from service.ingest.roles_by_values import MOST, Named, SignalPair, axes_by_values, changes
from service.ingest.signal_roles import AxisRoles, Confidence, SignalRole

_MOST_ROWS = 20_000
_MOST_SWITCHES = 3
"""More columns of two values are inputs and outputs of any kind."""
_LEAST_CHANGES = 4
_MAX_VALUE = 1e30
"""No quantity of a robot is as large in any unit."""
_MAX_RANGES = 100.0
"""Values farther than this from the median, in units of the range of 98 % of the values, are faults of the file ..."""
_MIN_ROWS = 3
"""... unless at least this many successive rows have them: then an axis that nearly always stands has moved."""


class TableRoles(NamedTuple):
    """The roles of the columns of a table; ``unit_s``: unit of the times [s]."""

    time: str | None
    unit_s: float
    axes: tuple[AxisRoles, ...]
    loads: Mapping[str, str]
    """Columns of measured loads that the torque may depend on, by the name of their axis; "": no axis named"""
    switches: tuple[str, ...]
    """Columns of two values that may tell when the robot carries something"""
    unused: tuple[str, ...]
    asked: str = ""
    """What is to be checked about the times, as the end of a sentence; empty: nothing"""
    apart: tuple[str, ...] = ()
    """Columns that have times of their own, which are others"""
    alone: tuple[str, ...] = ()
    """Those that are the torque of another axis by their names, but have no motion"""


def roles(
    columns: Mapping[str, Floats],
    units: Mapping[str, str] = MappingProxyType({}),
    interval_s: float | None = None,
) -> TableRoles:
    """Find the roles of columns (N,); values that are not finite, and rows with an absurd value, are ignored.

    ``units``: units of columns by name, if the table has a line of units; ``interval_s``: interval of the rows as
    stated by the table, used if no column has the time.
    """
    unit_names = {name: unit_of(name, units.get(name, "")) for name in columns}
    values = _sound({name: column[:_MOST_ROWS] for name, column in columns.items() if len(column) > 2})
    time, unit_s, asked = _time(values, unit_names)
    if time is not None:
        interval_s = float(np.nanmedian(np.diff(values[time]))) * unit_s
        if _restarts(columns[time] * unit_s):
            asked = f'; "{time}" starts again: {_what_to_do(time, columns)}'
            time = None
    else:
        interval_s = _interval_of_rows(values, unit_names) or interval_s
    apart = [] if time is None else _at_other_times(columns, time)
    moving = {name: v for name, v in values.items() if name != time and name not in apart and changes(v)}
    t = None if time is None else TimeOfDay().continuous(values[time] * unit_s * 1e6) * 1e-6
    places = {name: place for place, name in enumerate(columns)}
    kinds = {name: role_with(name, unit_names[name]) for name in moving}
    kinds |= _linear_motions(kinds, unit_names)
    pairs = _pairs(moving, t, kinds, places)
    if not pairs:  # many drives export only the commanded torque
        commanded = {name: commanded_role(name) for name, kind in kinds.items() if kind == "wanted"}
        kinds |= {name: role for name, role in commanded.items() if role in ("torque", "current")}
        pairs = _pairs(moving, t, kinds, places)
    used = {time, *(pair.torque for pair in pairs), *(pair.motion for pair in pairs)}
    loaded = [name for name in moving if name not in used and is_load(name, unit_names[name])]
    loads = {_axis_of(name, [pair.name for pair in pairs]): name for name in loaded}
    # Of all rows: what is carried may be changed only every few minutes.
    switches = _switches({name: columns[name] for name in values if name not in {*used, *loaded, *apart}})
    unused = tuple(name for name in columns if name not in {*used, *loads.values(), *switches})
    axes = (_axis(pair, kinds, unit_names)._replace(interval_s=interval_s, measured=True) for pair in pairs)
    found = {_owner(pair.torque) for pair in pairs}
    measured = [name for name in unused if role_with(name, unit_names[name]) in ("torque", "current")]
    alone = tuple(name for name in measured if _owner(name) not in {"", *found})
    return TableRoles(time, unit_s, tuple(axes), loads, switches, unused, asked, tuple(apart), alone)


def _owner(name: str) -> str:
    """The number or word of the axis in the name of a column; empty: neither."""
    return axis_number(without_unit(name)) or own_word(without_unit(name))


def _linear_motions(kinds: Mapping[str, str], units: Mapping[str, str]) -> dict[str, MeasuredQuantity]:
    """Columns without a role, in a unit of length, that have the number or word of a torque without a motion.

    Such a column without an axis may be the place of a tool, so the unit alone says nothing.
    """
    owner = {name: _owner(name) for name in kinds}
    turning = {owner[name] for name, kind in kinds.items() if kind in ("torque", "current")}
    turning -= {"", *(owner[name] for name, kind in kinds.items() if kind in ("angle", "speed"))}
    lengths = {name for name, unit in units.items() if (known := unit_in(unit, "angle")) is not None and known.linear}
    return {name: "angle" for name, kind in kinds.items() if not kind and owner[name] in turning and name in lengths}


def _switches(columns: Mapping[str, Floats]) -> tuple[str, ...]:
    """Columns (N,) of two values, each of which comes several times: those of a gripper by name, or the only few."""
    finite = {name: v[np.isfinite(v)] for name, v in columns.items()}
    found = [name for name, v in finite.items() if _is_switch(v)]
    grippers = tuple(name for name in found if is_gripper(name))
    return grippers or (tuple(found) if len(found) <= _MOST_SWITCHES else ())


def _is_switch(values: Floats) -> bool:
    if not values.size:
        return False
    low, high = values.min(), values.max()
    both = np.all((values == low) | (values == high))
    return bool(both and np.count_nonzero(np.diff(values)) >= _LEAST_CHANGES)


def _axis_of(column: str, axes: Sequence[str]) -> str:
    """The axis that the name of a column refers to; empty: none."""
    named = (axis_name(axis_number(without_unit(column))), own_word(column))
    return next((name for name in named if name in axes), "")


def _axis(pair: SignalPair, kinds: Mapping[str, str], units: Mapping[str, str]) -> AxisRoles:
    torque = _role(pair.torque, "torque", kinds[pair.torque], units[pair.torque])
    motion = _role(pair.motion, pair.output, kinds[pair.motion], units[pair.motion])
    return AxisRoles(
        pair.name,
        torque._replace(turned=pair.turned),
        motion._replace(wrap_period=pair.wrap_period),
        explained=pair.explained,
        rivals=pair.rivals,
        fastest=pair.fastest,
        better=pair.better,
        exchanged=pair.exchanged,
    )


def _role(column: str, quantity: MeasuredQuantity, kind: str, unit: str) -> SignalRole:
    """A column as a quantity; ``kind``: its role by name and unit."""
    current = kind == "current"
    known = None if current else unit_in(unit, quantity) or unit_in(column, quantity)
    factor = current_in(unit) if current else known and known.factor
    confidence: Confidence = "guess" if not kind else "sure" if known or (current and unit) else "likely"
    return SignalRole("", column, quantity, unit, factor, current, confidence, None)


def _pairs(
    moving: Mapping[str, Floats], t: Floats | None, kinds: Mapping[str, str], places: Mapping[str, int]
) -> list[SignalPair]:
    of_axis = owners(
        {name: axis_number(without_unit(name)) for name in moving},
        {name: own_word(name) for name in moving},
        {name: "torque" if kind == "current" else kind for name, kind in kinds.items()},
    )
    named = {name: Named(kinds[name], of_axis[name], places[name]) for name in moving}
    return axes_by_values(moving, t, named)


def _sound(columns: Mapping[str, Floats]) -> dict[str, Floats]:
    """Columns (N,) with NaN in rows in which any column has an absurd value: such a row is torn."""
    torn = np.zeros(min(map(len, columns.values()), default=0), bool)
    for v in columns.values():
        torn |= _absurd(v[: len(torn)])
    return {name: np.where(torn, np.nan, v[: len(torn)]) for name, v in columns.items()}


def _absurd(v: Floats) -> Bools:
    """Mask of the values (N,) that are too large for any quantity, or in a few rows lie far outside all others."""
    absurd = np.asarray(abs(v) >= _MAX_VALUE)
    finite = v[np.isfinite(v) & ~absurd]
    if not finite.size:
        return absurd
    low, high = np.quantile(finite, MOST)
    if low == high:
        return absurd
    with np.errstate(over="ignore"):
        far = ~absurd & (abs(v - np.median(finite)) > _MAX_RANGES * (high - low))
    steps = np.flatnonzero(np.diff(far, prepend=False, append=False))
    for start, end in zip(steps[::2], steps[1::2], strict=True):
        absurd[start:end] = end - start < _MIN_ROWS
    return absurd


# --- The time ---------------------------------------------------------------------------------------------------------


_UNITS = {"ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
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


def _time(values: Mapping[str, Floats], units: Mapping[str, str]) -> tuple[str | None, float, str]:
    """The time column, its unit [s], and what is to be checked about it; see ``asked``."""
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
    """The unit of a time column by its name or unit [s]; None: it has none, or s."""
    if _TICKS_BY_NAME.search(unit) or _TICKS_BY_NAME.search(name):
        return _TICK_S
    return next((_UNITS[word] for word in (unit, *words_in(name)) if word in _UNITS), None)


def _unit_words(unit_s: float) -> str:
    words = {unit: name for name, unit in _UNITS.items()} | {1.0: "s", _DAY_S: "days"}
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
