"""What every detector has: a name, and a book of the alarms that are open by what it says."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Generic, Literal, Protocol, TypeVar

from monitor_core.detection.alarm import Alarm, Direction, Name

DetectorName = Literal["cusum", "bank"]
"""cusum: the paper's two tests of each parameter; bank: hypotheses side by side (monitor_core.detection)."""

SHOWN = 0.01
"""Probability of a cause below which it is not told."""
MOST_NAMES = 20


class Timed(Protocol):
    """An event of a detector."""

    @property
    def time_us(self) -> int:
        """When it came."""


E_contra = TypeVar("E_contra", bound=Timed, contravariant=True)


class Book(ABC, Generic[E_contra]):
    """The open episodes of one axis: the events of a detector in, alarms raised, named, corrected and ended out."""

    def __init__(self, open_alarms: Iterable[Alarm] = ()) -> None:
        self._open = [e for e in open_alarms if e.ended_us is None]

    @property
    def open(self) -> tuple[Alarm, ...]:
        """The open episodes, the oldest first."""
        return tuple(self._open)

    def is_open(self, parameter: str) -> bool:
        """Whether a parameter, or another cause, has an open episode."""
        return any(e.parameter == parameter for e in self._open)

    def apply(self, event: E_contra) -> list[Alarm]:
        """Take one event; returns the episodes that it raised, changed or ended, as they are now."""
        before = list(self._open)
        self._take(event)
        now = {_identity(e) for e in self._open}
        ended = [replace(e, ended_us=event.time_us) for e in before if _identity(e) not in now]
        return ended + [e for e in self._open if e not in before]

    @abstractmethod
    def _take(self, event: E_contra) -> None:
        """Let the event change what is open."""

    def _put(self, e: Alarm) -> None:
        """In place of what it was."""
        self._open = [e if _identity(o) == _identity(e) else o for o in self._open]

    def _end(self, ended: Sequence[Alarm]) -> None:
        self._open = [o for o in self._open if o not in ended]


def _identity(e: Alarm) -> tuple[int, str, Direction]:
    return e.raised_us, *e.first


def with_name(e: Alarm, until_us: int) -> tuple[Name, ...]:
    """What it was called, with what it is called until now; the first is always kept."""
    names = (*e.past, Name(until_us, e.stage, e.parameter, e.direction))
    return names if len(names) <= MOST_NAMES else (names[0], *names[2 - MOST_NAMES :])


def direction_of(size: float) -> Direction:
    """Up, where there is no size (NaN)."""
    return "down" if size < 0 else "up"
