"""The interval of samples that are received late, and whether the times of receipt are those of the samples."""

import math

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.identification.records.measured_record import Record

_PARTS = 5
"""Number of parts of a record; in each part some frames are hardly late."""
_MIN_FRAMES = 100
"""Least number of frames from which their interval is determined"""
_PAUSE_S = 0.5
"""After a longer gap a counter may have wrapped, or the controller was off"""
_TIME_TOLERANCE = 0.5
"""Tolerance of the distance of two samples in intervals; outside it they do not belong to consecutive cycles."""
_MAX_ROUGHNESS_RATIO = 0.5
"""A motion is smoother if its third derivative is at most this share of the other one."""


def received_interval(t: Floats, cycle: Floats) -> tuple[float, float]:
    """The interval [s] of cycles (N,) received at the times t (N,) [s], and its relative uncertainty.

    Each frame has an unknown delay, but in each part of the record some have hardly any.  The interval is the slope of
    the line through the earliest ones near both ends; the earliest ones of all parts show the deviation from a line.
    The uncertainty is infinite where there are too few frames.
    """
    pauses = np.flatnonzero(np.diff(t) > _PAUSE_S) + 1
    t, cycle = max(zip(np.split(t, pauses), np.split(cycle, pauses), strict=True), key=lambda part: len(part[0]))
    if len(t) < _MIN_FRAMES or cycle[-1] == cycle[0]:
        return 0.0, math.inf
    late = t - t[0] - (cycle - cycle[0]) * (t[-1] - t[0]) / (cycle[-1] - cycle[0])
    parts = np.array_split(np.arange(len(t)), _PARTS)
    first, last = (part[late[part].argmin()] for part in (parts[0], parts[-1]))
    interval_s = float((t[last] - t[first]) / (cycle[last] - cycle[first]))
    earliest = [(t - cycle * interval_s)[part].min() for part in parts]
    return interval_s, float(np.ptp(earliest) / (t[last] - t[first]))


def is_smoother_evenly(record: Record, interval_s: float) -> bool:
    """Whether a motion, where no sample is lost, has a far smaller third derivative by even times than by its own."""
    t, y = record.t[record.measured] / interval_s, record.y[record.measured]
    steps = np.diff(t)
    near = np.abs(steps - 1) < _TIME_TOLERANCE
    usable = near[:-2] & near[1:-1] & near[2:]
    moved = np.abs(y[3:] - y[:-3])
    usable &= moved > np.median(moved)
    if np.count_nonzero(usable) < _MIN_FRAMES:
        return False
    by_time = y
    for order in (1, 2, 3):
        by_time = order * np.diff(by_time) / (t[order:] - t[:-order])
    even = np.median(np.abs(np.diff(y, 3)[usable]))
    return bool(even < _MAX_ROUGHNESS_RATIO * np.median(np.abs(by_time[usable])))
