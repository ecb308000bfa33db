"""Which of the monitored parameters can be watched with these nominal values, and from which change on."""

from collections.abc import Mapping, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from monitor_core.drive.structure import DELAY, LOAD, split_name, value_of
from monitor_core.identification.greybox import Estimate, monitored_information
from monitor_core.identification.records.measured_record import Record
from monitor_core.wording import rounded_down

_SHOWS = 3.0
"""Standard deviations of an estimate that a change must reach, as nu of the paper's tests (alpha_1)."""
_ZERO = 2.0
"""Standard deviations: a value of either sign that is smaller is not distinguished from zero."""
_LARGEST = 1.0
"""A change of 100 %: what would show only beyond that is not watched."""


_SMALL = 0.2
"""A change of 20 % is what robots are watched for."""
_OF_LOAD = 0.3
"""Of the weight: a change of the payload that is to be detected."""
_HARDLY_LESS = 1.1
_NEEDED = 33
"""Memories that a record must hold: ten to find P(0), twenty to calibrate, the rest for what cannot be used."""


class Obstacle(Enum):
    """Why a parameter cannot be watched."""

    NO_SIZE = "no-size"
    """Its nominal value is zero, or not distinguished from zero: what a change is compared with is not given."""
    NOT_SHOWN = "not-shown"
    """The motion of the records shows it too little within the memory of the monitor."""
    TOGETHER = "together"
    """Only beside all the others: with one parameter fewer, those that are left show."""


class Watched(NamedTuple):
    """One monitored parameter."""

    name: str
    change: float
    """smallest change that shows within one memory, as part of the given size, else of the value"""
    obstacle: Obstacle | None


def outlook(
    estimate: Estimate,
    monitored: Sequence[str],
    records: Sequence[Record],
    memory_s: float,
    sizes: Mapping[str, float] = {},
    weight: Mapping[str, float] = {},
) -> tuple[Watched, ...]:
    """What can be watched, in the order of ``monitored``.

    Args:
        estimate: the nominal values.
        monitored: names of parameters, "1/Ja" for a reciprocal.
        records: of the motion that the axis will make.
        memory_s: of the monitor, s.
        sizes: given by the user, by name; of the others the value is the size.
        weight: what LOAD scales, if it is among them, as in ``monitored_information``.
    """
    found = dict[str, Watched]()
    names = list(monitored)
    for name in monitored:
        if name not in sizes and _is_zero(estimate, name):
            found[name] = Watched(name, np.nan, Obstacle.NO_SIZE)
            names.remove(name)
    changes = _changes(estimate, names, records, memory_s, sizes, weight)
    while names:
        worst = max(names, key=changes.__getitem__)
        if changes[worst] <= _LARGEST:
            break
        alone = _changes(estimate, [worst], records, memory_s, sizes, weight)[worst]
        obstacle = Obstacle.NOT_SHOWN if alone > _LARGEST else Obstacle.TOGETHER
        found[worst] = Watched(worst, alone, obstacle)
        names.remove(worst)
        changes = _changes(estimate, names, records, memory_s, sizes, weight)
    found |= {name: Watched(name, changes[name], None) for name in names}
    return tuple(found[name] for name in monitored)


def shortest_memory(
    estimate: Estimate,
    monitored: Sequence[str],
    records: Sequence[Record],
    memories_s: Sequence[float],
    sizes: Mapping[str, float] = {},
) -> float:
    """The shortest of these memories [s], in ascending order, with which all that shows shows from small changes on.

    Else the longest; if the records are too short to calibrate with that, the longest with which they are not, but at
    least the first.  Arguments as of ``outlook``.
    """
    longest_s = rounded_down(sum(record.duration_s for record in records) / _NEEDED)
    most_s = max(memories_s[0], min(longest_s, memories_s[-1]))
    for memory_s in memories_s:
        if memory_s >= most_s:
            break
        found = outlook(estimate, monitored, records, memory_s, sizes)
        if all(w.change <= _SMALL for w in found if w.obstacle is not Obstacle.NO_SIZE):
            return memory_s
    return most_s


def with_load(
    estimate: Estimate,
    monitored: Sequence[str],
    records: Sequence[Record],
    memory_s: float,
    sizes: Mapping[str, float],
    weight: Mapping[str, float],
) -> tuple[Watched, ...] | None:
    """The outlook with the load at the end; None: the records hardly determine it, or are too short to calibrate it.

    Another load differs from another torque constant in friction and inertia alone, so both show less together: none of
    the others may show much less than without it, unless it still shows small changes.
    """
    if sum(record.duration_s for record in records) < _NEEDED * memory_s:
        return None
    without = outlook(estimate, monitored, records, memory_s, sizes)
    names = [*(w.name for w in without if w.obstacle is None), LOAD]
    found = {w.name: w for w in outlook(estimate, names, records, memory_s, sizes, weight)}
    most = {w.name: max(_SMALL, _HARDLY_LESS * w.change) for w in without} | {LOAD: _OF_LOAD}
    if any(w.obstacle is not None or w.change > most[name] for name, w in found.items()):
        return None
    return (*(found.get(w.name, w) for w in without), found[LOAD])


def _changes(
    estimate: Estimate,
    names: Sequence[str],
    records: Sequence[Record],
    memory_s: float,
    sizes: Mapping[str, float],
    weight: Mapping[str, float],
) -> Mapping[str, float]:
    """Smallest change of each that shows within the memory, the others being monitored, too."""
    if not names:
        return {}
    own = [name for name in names if name != LOAD or not weight]
    called, result = monitored_information(estimate, own, records, weight if LOAD in names else {})
    duration_s = sum(record.duration_s for record in records)
    longer = np.sqrt(max(duration_s / memory_s, 1.0))
    known_as = {_base(name): name for name in called}  # Ja or 1/Ja
    sd = dict(zip(known_as, np.sqrt(np.diag(result.covariance)).tolist(), strict=True))
    return {
        name: float(
            _SHOWS * longer * sd[_base(name)] / sizes.get(name, _size(estimate, known_as[_base(name)]))
        )
        for name in names
    }


def _is_zero(estimate: Estimate, name: str) -> bool:
    if name in (DELAY, LOAD):
        return False
    value = _size(estimate, name)
    signed = estimate.drive.parameter(_base(name)).least < 0
    sd = estimate.sd[estimate.names.index(name)] if signed and name in estimate.names else 0.0
    return bool(value <= _ZERO * sd)


def _base(name: str) -> str:
    return split_name(name)[0]


def _size(estimate: Estimate, name: str) -> float:
    if name == DELAY:
        return estimate.interval_s
    if name == LOAD:
        return 1.0
    base = _base(name)
    return abs(value_of(estimate.values, name)) if estimate.values[base] else 0.0
