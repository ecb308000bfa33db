"""Which columns of a table are the time, and torque and motion of each axis: by their names, and by their values.

A name says what a column may be.  The values decide: times increase; a speed is the slope of an angle; a torque and a
motion of one axis explain each other as a rigid mass with friction.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification import Record, rigid_fit

_TABLE = """
time: t time times timestamp zeit sec secs seconds s ms us
torque: trq torque torques tau moment drehmoment tq nm mot
current: i cur curr current currents amp strom iq
angle: pos position positions angle angles ang phi q qm theta winkel joint deg rad
speed: vel velocity velocities speed omega w qd dq qdot rpm drehzahl
temperature: temp temperature temperatur
wanted: ref cmd des set soll target wanted desired command commanded qg setpoint
"""
_WORDS = {word: line.partition(":")[0] for line in _TABLE.split("\n") for word in line.split()[1:]}
"""What a word in a column's name says that it is; wanted: what the controller asks for, which is no measurement."""
_MOST_ROWS = 20_000
_SLOPE = 0.95
"""Correlation of a speed with the slope of its angle."""
_MOVES = 1e-9
_TURNED = 0.2
"""Of the torque that must be explained beyond that by a torque of the right sign, to take one of the wrong sign."""
SURE, LIKELY = 0.6, 0.2
"""Part of the torque that a rigid mass explains, from which on a pair is sure, or likely."""


class AxisColumns(NamedTuple):
    """The columns of one axis; ``explained``: part of the torque that the motion explains as a rigid mass."""

    name: str
    torque: str
    motion: str
    output: Literal["angle", "speed"]
    explained: float
    current: bool
    """The torque is a current: its factor is the torque constant"""
    turned: bool
    """The torque has the wrong sign"""

    @property
    def sureness(self) -> str:
        """In a word."""
        return "sure" if self.explained >= SURE else "likely" if self.explained >= LIKELY else "by name only"


class TableRoles(NamedTuple):
    """What a table holds; ``unit_s``: of its times."""

    time: str | None
    unit_s: float
    interval_s: float | None
    axes: tuple[AxisColumns, ...]
    unused: tuple[str, ...]


def words_in(name: str) -> list[str]:
    """The words of a column's name, small letters: "A1_TrqAct" has a, trq, act."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return [word.lower() for word in re.findall(r"[A-Za-z]+", apart)]


def role_of(name: str) -> str:
    """What a column is by its name; empty: the name does not tell."""
    known = [_WORDS[word] for word in words_in(name) if word in _WORDS]
    return "wanted" if "wanted" in known else known[-1] if known else ""


def roles(columns: Mapping[str, Floats]) -> TableRoles:
    """The roles of columns (N,) by name; what is not finite is passed over."""
    values = {name: column[:_MOST_ROWS] for name, column in columns.items() if len(column) > 2}
    time, unit_s = _time(values)
    interval_s = float(np.nanmedian(np.diff(values[time]))) * unit_s if time is not None else None
    moving = {name: v for name, v in values.items() if name != time and changes(v)}
    t = None if time is None else np.asarray(values[time] * unit_s, np.float64)
    axes = tuple(axes_by_values(moving, t, {name: Named(role_of(name), _number(name)) for name in moving}))
    used = {time, *(axis.torque for axis in axes), *(axis.motion for axis in axes)}
    return TableRoles(time, unit_s, interval_s, axes, tuple(name for name in columns if name not in used))


def changes(v: Floats) -> bool:
    """Whether a column (N,) is not constant."""
    finite = v[np.isfinite(v)]
    return finite.size > 2 and float(np.ptp(finite)) > _MOVES


# --- The time ---------------------------------------------------------------------------------------------------------


_UNITS = {"ms": 1e-3, "us": 1e-6}
_RISES = 0.99
"""Of the steps of a time: a few rows may be there twice."""
_LONGEST_S = 0.5
"""A longer interval of a drive's samples is none in seconds."""


def _time(values: Mapping[str, Floats]) -> tuple[str | None, float]:
    steps_of = {name: np.diff(v[np.isfinite(v)]) for name, v in values.items()}
    rising = [name for name, d in steps_of.items() if d.size and np.mean(d > 0) > _RISES]
    rising.sort(key=lambda name: role_of(name) != "time")
    if not rising:
        return None, 1.0
    name = rising[0]
    steps = steps_of[name]
    if role_of(name) != "time" and np.quantile(steps, 0.9) - np.quantile(steps, 0.1) > steps.mean():
        return None, 1.0  # an angle that only grows
    unit = next((_UNITS[word] for word in words_in(name) if word in _UNITS), 1.0)
    interval = float(np.median(steps))
    if unit == 1.0 and interval >= _LONGEST_S:
        unit = 1e-3 if interval < 1e3 * _LONGEST_S else 1e-6
    return name, unit


# --- Torque and motion of each axis -----------------------------------------------------------------------------------


class Named(NamedTuple):
    """What the name of a column says."""

    role: str
    """As ``role_of``"""
    number: str
    """Of its axis; empty: it has none"""


def axes_by_values(
    values: Mapping[str, Floats], t: Floats | None, named: Mapping[str, Named]
) -> list[AxisColumns]:
    """Which columns are torque and motion of which axis.

    Args:
        values: columns (N,) that change, by name.
        t: (N,) their times, s; None: evenly spaced.
        named: what their names say.
    """
    by_role: dict[str, list[str]] = {}
    for name in values:
        by_role.setdefault(named[name].role, []).append(name)
    torques = by_role.get("torque") or by_role.get("current") or []
    angles, unnamed = by_role.get("angle", []), by_role.get("", [])
    # An axis that sends both: the angle gives the better estimates.
    numbers = {named[name].number for name in angles}
    motions = [*angles, *(n for n in by_role.get("speed", []) if named[n].number not in numbers)]
    if not torques or not motions:
        motions = motions or _angles(values, unnamed, t) or unnamed
        slopes = [n for n in unnamed if any(_is_slope(values[m], values[n], t) for m in motions if m != n)]
        torques = torques or [n for n in unnamed if n not in slopes and (n not in motions or not slopes)]
    pairs = sorted(
        (_pair(values, u, y, named, t) for u in torques for y in motions if u != y),
        key=lambda pair: _weight(pair, named),
        reverse=True,
    )
    taken, found = set[str](), list[AxisColumns]()
    for pair in pairs:
        if {pair.torque, pair.motion} & taken or (not named[pair.torque].role and pair.explained < LIKELY):
            continue
        taken |= {pair.torque, pair.motion}
        found.append(pair)
    order = list(values)
    found.sort(key=lambda pair: order.index(pair.motion))
    if len({pair.name for pair in found}) < len(found):
        found = [pair._replace(name=f"axis{k}") for k, pair in enumerate(found, 1)]
    return found


def _weight(pair: AxisColumns, named: Mapping[str, Named]) -> tuple[bool, float]:
    """Pairs with the same number come first, then those that explain each other; of equals the first in the table."""
    alike = named[pair.torque].number == named[pair.motion].number
    return alike, round(pair.explained - _TURNED * pair.turned, 1)


def _angles(values: Mapping[str, Floats], names: Sequence[str], t: Floats | None) -> list[str]:
    """Columns of which another one is the slope."""
    return [a for a in names if any(_is_slope(values[a], values[s], t) for s in names if s != a)]


def _is_slope(angle: Floats, speed: Floats, t: Floats | None) -> bool:
    slope = np.gradient(angle, 1.0 if t is None else t)
    if not (changes(slope) and np.isfinite(slope).all() and np.isfinite(speed).all()):
        return False
    return float(np.corrcoef(slope, speed)[0, 1]) > _SLOPE


def _pair(
    values: Mapping[str, Floats], torque: str, motion: str, named: Mapping[str, Named], t: Floats | None
) -> AxisColumns:
    output: Literal["angle", "speed"] = "speed" if named[motion].role == "speed" else "angle"
    u, y = values[torque], values[motion]
    good = np.isfinite(u) & np.isfinite(y)
    times = np.asarray(np.arange(u.size) * 1e-3 if t is None else t - t[0], np.float64)
    good &= np.isfinite(times)
    good[1:] &= np.diff(times) > 0
    signs = []
    for sign in (1.0, -1.0):
        fit = rigid_fit(Record(times[good], sign * u[good], y[good], output, torque))
        signs.append(fit.explained if fit is not None and fit.inertia > 0 else 0.0)
    number = named[torque].number or named[motion].number
    return AxisColumns(
        f"axis{number}" if number else "axis",
        torque,
        motion,
        output,
        max(signs),
        named[torque].role == "current",
        signs[1] > signs[0],
    )


def _number(name: str) -> str:
    """The number of the axis in a column's name; empty: there is none."""
    found = re.findall(r"\d+", name)
    return found[-1] if found and not name.isdigit() else ""
