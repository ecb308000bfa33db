"""History of a parameter over a year in bounded memory: an entry for each hour of operation, later for each day.

An entry is the mean over an hour of operation in which the parameter was observed.  It is closed after a day at the
latest, so that no entry is a mean over more than a day.  After a month the hours of a day are merged.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.trend.entries import HistoryEntry, as_rows, from_rows, inflation, merged

HOUR_S = 3600.0
DAY = 24
"""Longest time that an entry may span, in hours."""

HOURS, DAYS = 31 * DAY, 366
"""Numbers of kept entries: entries of an hour, and older entries of a day."""

YEAR = 400 * DAY
"""Age of an entry, in hours, after which it is deleted."""


class _Open(NamedTuple):
    """The open entry: sums of 1/variance (w), and with these weights of value and time since the first reading."""

    start_us: int
    end_us: int
    first: float
    n: int
    w: float
    wx: float
    wt: float
    operating_s: float


class SlowHistory:
    """The slow history of one parameter.

    ``hour_s``: time in operation [s] per entry; day, month and year are the usual multiples of it.
    """

    def __init__(self, hour_s: float = HOUR_S) -> None:
        self.hour_s = hour_s
        self._hours: list[HistoryEntry] = []
        self._days: list[HistoryEntry] = []
        self._gathering: list[HistoryEntry] = []  # hours of the newest day
        self._open: _Open | None = None

    @property
    def entries(self) -> tuple[HistoryEntry, ...]:
        """All closed entries, the oldest first."""
        day = [merged(self._gathering)] if self._gathering else []
        return (*self._days, *day, *self._hours)

    def take(self, t_us: int, value: float, variance: float, span_s: float, correlation: float) -> bool:
        """Add an estimate over ``span_s`` of operation; returns whether an entry was closed.

        If the clock is set back by less than a day, nothing is added until it has caught up; by more, the entries ahead
        of it are deleted.
        """
        is_late = self._open is not None and t_us - self._open.start_us > self._day_us
        closed = is_late and self._close(correlation)
        newest_us = self._open.end_us if self._open else self._hours[-1].end_us if self._hours else t_us
        if t_us < newest_us - self._day_us:
            self._forget_after(t_us)
        elif t_us < newest_us:
            return closed
        self._open = _added(
            self._open or _Open(t_us, t_us, value, 0, 0.0, 0.0, 0.0, 0.0), t_us, value, variance, span_s
        )
        if self._open.operating_s >= self.hour_s * (1 - 1e-9):
            closed = self._close(correlation)
        return closed

    @property
    def _day_us(self) -> int:
        return round(DAY * self.hour_s * 1e6)

    def _close(self, correlation: float) -> bool:
        o = self._open
        assert o is not None
        self._open = None
        variance = inflation(o.n, correlation) / (o.w / o.n) / o.n
        middle_us = min(o.start_us + round(o.wt / o.w), o.end_us)
        self._hours.append(HistoryEntry(o.start_us, o.end_us, middle_us, o.first + o.wx / o.w, variance, o.operating_s))
        self._thin(o.end_us)
        return True

    def _thin(self, now_us: int) -> None:
        while len(self._hours) > HOURS:
            oldest = self._hours.pop(0)
            day = self._gathering
            if day and (len(day) >= DAY or oldest.end_us - day[0].start_us > self._day_us):
                self._days.append(merged(day))
                self._gathering = []
            self._gathering.append(oldest)
        least_us = now_us - round(YEAR * self.hour_s * 1e6)
        self._days = [e for e in self._days[-DAYS:] if e.end_us >= least_us]
        self._gathering = [e for e in self._gathering if e.end_us >= least_us]
        self._hours = [e for e in self._hours if e.end_us >= least_us]

    def _forget_after(self, t_us: int) -> None:
        self._open = None
        for kept in (self._days, self._gathering, self._hours):
            kept[:] = [e for e in kept if e.end_us <= t_us]

    def closed_to_array(self) -> Floats:
        """All closed entries, to be saved (N + 1, 6); the first row counts days, hours of a day, and hours."""
        counts = [len(self._days), len(self._gathering), len(self._hours), self.hour_s, 0.0, 0.0]
        return np.vstack([counts, as_rows([*self._days, *self._gathering, *self._hours])])

    def open_to_array(self) -> Floats:
        """The open entry, to be saved (8,), or (0,)."""
        return np.array(self._open or (), float)

    def restore(self, closed: Floats, opened: Floats) -> None:
        """Restore saved arrays; an open entry that is older than the closed ones is left out.

        Raises:
            ValueError: the arrays are not a history, or its entries have another ``hour_s``.
        """
        if closed.ndim != 2 or len(closed) < 1 or closed.shape[1] != 6 or not np.isfinite(closed).all():
            raise ValueError("no history")
        days, day, hours, hour_s = (float(v) for v in closed[0, :4])
        if hour_s != self.hour_s:
            raise ValueError(f"its entries are of {hour_s:g} s, not of {self.hour_s:g} s")
        entries = from_rows(closed[1:])
        if min(days, day, hours) < 0 or days + day + hours != len(entries):
            raise ValueError("no history: its numbers of entries do not fit")
        a, b = int(days), int(days + day)
        self._days, self._gathering, self._hours = entries[:a], entries[a:b], entries[b:]
        self._open = _opened(opened, entries)


def _added(o: _Open, t_us: int, value: float, variance: float, span_s: float) -> _Open:
    w = 1 / variance
    return o._replace(
        end_us=t_us,
        n=o.n + 1,
        w=o.w + w,
        wx=o.wx + w * (value - o.first),
        wt=o.wt + w * (t_us - o.start_us),
        operating_s=o.operating_s + span_s,
    )


def _opened(values: Floats, entries: Sequence[HistoryEntry]) -> _Open | None:
    if values.shape != (len(_Open._fields),) or not np.isfinite(values).all():
        return None
    start_us, end_us, first, n, *sums = (float(v) for v in values)
    o = _Open(int(start_us), int(end_us), first, int(n), *sums)
    if o.n < 1 or o.w <= 0 or not o.start_us <= o.end_us:
        return None
    return None if entries and o.start_us < entries[-1].end_us else o
