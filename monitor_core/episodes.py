"""Alarm episodes: one alarm from the first crossing until the deviation has calmed down.

After an alarm g starts again from zero and crosses again while the fault stays; those crossings update the open
episode.  It ends when |d| has stayed below nu for three memory lengths.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

Direction = Literal["up", "down"]
DIRECTIONS: tuple[Direction, Direction] = ("up", "down")


@dataclass(frozen=True, slots=True)
class Crossing:
    """g of a parameter crossed h.  Times in microseconds since 1970."""

    parameter: str
    direction: Direction
    time_us: int
    onset_us: int
    size: float
    size_sd: float


@dataclass(frozen=True, slots=True)
class Calm:
    """The deviation of a parameter has been below nu for three memory lengths."""

    parameter: str
    time_us: int


@dataclass(frozen=True, slots=True)
class Episode:
    """An alarm.  ``size`` is theta - theta0 at the last crossing, with its standard deviation."""

    parameter: str
    direction: Direction
    onset_us: int
    raised_us: int
    updated_us: int
    ended_us: int | None
    size: float
    size_sd: float
    crossings: int


class EpisodeBook:
    """The open episodes of one axis, at most one for each parameter and direction."""

    def __init__(self, open_episodes: Iterable[Episode] = ()) -> None:
        self._open = {(e.parameter, e.direction): e for e in open_episodes if e.ended_us is None}

    @property
    def open(self) -> tuple[Episode, ...]:
        """The open episodes."""
        return tuple(self._open.values())

    def is_open(self, parameter: str) -> bool:
        """Whether the parameter has an open episode."""
        return any(key[0] == parameter for key in self._open)

    def apply(self, event: Crossing | Calm) -> list[Episode]:
        """Take one event; returns the episodes that it raised, updated or ended, as they are now."""
        if isinstance(event, Calm):
            return self._calm(event)
        key = (event.parameter, event.direction)
        known = self._open.get(key)
        self._open[key] = _raised(event) if known is None else _updated(known, event)
        return [self._open[key]]

    def _calm(self, event: Calm) -> list[Episode]:
        keys = [key for key in self._open if key[0] == event.parameter]
        return [replace(self._open.pop(key), ended_us=event.time_us) for key in keys]


def _raised(c: Crossing) -> Episode:
    return Episode(
        parameter=c.parameter,
        direction=c.direction,
        onset_us=c.onset_us,
        raised_us=c.time_us,
        updated_us=c.time_us,
        ended_us=None,
        size=c.size,
        size_sd=c.size_sd,
        crossings=1,
    )


def _updated(e: Episode, c: Crossing) -> Episode:
    return replace(e, updated_us=c.time_us, size=c.size, size_sd=c.size_sd, crossings=e.crossings + 1)
