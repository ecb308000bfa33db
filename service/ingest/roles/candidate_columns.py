"""Columns that may be the torque, or the motion, of an axis: those with such a name, or those whose values allow it."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from monitor_core.arrays import Floats
from service.ingest.roles.column_values import commanded_columns, correlation, roughness, slope_of, speeds_of_angles
from service.ingest.roles_by_name import is_of_sensor, words_in

_SAME = 0.99
"""Least correlation of two columns with the same motion"""


class Named(NamedTuple):
    """Information from the name of a column."""

    role: str
    """See ``role_of``"""
    number: str
    """Number or word of its axis; empty: neither"""
    place: int | None = None
    """Place of the column in its table"""


class NamedColumns(NamedTuple):
    """Columns of unknown roles."""

    values: Mapping[str, Floats]
    """Values (N,) of those that change"""
    t: Floats | None
    """Their times (N,) [s]; None: evenly spaced"""
    named: Mapping[str, Named]

    def distance(self, column: str, other: str) -> int | None:
        """How many columns after the other one a column is in the table; None: unknown."""
        place, before = self.named[column].place, self.named[other].place
        return None if place is None or before is None else place - before


class CandidateColumns(NamedTuple):
    """Columns that may be a torque, or a motion."""

    columns: NamedColumns
    torques: list[str]
    motions: Mapping[str, Sequence[str]]
    """Each with others that have nearly its values"""
    speeds: Mapping[str, str]
    """Unnamed angles, each with the column of its speed"""

    @property
    def step(self) -> int | None:
        """Number of columns that one quantity of all axes takes, from each angle to its speed; None: not constant."""
        steps = {self.columns.distance(speed, angle) for angle, speed in self.speeds.items()} - {None}
        step = steps.pop() if len(steps) == 1 else None
        return step if step is not None and step > 1 else None

    def is_in_step(self, torque: str, motion: str) -> bool:
        """Whether a torque is a whole number of steps away from a motion in the table."""
        step, distance = self.step, self.columns.distance(torque, motion)
        return step is not None and distance is not None and distance % step == 0


def candidate_columns(columns: NamedColumns) -> CandidateColumns:
    """The columns with a name of a torque or motion; without such names, those whose values allow it."""
    values, t, named = columns
    by_role: dict[str, list[str]] = {}
    for name in values:
        by_role.setdefault(named[name].role, []).append(name)
    # If an axis sends torque and current, use the torque: it needs no torque constant.
    known = {named[name].number for name in by_role.get("torque", [])}
    torques = [
        *_of_motors(by_role.get("torque", []), named),
        *(n for n in by_role.get("current", []) if named[n].number not in known),
    ]
    commanded = commanded_columns(values, by_role.get("", []))
    unnamed = [n for n in by_role.get("", []) if n not in commanded]
    angles = _of_kind(_with_alike(columns, by_role.get("angle", [])), torques)
    # If an axis sends angle and speed, use the angle: it gives the better estimates.
    numbers = {named[name].number for name in angles}
    alike = _with_alike(columns, [n for n in by_role.get("speed", []) if named[n].number not in numbers])
    speeds = _of_kind(alike, torques)
    motions = angles | speeds
    if torques and motions:
        return CandidateColumns(columns, torques, motions, {})
    speed_of = speeds_of_angles(values, unnamed, t)
    # The speed of an angle with a name is no torque, however well a motion explains it.
    unnamed = [n for n in unnamed if not any(correlation(slope_of(values[a], t), values[n]) > _SAME for a in angles)]
    motions = motions or _with_alike(columns, list(speed_of) or unnamed)
    # A column may repeat a speed, e.g. as a command; a friction torque is less similar to it.
    slopes = {
        n
        for n in unnamed
        if n in speed_of.values() or any(correlation(values[s], values[n]) > _SAME for s in speed_of.values())
    }
    torques = torques or [n for n in unnamed if n not in slopes and (n not in motions or not slopes)]
    return CandidateColumns(columns, torques, motions, speed_of)


def _of_motors(torques: Sequence[str], named: Mapping[str, Named]) -> list[str]:
    """Torques without those of sensors, which are behind the friction of the gear, where an axis has another one."""
    drives = {named[name].number for name in torques if not is_of_sensor(name)}
    return [name for name in torques if not is_of_sensor(name) or named[name].number not in drives]


def _with_alike(columns: NamedColumns, motions: Sequence[str]) -> dict[str, list[str]]:
    """Motions, each with the others of its axis that have nearly its values; it has most noise of these.

    Names do not tell all commands, and commands are smooth: a fifth difference hardly has anything of a motion.
    """
    values, _, named = columns
    found: dict[str, list[str]] = {}
    for name in sorted(motions, key=lambda name: -roughness(values[name], order=5)):
        same = (o for o in found if not named[name].role or named[o].number == named[name].number)
        noisier = next((other for other in same if correlation(values[other], values[name]) > _SAME), None)
        found.setdefault(noisier or name, [])
        if noisier is not None:
            found[noisier].append(name)
    return {name: found[name] for name in motions if name in found}


def _of_kind(alike: Mapping[str, Sequence[str]], torques: Sequence[str]) -> dict[str, list[str]]:
    """The same motions, with the same kind of column for all axes: the kind of most; of equals, that of the torques.

    Of motions with about the same noise, as of motor and joint, chance would choose another kind for each axis.
    """
    beside = {word for torque in torques for word in words_in(torque)}
    chosen = Counter(_kind(name) for name in alike)

    def rank(name: str) -> tuple[int, int]:
        return chosen[_kind(name)], len(beside.intersection(words_in(name)))

    found: dict[str, list[str]] = {}
    for name, others in alike.items():
        best = max((name, *others), key=rank)
        found[best] = [other for other in (name, *others) if other != best]
    return found


def _kind(name: str) -> str:
    """The name of a column without the number of its axis."""
    return re.sub(r"\d+", "", name)
