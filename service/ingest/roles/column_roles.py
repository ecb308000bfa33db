"""Finds the columns of a table that are torque and motion of each axis, by names and values.

A name says what a column may be; the values decide.  A speed is the slope of an angle.  The torque of
an axis follows from its motion as that of a rigid mass with friction.
"""

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Bools, Floats
from monitor_core.identification import moves
from service.config.unit_names import MeasuredQuantity, current_in, unit_in, unit_of, without_unit
from service.ingest.roles.candidate_columns import Named
from service.ingest.roles.column_values import MOST, changes
from service.ingest.roles.roles_by_values import SignalPair, axes_by_values
from service.ingest.roles.row_times import row_times
from service.ingest.roles.signal_roles import AxisRoles, Confidence, SignalRole
from service.ingest.roles_by_name import (
    axis_name,
    axis_number,
    commanded_role,
    desired,
    distance_from_gear,
    is_gripper,
    is_load,
    is_temperature,
    own_word,
    owners,
    role_with,
)

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
    temperatures: Mapping[str, str] = MappingProxyType({})
    """Columns of the temperatures of axes, by the name of the axis"""


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
    times = row_times(columns, values, unit_names, interval_s)
    unmoved = {times.column, *times.apart}
    moving = {name: v for name, v in values.items() if name not in unmoved and changes(v)}
    kinds = {name: role_with(name, unit_names[name]) for name in moving}
    kinds |= dict.fromkeys(desired(moving), "wanted")
    kinds |= _linear_motions(kinds, unit_names)
    places = {name: place for place, name in enumerate(columns)}
    pairs = _pairs(moving, times.t, kinds, places)
    if not pairs:  # many drives export only the commanded torque
        commanded = {name: commanded_role(name) for name, kind in kinds.items() if kind == "wanted"}
        kinds |= {name: role for name, role in commanded.items() if role in ("torque", "current")}
        pairs = _pairs(moving, times.t, kinds, places)
    used = {times.column, *(pair.torque for pair in pairs), *(pair.motion for pair in pairs)}
    loaded = [name for name in moving if name not in used and is_load(name, unit_names[name])]
    loads = {_axis_of(name, [pair.name for pair in pairs]): name for name in loaded}
    # Of all rows: what is carried may be changed only every few minutes.
    switches = _switches({name: columns[name] for name in values if name not in {*used, *loaded, *times.apart}})
    others = [name for name in columns if name not in {*used, *loads.values(), *switches}]
    measured = [name for name in others if name in values and not np.isin(values[name], (0.0, 1.0)).all()]
    temperatures = _temperatures(measured, unit_names, [p.name for p in pairs])
    unused = tuple(name for name in others if name not in temperatures.values())
    axes = (_axis(pair, kinds, unit_names)._replace(interval_s=times.interval_s, measured=True) for pair in pairs)
    alone = tuple(_torques_of_others(unused, pairs, unit_names))
    return TableRoles(
        times.column, times.unit_s, tuple(axes), loads, switches, unused, times.asked, times.apart, alone, temperatures
    )


def _torques_of_others(unused: Sequence[str], pairs: Sequence[SignalPair], units: Mapping[str, str]) -> Iterator[str]:
    """Columns that by their names are the torque of an axis which is none of these pairs.

    Where the axes have numbers, a current without one is that of a tool, or of the whole robot.
    """
    found = {"", *(_owner(pair.torque) for pair in pairs)}
    numbered = all(axis_number(without_unit(pair.torque)) for pair in pairs)
    measured = (name for name in unused if role_with(name, units[name]) in ("torque", "current"))
    owners = ((name, _owner(name)) for name in measured)
    yield from (name for name, owner in owners if owner not in found and (owner.isdigit() or not numbered))


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


def _temperatures(names: Sequence[str], units: Mapping[str, str], axes: Sequence[str]) -> dict[str, str]:
    """Columns of the temperatures of axes, by the name of the axis; of a single axis the name needs no number."""
    measured = [name for name in names if is_temperature(name, units[name])]
    of_axes = {axis: [name for name in measured if _axis_of(name, axes) == axis] for axis in axes}
    if len(axes) == 1:
        of_axes = {axes[0]: measured}
    return {axis: min(several, key=distance_from_gear) for axis, several in of_axes.items() if several}


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
    record = pair.record
    stands = record is not None and bool(kinds[pair.torque]) and not moves(record.y, record.quantity)
    return AxisRoles(
        pair.name,
        torque._replace(turned=pair.turned),
        motion._replace(wrap_period=pair.wrap_period),
        explained=None if stands else pair.explained,
        rivals=pair.rivals,
        fastest=pair.fastest,
        better=pair.better,
        exchanged=pair.exchanged,
        apart=pair.apart,
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
