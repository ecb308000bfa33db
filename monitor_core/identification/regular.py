"""Records on a regular grid, for what only knows one interval: ARX, subspace methods, spectra.

Where a sample was lost the grid has a place at which nothing is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monitor_core.identification.record import Bools, Record
from monitor_core.kernel.tables import Floats

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

    @property
    def known(self) -> Bools:
        """(N,) both are."""
        return self.u_known & self.y_known

    @property
    def centred(self) -> Regular:
        """Less the means of what is known."""
        u = np.where(self.u_known, self.u - self.u[self.u_known].mean(), 0.0)
        y = np.where(self.y_known, self.y - self.y[self.y_known].mean(), 0.0)
        return Regular(self.interval_s, u, y, self.u_known, self.y_known, self.name)


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


def regular(records: Sequence[Record]) -> tuple[Regular, ...]:
    """The records on a common grid.

    Raises:
        ValueError: no record, intervals that differ, or samples that are not on a grid; the text says how far off.
    """
    h = common_interval(records)
    return tuple(_on_grid(record, h) for record in records)


def _on_grid(record: Record, h: float) -> Regular:
    # Stamps drift by the last digits of the interval: each step is judged by itself.
    steps = record.intervals / h
    whole = np.maximum(np.rint(steps), 1).astype(np.int64)
    off = abs(steps - whole)
    if off.max() > _TOLERANCE:
        raise ValueError(
            f"record {record.name or '(no name)'}: {np.count_nonzero(off > _TOLERANCE)} of {off.size} intervals are"
            f" not {1e3 * h:.5g} ms or a multiple of it (up to {1e3 * h * off.max():.3g} ms off): a discrete model"
            " needs regular samples, resample it"
        )
    place = np.concatenate([[0], np.cumsum(whole)])
    u, y = np.zeros(place[-1] + 1), np.zeros(place[-1] + 1)
    u_known, y_known = np.zeros(u.size, np.bool_), np.zeros(u.size, np.bool_)
    u[place], u_known[place] = record.u, True
    y[place], y_known[place] = np.where(record.measured, record.y, 0.0), record.measured
    return Regular(h, u, y, u_known, y_known, record.name)
