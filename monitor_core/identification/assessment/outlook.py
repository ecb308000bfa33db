"""Finds which monitored parameters can be watched with the nominal values, and the smallest change that shows."""

from collections.abc import Mapping, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from monitor_core.drive.parameter_names import split_name, value_of
from monitor_core.drive.structure import DELAY, LOAD
from monitor_core.identification.greybox import Estimate, monitored_information
from monitor_core.identification.records.measured_record import Record
from monitor_core.wording import rounded_down

_MIN_SIGMAS = 3.0
"""A change shows from this number of standard deviations of the estimate, as with alpha_1 of the paper's tests."""
_ZERO_SIGMAS = 2.0
"""A value below this number of its standard deviations is not distinguished from zero."""
_MAX_CHANGE = 1.0
"""A parameter that shows only changes beyond 100 % is not watched."""


_SMALL_CHANGE = 0.2
"""Robots are monitored for changes of 20 %."""
_OF_LOAD = 0.3
"""Change of the payload that must be detected, as a share of the weight."""
_MAX_INCREASE = 1.1
_MIN_MEMORIES = 33
"""Memories that a record must contain: ten to find P(0), twenty to calibrate, the rest for unusable samples."""


class Obstacle(Enum):
    """Why a parameter cannot be watched."""

    NO_SIZE = "no-size"
    """Its nominal value is zero, or not distinguished from zero, so that relative changes have no meaning."""
    NOT_SHOWN = "not-shown"
    """The motion of the records shows it too little within the memory of the monitor."""
    TOGETHER = "together"
    """It cannot be watched together with all the others; with one parameter fewer, the remaining ones show."""


class Watched(NamedTuple):
    """One monitored parameter."""

    name: str
    change: float
    """Smallest change that shows within one memory, as a share of the given size, or else of the value"""
    obstacle: Obstacle | None


class Outlook:
    """Finds the parameters that can be watched with these nominal values and the motion of the records.

    ``sizes``: sizes given by the user, by name of the parameter; for the others the size is the value.
    """

    def __init__(self, estimate: Estimate, records: Sequence[Record], sizes: Mapping[str, float] = {}) -> None:
        self._estimate, self._records, self._sizes = estimate, records, sizes
        self._duration_s = sum(record.duration_s for record in records)
        self._known: dict[tuple[tuple[str, ...], frozenset[tuple[str, float]]], Mapping[str, float]] = {}

    def watched(
        self, monitored: Sequence[str], memory_s: float, weight: Mapping[str, float] = {}
    ) -> tuple[Watched, ...]:
        """Whether each parameter can be watched, in the order of ``monitored``.

        Args:
            monitored: names of parameters, "1/Ja" for a reciprocal.
            memory_s: memory of the monitor [s].
            weight: the weight that LOAD scales, if it is monitored, as in ``monitored_information``.
        """
        found = dict[str, Watched]()
        names = list(monitored)
        for name in monitored:
            if name not in self._sizes and _is_zero(self._estimate, name):
                found[name] = Watched(name, np.nan, Obstacle.NO_SIZE)
                names.remove(name)
        changes = self._changes(names, memory_s, weight)
        while names:
            worst = max(names, key=changes.__getitem__)
            if changes[worst] <= _MAX_CHANGE:
                break
            alone = self._changes([worst], memory_s, weight)[worst]
            obstacle = Obstacle.NOT_SHOWN if alone > _MAX_CHANGE else Obstacle.TOGETHER
            found[worst] = Watched(worst, alone, obstacle)
            names.remove(worst)
            changes = self._changes(names, memory_s, weight)
        found |= {name: Watched(name, changes[name], None) for name in names}
        return tuple(found[name] for name in monitored)

    def sufficient_memory(self, monitored: Sequence[str], memories_s: Sequence[float]) -> float:
        """The shortest of these memories [s], in ascending order, with which all watched parameters show small changes.

        If there is none, the longest one for which the records are long enough to calibrate, but at least the first.
        """
        most_s = max(memories_s[0], min(rounded_down(self._duration_s / _MIN_MEMORIES), memories_s[-1]))
        for memory_s in memories_s:
            if memory_s >= most_s:
                break
            found = self.watched(monitored, memory_s)
            if all(w.change <= _SMALL_CHANGE for w in found if w.obstacle is not Obstacle.NO_SIZE):
                return memory_s
        return most_s

    def with_load(
        self, monitored: Sequence[str], memory_s: float, weight: Mapping[str, float]
    ) -> tuple[Watched, ...] | None:
        """As ``watched``, with the load at the end; None: the records hardly determine the load, or are too short.

        A change of the load differs from one of the torque constant only by friction and inertia, so both show less
        together.  Each other parameter must still show small changes, or hardly larger ones than without the load.
        """
        if self._duration_s < _MIN_MEMORIES * memory_s:  # to calibrate it
            return None
        without = self.watched(monitored, memory_s)
        names = [*(w.name for w in without if w.obstacle is None), LOAD]
        found = {w.name: w for w in self.watched(names, memory_s, weight)}
        most = {w.name: max(_SMALL_CHANGE, _MAX_INCREASE * w.change) for w in without} | {LOAD: _OF_LOAD}
        if any(w.obstacle is not None or w.change > most[name] for name, w in found.items()):
            return None
        return (*(found.get(w.name, w) for w in without), found[LOAD])

    def _changes(self, names: Sequence[str], memory_s: float, weight: Mapping[str, float]) -> Mapping[str, float]:
        """Smallest change of each parameter that shows within the memory if the others are monitored, too."""
        if not names:
            return {}
        own = [name for name in names if name != LOAD or not weight]
        sd = self._standard_deviations(own, weight if LOAD in names else {})
        longer = np.sqrt(max(self._duration_s / memory_s, 1.0))
        known_as = {_base(name): name for name in sd}  # Ja or 1/Ja
        sizes = {name: _size(self._estimate, known_as[_base(name)]) for name in names} | dict(self._sizes)
        return {name: float(_MIN_SIGMAS * longer * sd[known_as[_base(name)]] / sizes[name]) for name in names}

    def _standard_deviations(self, names: Sequence[str], weight: Mapping[str, float]) -> Mapping[str, float]:
        """Standard deviations of these parameters from all records, and of LOAD if there is a weight.

        Kept, as they do not depend on the memory, and take as long as a step of the fit.
        """
        key = tuple(names), frozenset(weight.items())
        if key not in self._known:
            called, found = monitored_information(self._estimate, names, self._records, weight)
            self._known[key] = dict(zip(called, np.sqrt(np.diag(found.covariance)).tolist(), strict=True))
        return self._known[key]


def _is_zero(estimate: Estimate, name: str) -> bool:
    if name in (DELAY, LOAD):
        return False
    value = _size(estimate, name)
    signed = estimate.drive.parameter(_base(name)).least < 0
    sd = estimate.sd[estimate.names.index(name)] if signed and name in estimate.names else 0.0
    return bool(value <= _ZERO_SIGMAS * sd)


def _base(name: str) -> str:
    return split_name(name)[0]


def _size(estimate: Estimate, name: str) -> float:
    if name == DELAY:
        return estimate.interval_s
    if name == LOAD:
        return 1.0
    base = _base(name)
    return abs(value_of(estimate.values, name)) if estimate.values[base] else 0.0
