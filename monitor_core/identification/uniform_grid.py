"""Records on a regular grid, for what only knows one interval: ARX, subspace methods, spectra.

Where a sample was lost the grid has a place at which nothing is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from monitor_core.arrays import Floats, Ints
from monitor_core.identification.record import Bools, Record

_TOLERANCE = 0.05
"""Of an interval: what a sample may be away from its place.  A tenth of one biases an inertia by 3 %."""


@dataclass(frozen=True, eq=False)
class Regular:
    """N samples, each one interval after the other; zero where they are not known."""

    interval_s: float
    u: Floats  # (N,) torque, N m
    y: Floats  # (N,) angle, rad, or speed, rad/s
    u_known: Bools  # (N,)
    y_known: Bools  # (N,)
    name: str = ""
    reference: Floats | None = None  # (N,) what the loop was excited with, NaN where not known

    @property
    def known(self) -> Bools:
        """(N,) both are."""
        return self.u_known & self.y_known

    @property
    def centred(self) -> Regular:
        """Less the means of what is known."""
        u = np.where(self.u_known, self.u - self.u[self.u_known].mean(), 0.0)
        y = np.where(self.y_known, self.y - self.y[self.y_known].mean(), 0.0)
        return replace(self, u=u, y=y)


def of_size_one(series: Sequence[Regular]) -> tuple[tuple[Regular, ...], float, float]:
    """The records centred, u and y over their standard deviations, and these; a lost torque counts as held."""
    su = _size([record.u[record.u_known] for record in series])
    sy = _size([record.y[record.y_known] for record in series])
    return tuple(_in_units(record.centred, su, sy) for record in series), su, sy


def common_interval(records: Sequence[Record]) -> float:
    """The interval of all records, s.

    Raises:
        ValueError: no record, or intervals that differ.
    """
    if not records:
        raise ValueError("no record")
    intervals = [record.interval_s for record in records]
    h = float(np.median(intervals))
    for record, interval in zip(records, intervals, strict=True):
        if abs(interval - h) > 1e-3 * h:
            raise ValueError(
                f"record {record.name or '(no name)'} was sampled every {1e3 * interval:.5g} ms, the others every"
                f" {1e3 * h:.5g} ms: a discrete model has one interval, resample them"
            )
    return h


def on_grid(
    records: Sequence[Record] | Sequence[Regular], reference: str | None = None
) -> tuple[Regular, ...]:
    """The records on a common grid; those that are on one already stay as they are.

    Args:
        records: one or several.
        reference: name of the signal of the records that excites their loop.

    Raises:
        ValueError: no record, intervals that differ, samples that are not on a grid (the text says how far off), or
            no such signal.
    """
    given = [record for record in records if isinstance(record, Regular)]
    if given:
        return tuple(given)
    rest = [record for record in records if isinstance(record, Record)]
    h = common_interval(rest)
    return tuple(_on_grid(record, h, reference) for record in rest)


def _on_grid(record: Record, h: float, reference: str | None) -> Regular:
    # Rounding of the interval would accumulate: each step is rounded separately.
    steps = record.intervals / h
    steps_rounded = np.maximum(np.rint(steps), 1).astype(np.int64)
    off = abs(steps - steps_rounded)
    if off.max() > _TOLERANCE:
        raise ValueError(
            f"record {record.name or '(no name)'}: {np.count_nonzero(off > _TOLERANCE)} of {off.size} intervals are"
            f" not {1e3 * h:.5g} ms or a multiple of it (up to {1e3 * h * off.max():.3g} ms off): a discrete model"
            " needs regular samples, resample it"
        )
    place = np.concatenate([[0], np.cumsum(steps_rounded)])
    u, y = np.zeros(place[-1] + 1), np.zeros(place[-1] + 1)
    u_known, y_known = np.zeros(u.size, np.bool_), np.zeros(u.size, np.bool_)
    u[place], u_known[place] = record.u, True
    y[place], y_known[place] = np.where(record.measured, record.y, 0.0), record.measured
    grid = Regular(h, u, y, u_known, y_known, record.name)
    return grid if reference is None else replace(grid, reference=_signal(record, reference, place))


def _signal(record: Record, name: str, place: Ints) -> Floats:
    if name not in record.signals:
        raise ValueError(
            f"record {record.name or '(no name)'} has no signal {name!r}; it has {', '.join(record.signals) or 'none'}"
        )
    out = np.full(int(place[-1]) + 1, np.nan)
    out[place] = record.signals[name]
    return out


def _size(parts: Sequence[Floats]) -> float:
    """Standard deviation within the records; 1 if they do not move."""
    return float(np.sqrt(np.mean(np.concatenate([(part - part.mean()) ** 2 for part in parts])))) or 1.0


def _in_units(record: Regular, su: float, sy: float) -> Regular:
    last = np.maximum.accumulate(np.where(record.u_known, np.arange(record.u.size), 0))
    return replace(record, u=record.u[last] / su, y=record.y / sy)
